//! Lobe F: light that passes the first fibre it meets as TT, and all others on its own way out (docs/model.md, section 5).

use std::f32::consts::PI;

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

/// Light that the first fibre on the camera's ray passes on, for one such fibre.
#[derive(Clone, Debug)]
pub(super) struct Forward {
    /// The first fibre.
    pub(super) spot: Spot,
    frame: LobeFrame,
    /// What TT keeps at the fibre.
    chain: Rgb,
    /// For each channel, and for the density of sampling: the share of light that meets no other fibre on its way out.
    once: Rgb,
    once_drawn: f32,
    /// Kernels and azimuthal deviations of one TT event, and of more than one.
    kappa: Rgb,
    factor: Rgb,
    sigma: [f32; 2],
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

        // Further TT events, as if light went on straight: on the mean a (1 - e^(-rho n)) / rho, taken as geometric. Two
        // lobes stand for their number: none, and the mean of the others, which is as wide as variances add up to.
        let left = crossing.fibers - met + crossings[first + 1..].iter().map(|c| c.fibers).sum::<f32>();
        let depth = optics.rho * left;
        let more = optics.chain * depth.one_minus_exp_neg() / optics.rho;
        let once = Rgb::ONE / (more + 1.0);
        let shares = Rgb::from(normalised((optics.chain * (-depth).exp()).max(Rgb::splat(1e-20)).to_array())) * 3.0;
        let events = 2.0 + more.weighted_mean(shares);
        let kappa = kappa_of_variance(Rgb::new(1.0, events, events) * optics.beta_tt_squared);

        let mut forward = Self {
            spot,
            frame: LobeFrame::new(spot.tangent, view.camera),
            chain: optics.chain,
            once,
            once_drawn: once.weighted_mean(shares),
            kappa,
            factor: normalisation(kappa),
            sigma: [optics.beta_n, events.sqrt() * optics.beta_n],
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
        let lobe = usize::from(u_lobe >= self.once_drawn);
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
        let [m_once, m_more, _] = normalised_kernel(self.kappa, self.factor, at).to_array();
        if m_once.max(m_more) * cos < FORWARD_TAIL * 1e-4 {
            return none;
        }
        let off = w.dot(self.frame.y).atan2(w.dot(self.frame.x)) - PI;
        let once = m_once * cos * wrapped_normal(off, self.sigma[0]);
        let more = m_more * cos * wrapped_normal(off, self.sigma[1]);
        let pdf = more + self.once_drawn * (once - more);
        if pdf < FORWARD_TAIL {
            return none;
        }
        let lobe = self.once * (once - more) + more;
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
