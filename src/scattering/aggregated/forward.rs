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
/// How many fibres light goes on before further fibres turn it back.
const GOES_ON: f32 = 0.8;

/// Light that the first fibre on the camera's ray passes on, for one such fibre.
#[derive(Clone, Debug)]
pub(super) struct Forward {
    /// The first fibre.
    pub(super) spot: Spot,
    frame: LobeFrame,
    /// What TT keeps at the fibre.
    chain: Rgb,
    /// Shares of light that passes no other fibre on its way out, one, and more: for each channel, and for the density of
    /// sampling.
    shares: [Rgb; 3],
    drawn_shares: [f32; 3],
    /// Kernels and azimuthal deviations of so many TT events.
    kappa: Rgb,
    factor: Rgb,
    sigma: [f32; 3],
    /// Extinction per fibre in the first fibre's ply, and how many fibres deeper further ones are met.
    rho: Rgb,
    on: f32,
    /// Share of TT that goes on; the rest goes all round and is no part of F.
    chain_share: f32,
    /// What may leave from a node where F does not, and the path's weight: they decide between both.
    gain: Rgb,
    weight: Rgb,
    /// A direction drawn from the lobe.
    pub(super) drawn: Drawn,
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

/// F in one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Toward {
    /// With the cosine, 1/steradian, over 1 - T0.
    pub(super) value: Rgb,
    /// Density of drawing the direction, 1/steradian.
    pub(super) pdf: f32,
    /// The chance that a path goes on this way, were this the direction drawn.
    pub(super) chance: f32,
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
        let (first, met) = first_fiber(view, crossings, unscattered, stream.next())?;
        let crossing = &crossings[first];
        let optics = &view.yarn.plies[crossing.ply];
        if optics.chain.max_channel() <= 0.0 {
            return None;
        }
        let spot = view.spot(crossing, if crossing.fibers > 0.0 { met / crossing.fibers } else { 0.0 });

        // Further TT events, as if light went on straight: on the mean a (1 - e^(-rho n)) / rho, taken as geometric. Three
        // lobes stand for their number: none, one, and the mean of the others, which is as wide as variances add up to.
        let left = crossing.fibers - met + crossings[first + 1..].iter().map(|c| c.fibers).sum::<f32>();
        let depth = optics.rho * left;
        let more = optics.chain * depth.one_minus_exp_neg() / optics.rho;
        let (once, again) = (Rgb::ONE / (more + 1.0), more / (more + 1.0));
        let shares = [once, once * again, again * again];
        let passed = Rgb::from(normalised((optics.chain * (-depth).exp()).max(Rgb::splat(1e-20)).to_array())) * 3.0;
        let drawn_shares = shares.map(|share| share.weighted_mean(passed));
        // Light of a channel that passes few fibres is not as wide as that of one which passes many.
        let often = shares[2] * passed;
        let events = 3.0 + more.weighted_mean(often) / often.mean().max(1e-20);
        let kappa = kappa_of_variance(Rgb::new(1.0, 2.0, events) * optics.beta_tt_squared);

        let mut forward = Self {
            spot,
            frame: LobeFrame::new(spot.tangent, view.camera),
            chain: optics.chain,
            shares,
            drawn_shares,
            kappa,
            factor: normalisation(kappa),
            sigma: [1.0, 2.0, events].map(|count| count.sqrt() * optics.beta_n),
            rho: optics.rho,
            on: GOES_ON.min(left),
            chain_share: optics.chain_share,
            gain,
            weight,
            drawn: Drawn { direction: Vec3A::ZERO, share: Rgb::ZERO, pdf: 0.0, chance: 0.0 },
        };
        forward.drawn = forward.draw_direction(view, stream);
        Some(forward)
    }

    #[inline]
    pub(super) fn draw_direction(&self, view: &View<'_>, stream: &mut Stream) -> Drawn {
        let [u_lobe, u_azimuth] = [stream.next(), stream.next()];
        let [first, second, _] = self.drawn_shares;
        let lobe = usize::from(u_lobe >= first) + usize::from(u_lobe >= first + second);
        let kappa = self.kappa.to_array()[lobe];
        let u = [stream.next(), stream.next()];
        let sin = sample_sine(kappa, self.frame.sin, self.frame.cos, u, stream);
        let direction = self.frame.direction(sin, PI + self.sigma[lobe] * normal(u_azimuth));
        let Toward { value, pdf, chance } = self.toward(view, direction);
        let share = if pdf > 0.0 { value / pdf } else { Rgb::ZERO };
        Drawn { direction, share, pdf, chance }
    }

    /// The lobe towards `w`.
    #[inline]
    pub(super) fn toward(&self, view: &View<'_>, w: Vec3A) -> Toward {
        let none = Toward { value: Rgb::ZERO, pdf: 0.0, chance: 0.0 };
        let (at, cos) = self.frame.latitudes(w);
        let along = normalised_kernel(self.kappa, self.factor, at);
        if along.max_channel() * cos < FORWARD_TAIL * 1e-4 {
            return none;
        }
        let off = w.dot(self.frame.y).atan2(w.dot(self.frame.x)) - PI;
        let around = self.sigma.map(|sigma| wrapped_normal(off, sigma));
        let all = along * Rgb::from(around) * cos;
        let pdf = 3.0 * Rgb::from(self.drawn_shares).weighted_mean(all);
        if pdf < FORWARD_TAIL {
            return none;
        }
        let [once, twice, often] = all.to_array();
        let even = (1.0 - self.chain_share) / TAU;
        let once = once * (1.0 - even / around[0]).max(0.0) / self.chain_share;
        // Light that further fibres turned back was deeper in the ply than the way out from the first one.
        let turned = 1.0 - off.cos();
        let deeper = (self.rho * (-0.5 * self.on * turned * turned)).exp();
        let lobe = self.shares[0] * once + (self.shares[1] * twice + self.shares[2] * often) * deeper;
        // What is drawn for all channels together holds the lobe of each but for rare directions.
        let value = (self.chain * (-self.depth(view, w)).exp() * lobe).min(Rgb::splat(pdf));
        let share = value / pdf;
        let passed = share.weighted_mean(self.weight);
        let ended = ((Rgb::ONE - share) * self.gain).weighted_mean(self.weight);
        Toward { value, pdf, chance: if passed > 0.0 { passed / (passed + ended) } else { 0.0 } }
    }

    /// Optical depth of chains between the first fibre and the outside: a fibre's own chord keeps others away.
    #[inline]
    fn depth(&self, view: &View<'_>, w: Vec3A) -> Rgb {
        let (yarn, spot) = (view.yarn, &self.spot);
        let tilt = spot.tilt(view.section, w);
        let mut depth = Rgb::ZERO;
        view.section.plies_ahead(yarn.occluder().shape(), &spot.inside, Vec3A::ZERO, w, |ahead| {
            let optics = &yarn.plies[ahead.ply];
            let chord = yarn.occluder().shape().plies[ahead.ply].chord(ahead.offset, ahead.length);
            let mut fibers = tilt * chord.ahead(-ahead.foot);
            if ahead.ply == spot.ply {
                fibers = (fibers - optics.gaps.density).max(0.0);
            }
            depth += optics.rho * fibers;
        });
        depth
    }
}

/// The crossing in which a ray meets its first fibre, and the expected fibres before it there: `u` of the light that is
/// not unscattered has met one by then.
#[inline]
fn first_fiber(view: &View<'_>, crossings: &[PlyCrossing], unscattered: f32, u: f32) -> Option<(usize, f32)> {
    let mut left = 1.0 - u * (1.0 - unscattered);
    let (last, before) = crossings.split_last()?;
    for (index, c) in before.iter().enumerate() {
        let gaps = &view.yarn.plies[c.ply].gaps;
        let through = gaps.unscattered(c.fibers);
        if left > through {
            return Some((index, gaps.fibers_passed(left).min(c.fibers)));
        }
        left = (left / through.max(1e-30)).min(1.0);
    }
    Some((before.len(), view.yarn.plies[last.ply].gaps.fibers_passed(left).min(last.fibers)))
}
