//! Where on the camera's chord light ends its chain of TT (docs/model.md, section 4).

use super::{
    super::lobe::{choose, normalised},
    AggregatedYarn,
};
use crate::{
    geometry::section::{Crossings, PlyCrossing},
    math::Rgb,
};

/// A place at which light ends its chain, drawn for all channels together.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainEnd {
    /// The camera's ray in the ply.
    pub(super) crossing: PlyCrossing,
    /// The share of the ply's fibres before it.
    pub(super) x: f32,
    /// Density of ends here for each channel over the density with which this one was drawn.
    pub(super) weight: Rgb,
    /// Of light that ends its chain anywhere on the chord: about the share that leaves the yarn in the end.
    pub(super) gain: Rgb,
}

impl ChainEnd {
    /// Draws one: a ply by the energy that leaves from it, a place by the law of a channel drawn with `weight`, the path's.
    ///
    /// Where fibres are told apart, as many chains end at the `first_fiber` as a fibre ends: there the place's number is drawn by.
    /// A chain that keeps a share at each fibre falls as e^(-rho n). `None` if no light leaves.
    #[inline]
    pub(super) fn draw(
        yarn: &AggregatedYarn,
        crossings: &Crossings,
        weight: Rgb,
        [u_ply, u_depth]: [f32; 2],
        first_fiber: Option<f32>,
    ) -> Option<Self> {
        let depths = crossings.iter().map(|c| yarn.plies[c.ply].rho * c.fibers);
        let all = depths.clone().fold(Rgb::ZERO, |a, b| a + b).one_minus_exp_neg();
        let inverse = Rgb::ONE / all.max(Rgb::splat(1e-30));

        let mut reaching = inverse;
        let (mut gain, mut total) = (Rgb::ZERO, 0.0);
        let mut chosen: Option<(&PlyCrossing, Rgb, f32)> = None;
        let mut pick = u_ply;
        for (c, depth) in crossings.iter().zip(depths) {
            let ended = reaching * depth.one_minus_exp_neg();
            let leaving = ended * yarn.node_gain[c.ply];
            gain += leaving;
            let energy = leaving.weighted_mean(weight);
            if energy > 0.0 {
                // Reservoir of one: the same uniform number serves all plies.
                total += energy;
                let chance = energy / total;
                if pick < chance {
                    chosen = Some((c, ended, energy));
                    pick /= chance;
                } else {
                    pick = (pick - chance) / (1.0 - chance);
                }
                pick = pick.clamp(0.0, 0.999_999_94);
            }
            reaching *= (-depth).exp();
        }
        let (crossing, ended, energy) = chosen?;

        let optics = &yarn.plies[crossing.ply];
        let depth = optics.rho * crossing.fibers;
        let share = depth.one_minus_exp_neg();
        let chances = normalised((ended * yarn.node_gain[crossing.ply] * weight).to_array());
        let channel = choose(chances, pick);
        let (d, e) = (depth.to_array()[channel], share.to_array()[channel]);
        let u_depth = match first_fiber {
            Some(first) if std::ptr::eq(crossing, &crossings[0]) => {
                let ends = 1.0 - optics.chain.to_array()[channel];
                if u_depth < ends { first } else { (u_depth - ends) / (1.0 - ends) }
            }
            _ => u_depth,
        };
        let x = if d > 1e-4 { (-(-u_depth * e).ln_1p() / d).clamp(0.0, 1.0) } else { u_depth };
        // Density of x in [0, 1] for each channel: d e^-dx / (1 - e^-d), 1 for d -> 0.
        let fall = (depth * -x).exp();
        let density = fall * depth.select_below(1e-6, Rgb::ONE, depth / share.max(Rgb::splat(1e-30)));
        let drawn = Rgb::from(chances).weighted_mean(density) * 3.0 * (energy / total);
        Some(Self { crossing: *crossing, x, weight: ended * density / drawn.max(1e-30), gain })
    }
}
