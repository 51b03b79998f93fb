//! Lobe F: light that passes the first fibre it meets as TT, and all others on its own way out (docs/model.md, section 5).

use std::f32::consts::{PI, TAU};

use glam::Vec3A;

use super::{
    super::{
        kernel::{kappa_of_variance, normalisation, normalised_kernel, sample_sine},
        lobe::{LobeFrame, normalised},
    },
    Spot, View,
};
use crate::{
    geometry::section::{Crossings, PlyCrossing},
    math::{Rgb, sampler::Stream, special::wrapped_normal, warp::normal},
};

/// Density (1/steradian) of F's directions below which the lobe ends. What little it would have there ends its chain
/// instead, and most light that comes from elsewhere pays nothing for F.
const FORWARD_TAIL: f32 = 1e-4;
/// Light that further fibres bend passes so many more fibres than there are on its last way from the first one, and so many
/// more by how far it turned: nothing straight on, four times as many back.
const DETOUR: f32 = 0.4;
const BACK: f32 = 2.5;

/// Light that the first fibre on the camera's ray passes on, for one such fibre.
#[derive(Clone, Debug)]
pub(super) struct Forward {
    /// The first fibre.
    pub(super) spot: Spot,
    frame: LobeFrame,
    /// What TT keeps at the fibre.
    chain: Rgb,
    /// Share of TT that goes on; the rest goes all round and is no part of F.
    chain_share: f32,
    /// Extinction of chains per fibre in the first one's ply.
    rho: Rgb,
    /// Kernels and azimuthal deviations of one TT event, of two, and of more.
    kappa: Rgb,
    factor: Rgb,
    sigma: [f32; 3],
    /// Where light goes on from the first fibre, if it meets more.
    more: More,
    /// What may leave from a node where F does not, and the path's weight: they decide between both.
    gain: Rgb,
    weight: Rgb,
    /// A direction drawn from the lobe.
    pub(super) drawn: Drawn,
}

/// Light that further fibres bend, by the direction in which it left the first one.
#[derive(Clone, Copy, Debug)]
struct More {
    /// Of the light: the shares that one more fibre passes on, and that several do, over what the first one keeps.
    shares: [Rgb; 2],
    /// Of sampling.
    drawn: [f32; 2],
    /// Optical depth of chains in that direction.
    depth: Rgb,
}

/// A direction of F.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) direction: Vec3A,
    /// Value over density: at most 1, since the light came this way or ended its chain.
    pub(super) share: Rgb,
    pub(super) pdf: f32,
    /// The chance that a path goes on this way.
    pub(super) chance: f32,
}

/// A part of what F sends in one direction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Part {
    /// With the cosine, 1/steradian, over 1 - T0.
    pub(super) value: Rgb,
    /// Density of drawing the direction, 1/steradian.
    pub(super) pdf: f32,
    /// The chance that a path goes on this way, were this the direction drawn.
    pub(super) chance: f32,
}

impl Part {
    /// The density with which a path goes on this way, 1/steradian.
    #[inline]
    pub(super) fn density(&self) -> f32 {
        self.chance * self.pdf
    }
}

/// Lobes of one TT event, of two, and of more in one direction.
#[derive(Clone, Copy, Debug)]
struct Lobes {
    /// With the cosine, 1/steradian.
    values: [f32; 3],
    /// That of one event around the fibre alone, 1/radian.
    around: f32,
    /// By how much the direction turns from straight on: 1 less the cosine.
    turned: f32,
}

/// What is ahead of the first fibre in a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    /// Optical depth of chains.
    chains: Rgb,
    /// The share of light that meets no fibre, and its optical depth.
    through: f32,
    unscattered: f32,
    /// Expected fibres.
    fibers: f32,
}

impl Forward {
    /// Draws the first fibre that a ray meets, and a direction. `gain` is [`super::chain::ChainEnd::gain`], `weight` the
    /// path's. `None` if nothing passes fibres.
    #[inline]
    pub(super) fn draw(
        view: &View<'_>,
        crossings: &Crossings,
        unscattered: f32,
        gain: Rgb,
        weight: Rgb,
        stream: &mut Stream,
    ) -> Option<Self> {
        let (first, met) = first_fiber(crossings, unscattered, stream.next())?;
        let crossing = &crossings[first];
        let optics = &view.yarn.plies[crossing.ply];
        if optics.chain.max_channel() <= 0.0 {
            return None;
        }
        let spot = view.spot(crossing, if crossing.fibers > 0.0 { met / crossing.fibers } else { 0.0 });
        let mut forward = Self {
            spot,
            frame: LobeFrame::new(spot.tangent, view.camera),
            chain: optics.chain,
            chain_share: optics.chain_share,
            rho: optics.rho,
            kappa: Rgb::ZERO,
            factor: Rgb::ZERO,
            sigma: [0.0; 3],
            more: More { shares: [Rgb::ZERO; 2], drawn: [0.0; 2], depth: Rgb::ZERO },
            gain,
            weight,
            drawn: Drawn { direction: Vec3A::ZERO, share: Rgb::ZERO, pdf: 0.0, chance: 0.0 },
        };
        forward.events(view, 3.0);
        let first = forward.direction(0, stream);
        let ahead = forward.ahead(view, first);
        forward.meets_more(view, &ahead);
        forward.drawn = forward.draw_direction(view, first, &ahead, stream);
        Some(forward)
    }

    /// Sets how many TT events several are. What normalises their kernels waits until that is known.
    #[inline]
    fn events(&mut self, view: &View<'_>, several: f32) {
        let optics = &view.yarn.plies[self.spot.ply];
        let events = [1.0, 2.0, several];
        self.kappa = kappa_of_variance(Rgb::from(events) * optics.beta_tt_squared);
        self.sigma = events.map(|count| count.sqrt() * optics.beta_n);
    }

    /// Of light that leaves the first fibre in a direction: what meets other fibres, and how many. They are met in the renewal
    /// process of [`crate::geometry::occluder::PlyGaps`], and each passes on the same share.
    #[inline]
    pub(super) fn meets_more(&mut self, view: &View<'_>, ahead: &Ahead) {
        let optics = &view.yarn.plies[self.spot.ply];
        let gaps = &optics.gaps;
        let none = ahead.through;
        // Anywhere on the way, and nothing behind its own chord.
        let open = (ahead.unscattered - gaps.rate * gaps.dead_zone).max(0.0);
        let one = (open * (-open).exp()).min(1.0 - none);
        let kept = (-ahead.chains).exp();
        let several = (kept - Rgb::splat(none) - self.chain * one).max(Rgb::ZERO).min(Rgb::splat(1.0 - none - one));
        let shares = [self.chain * one, several];
        // Shares of sampling, and how many fibres several are: of all that light of a channel meets on the mean, what is
        // not one.
        let all = (shares[0] + shares[1]).max(Rgb::splat(1e-20));
        let passed = Rgb::from(normalised((self.chain * all * self.weight).max(Rgb::splat(1e-20)).to_array())) * 3.0;
        let often = shares[1] / all * passed;
        let loss = Rgb::splat(gaps.rate) - optics.rho;
        let mean = loss * ahead.fibers / (loss * gaps.dead_zone + 1.0);
        let count =
            ((mean * kept - shares[0]) / several.max(Rgb::splat(1e-6))).max(Rgb::splat(2.0)).min(Rgb::splat(32.0));
        let drawn = shares.map(|share| (share / all).weighted_mean(passed) * (1.0 - none));
        self.more = More { shares, drawn, depth: ahead.chains };
        if drawn[1] > 0.0 {
            self.events(view, 1.0 + count.weighted_mean(often) / often.mean().max(1e-20));
        }
        self.factor = normalisation(self.kappa);
    }

    /// Draws a direction of F: that in which light left the `first` fibre, or one in which others send it.
    #[inline]
    pub(super) fn draw_direction(&self, view: &View<'_>, first: Vec3A, ahead: &Ahead, stream: &mut Stream) -> Drawn {
        let u = stream.next();
        let (direction, part) = if u < ahead.through {
            (first, self.alone(&self.lobes(first), ahead))
        } else {
            let lobe = if u < ahead.through + self.more.drawn[0] { 1 } else { 2 };
            let direction = self.direction(lobe, stream);
            let lobes = self.lobes(direction);
            (direction, self.bent(&lobes, &self.ahead(view, direction)))
        };
        let share = if part.pdf > 0.0 { part.value / part.pdf } else { Rgb::ZERO };
        Drawn { direction, share, pdf: part.pdf, chance: part.chance }
    }

    /// A direction of one of the lobes.
    #[inline]
    pub(super) fn direction(&self, lobe: usize, stream: &mut Stream) -> Vec3A {
        let u_azimuth = stream.next();
        let u = [stream.next(), stream.next()];
        let sin = sample_sine(self.kappa.to_array()[lobe], self.frame.sin, self.frame.cos, u, stream);
        self.frame.direction(sin, PI + self.sigma[lobe] * normal(u_azimuth))
    }

    /// F towards `w`: light that the first fibre alone bends, and light that others bend too.
    #[inline]
    pub(super) fn toward(&self, view: &View<'_>, w: Vec3A) -> [Part; 2] {
        let lobes = self.lobes(w);
        let [once, ..] = lobes.values;
        if once < FORWARD_TAIL && self.density_of_bent(&lobes) < FORWARD_TAIL {
            return [Part::default(); 2];
        }
        let ahead = self.ahead(view, w);
        [self.alone(&lobes, &ahead), self.bent(&lobes, &ahead)]
    }

    #[inline]
    fn lobes(&self, w: Vec3A) -> Lobes {
        let (at, cos) = self.frame.latitudes(w);
        let along = normalised_kernel(self.kappa, self.factor, at) * cos;
        if along.max_channel() < FORWARD_TAIL * 1e-4 {
            return Lobes { values: [0.0; 3], around: 1.0, turned: 0.0 };
        }
        let off = w.dot(self.frame.y).atan2(w.dot(self.frame.x)) - PI;
        let around = self.sigma.map(|sigma| wrapped_normal(off, sigma));
        Lobes { values: (along * Rgb::from(around)).to_array(), around: around[0], turned: 1.0 - off.cos() }
    }

    /// What the first fibre alone bends: nothing else is met on the way out.
    #[inline]
    fn alone(&self, lobes: &Lobes, ahead: &Ahead) -> Part {
        let pdf = lobes.values[0] * ahead.through;
        let even = (1.0 - self.chain_share) / TAU;
        self.part(Rgb::splat(pdf * (1.0 - even / lobes.around).max(0.0) / self.chain_share), pdf)
    }

    /// What others bend too.
    #[inline]
    fn bent(&self, lobes: &Lobes, ahead: &Ahead) -> Part {
        let [_, twice, often] = lobes.values;
        let More { shares, depth, .. } = &self.more;
        let farther = DETOUR + BACK * lobes.turned * lobes.turned;
        let way = (*depth - ahead.chains - self.rho * farther).exp();
        self.part((shares[0] * twice + shares[1] * often) * way, self.density_of_bent(lobes))
    }

    #[inline]
    fn density_of_bent(&self, lobes: &Lobes) -> f32 {
        self.more.drawn[0] * lobes.values[1] + self.more.drawn[1] * lobes.values[2]
    }

    /// A part of F, by its value over what the first fibre keeps, and its density.
    #[inline]
    fn part(&self, value: Rgb, pdf: f32) -> Part {
        if pdf < FORWARD_TAIL {
            return Part::default();
        }
        // What is drawn for all channels together holds the lobe of each but for rare directions.
        let value = (self.chain * value).min(Rgb::splat(pdf));
        let share = value / pdf;
        let passed = share.weighted_mean(self.weight);
        let ended = ((Rgb::ONE - share) * self.gain).weighted_mean(self.weight);
        Part { value, pdf, chance: if passed > 0.0 { passed / (passed + ended) } else { 0.0 } }
    }

    /// What is between the first fibre and the outside: a fibre's own chord keeps others away.
    #[inline]
    pub(super) fn ahead(&self, view: &View<'_>, w: Vec3A) -> Ahead {
        let (yarn, spot) = (view.yarn, &self.spot);
        let (tilt, thin) = (spot.tilt(view.section, w), view.section.thinness());
        let mut all = Ahead { chains: Rgb::ZERO, through: 1.0, unscattered: 0.0, fibers: 0.0 };
        view.section.plies_ahead(yarn.occluder().shape(), &spot.inside, Vec3A::ZERO, w, |ahead| {
            let optics = &yarn.plies[ahead.ply];
            let chord = yarn.occluder().shape().plies[ahead.ply].chord(ahead.offset, ahead.length, thin);
            let mut fibers = tilt * chord.ahead(-ahead.foot);
            if ahead.ply == spot.ply {
                fibers = (fibers - optics.gaps.dead_zone).max(0.0);
            }
            all.chains += optics.rho * fibers;
            all.unscattered += optics.gaps.rate * fibers;
            all.fibers += fibers;
        });
        all.through = (-all.unscattered).exp();
        all
    }
}

/// The crossing in which a ray meets its first fibre, and the expected fibres before it there: `u` of the light that is
/// not unscattered has met one by then.
#[inline]
fn first_fiber(crossings: &[PlyCrossing], unscattered: f32, u: f32) -> Option<(usize, f32)> {
    let mut left = 1.0 - u * (1.0 - unscattered);
    let (last, before) = crossings.split_last()?;
    for (index, c) in before.iter().enumerate() {
        let through = c.gaps.unscattered(c.fibers);
        if left > through {
            return Some((index, c.gaps.fibers_passed(left).min(c.fibers)));
        }
        left = (left / through.max(1e-30)).min(1.0);
    }
    Some((before.len(), last.gaps.fibers_passed(left).min(last.fibers)))
}
