//! Yarn models that know the camera's chord only: the paper's, in two readings, and a repair of its energies.
//!
//! All send light back by R and D of single fibres and by B, and on by F, with energies that depend on the fibres on
//! the camera's ray and widths that depend on nothing else. They are there to compare with [`super::aggregated`].
//!
//! | | [`ChordModel::TwoStream`] | [`ChordModel::Paper`] | [`ChordModel::Printed`] |
//! |---|---|---|---|
//! | fibres on a ray | counted form ([`PlyCrossing::fibers`]) | the same | d l sqrt(n / pi) (Eq. 2) |
//! | unscattered light | e^-n | e^-n | none |
//! | ply's energies | two streams, all orders | Eqs. 8 to 10, Poisson mean | Eqs. 8 to 10, real n |
//! | R and D | back half, taken off B | back half, taken off B | full circle and weight, also in B |
//! | azimuth of B | back half | full circle (Eq. 12) | full circle (Eq. 12) |
//! | several plies | in order | in order | Eq. 14 |
//!
//! [`ChordModel::DualScattering`] is the classical form that the paper starts from (Zinke et al. 2008, Yuksel 2008): as
//! `Paper`, but the averaged fibre has no D, and light that meets a fibre turns back among infinitely many. It is not missed
//! in what passes, so that thin yarns of pale fibres return more than they get.
//!
//! In order: B_1 + F_1^2 B_2 + F_1^2 F_2^2 B_3 ..., which is what Eq. 14 seems to mean; as printed it counts each ply
//! twice and dims none. Forward, plies multiply (Eq. 14). All use the kernel of [`super::kernel`] for every
//! longitudinal lobe, since the printed one (Eq. 5) neither conserves energy nor is reciprocal.
//!
//! `Printed` returns more light than it gets, up to twice: that is what it is for, and nothing here stops it.

mod averaged;
#[cfg(test)]
mod tests;
mod vertex;

use std::sync::Arc;

use super::{
    closed_forms::{
        endless_back, endless_steps, mean_steps, once_back, passed, poisson_mean_steps, poisson_once_back,
        poisson_passed, poisson_thrice_back, thrice_back, two_stream,
    },
    fiber::FiberMaterial,
};
use crate::geometry::{
    occluder::{Occluder, Transparency},
    section::PlyCrossing,
    yarn::YarnShape,
};
use averaged::AveragedFiber;
pub use vertex::ChordVertex;

/// Which of the models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChordModel {
    /// The energies of two streams, light forward and light back, in each ply.
    TwoStream,
    /// The most charitable reading of the paper.
    Paper,
    /// The paper's equations as printed; only what cannot be read is mended.
    Printed,
    /// Classical dual scattering: no D in the averages, infinitely many fibres behind.
    DualScattering,
}

impl ChordModel {
    /// Whether R and D keep to the back half of the circle.
    #[inline]
    fn half_single(self) -> bool {
        self != Self::Printed
    }

    /// Whether B does.
    #[inline]
    fn half_b(self) -> bool {
        self == Self::TwoStream
    }
}

/// What all fibres on a ray do to light, per channel: energies of the lobes and their variances.
#[derive(Clone, Copy, Debug, Default)]
struct Aggregate {
    r: [f64; 3],
    d: [f64; 3],
    f: [f64; 3],
    b: [f64; 3],
    forward_latitude: [f64; 3],
    forward_azimuth: [f64; 3],
    back_latitude: [f64; 3],
}

/// A yarn's shape and the averages of its fibres.
#[derive(Clone, Debug)]
pub struct ChordYarn {
    occluder: Occluder,
    plies: Vec<AveragedFiber>,
    model: ChordModel,
}

impl ChordYarn {
    /// One material for each ply of the shape, which several yarns may share.
    ///
    /// # Panics
    /// If their numbers differ.
    pub fn new(shape: impl Into<Arc<YarnShape>>, materials: &[&FiberMaterial], model: ChordModel) -> Self {
        let shape = shape.into();
        assert_eq!(shape.plies.len(), materials.len(), "one material for each ply");
        let plies = shape.plies.iter().zip(materials).map(|(p, m)| AveragedFiber::new(m, p, model)).collect();
        // As printed the model has no light that passes: a ply is opaque.
        let transparency = if model == ChordModel::Printed { Transparency::Opaque } else { Transparency::Random };
        Self { occluder: Occluder::new(shape, transparency), plies, model }
    }

    /// The yarn without its colours: what rays see that only ask whether they pass.
    #[inline]
    pub fn occluder(&self) -> &Occluder {
        &self.occluder
    }

    /// n_l of the model.
    #[inline]
    fn fibers(&self, crossing: &PlyCrossing) -> f64 {
        if self.model != ChordModel::Printed {
            return f64::from(crossing.fibers);
        }
        let h = f64::from(crossing.offset / self.occluder.shape().plies[crossing.ply].radius);
        self.plies[crossing.ply].printed_fibers * (1.0 - h * h).max(0.0).sqrt()
    }

    /// The lobes of plies in order, each with its number of fibres.
    fn aggregate(&self, plies: impl Iterator<Item = (usize, f64)> + Clone) -> Aggregate {
        let mut out = Aggregate::default();
        for c in 0..3 {
            self.aggregate_channel(c, plies.clone(), &mut out);
        }
        out
    }

    fn aggregate_channel(&self, c: usize, plies: impl Iterator<Item = (usize, f64)>, out: &mut Aggregate) {
        let printed = self.model == ChordModel::Printed;
        let (mut reaching, mut depth, mut events) = (1.0, 0.0, 0.0);
        let (mut latitude, mut azimuth) = (0.0, 0.0);
        let (mut weights, mut weighted) = (0.0, 0.0);
        for (index, (ply, n)) in plies.enumerate() {
            let fiber = &self.plies[ply];
            let (loss, back) = (fiber.loss[c], fiber.back[c]);
            let front = index == 0;
            // Eq. 8, Eq. 10, and the share of the latter that is single scattering at the first fibre.
            let (mut returned, transmitted, single) = match self.model {
                ChordModel::TwoStream => {
                    let (r, t) = two_stream(fiber.absorbed[c], back, n);
                    (r, t, -0.5 * (-2.0 * n).exp_m1())
                }
                ChordModel::Paper => {
                    let once = back * poisson_once_back(loss, n);
                    let thrice = back.powi(3) * poisson_thrice_back(loss, n);
                    (once + thrice, poisson_passed(loss, n), -(-n).exp_m1())
                }
                ChordModel::DualScattering => {
                    let (once, thrice) = endless_back(loss, back);
                    let met = -(-n).exp_m1();
                    ((once + thrice) * met, poisson_passed(loss, n), met)
                }
                ChordModel::Printed => {
                    (back * once_back(loss, n) + back.powi(3) * thrice_back(loss, n), passed(loss, n), 1.0)
                }
            };
            let steps = match self.model {
                ChordModel::Printed => mean_steps(loss, n),
                ChordModel::DualScattering => endless_steps(loss),
                ChordModel::TwoStream | ChordModel::Paper => poisson_mean_steps(loss, n, front),
            };
            if front {
                let share = if printed { 1.0 } else { 0.5 * single };
                (out.r[c], out.d[c]) = (fiber.r[c] * share, fiber.d[c] * share);
                if !printed {
                    // What R and D show is no longer B's. Turned-back TT has no lobe of its own and stays here.
                    let averaged_d = if self.model == ChordModel::DualScattering { 0.0 } else { out.d[c] };
                    returned = (returned - out.r[c] - averaged_d).max(0.0);
                }
            }
            // Printed Eq. 14: sum of a_B (1 + a_F^2) over plies, none dimmed by those before it. A yarn of one ply is
            // that ply.
            let twice = printed && self.plies.len() > 1;
            let weight = returned * reaching * reaching;
            out.b[c] += if twice { returned * (1.0 + transmitted * transmitted) } else { weight };
            // Eq. 12, which the appendix does not derive; then Eq. 17 with its weights read as products of the plies
            // before, and divided by their sum: v_B + 2 (v_F of the plies before).
            weights += weight;
            weighted += weight * (fiber.back_latitude[c] + 2.0 * (fiber.forward_latitude[c] * steps + latitude));
            // Eq. 11 as variances: printed, v is a sum of widths in one place and a width in the next. Of a Poisson
            // number of fibres, forward light has met n a_F in the mean.
            let met = if printed { n } else { n * fiber.forward[c] };
            latitude += met * fiber.forward_latitude[c];
            azimuth += met * fiber.forward_azimuth[c];
            events += met;
            reaching *= transmitted;
            depth += n;
        }
        // F is light that met at least one fibre. (Eqs. 15 and 17 contradict each other on how plies add up; light
        // in F has passed all of them.)
        let scattered = if printed { 1.0 } else { -(-events).exp_m1() };
        if scattered > 0.0 {
            latitude /= scattered;
            azimuth /= scattered;
        }
        let unscattered = if printed { 0.0 } else { (-depth).exp() };
        out.f[c] = (reaching - unscattered).max(0.0);
        out.forward_latitude[c] = latitude;
        out.forward_azimuth[c] = azimuth;
        out.back_latitude[c] = if weights > 0.0 { weighted / weights } else { 0.0 };
    }
}
