//! A ply as a medium of fibres: what its material and its packing give before any ray is known, in `f64`.

use std::{
    f64::consts::{FRAC_PI_4, PI},
    sync::Arc,
};

use super::{
    escape::{self, Leaving, Medium, Solutions},
    fiber::FiberMaterial,
    kernel::{kappa_of_variance, normalisation},
};
use crate::{
    geometry::{density::AfterFiber, occluder::PlyGaps, yarn::PlyShape},
    math::{Rgb, special::escape_probability_of_disc},
};

/// Constants of the aggregated model that were calibrated on explicit fibres (untwisted single plies only).
mod calibrated {
    /// Weight of a fibre's own width in the escape of multiply scattered light.
    pub(super) const ESCAPE_OF_FIBER: f64 = 0.7;
    /// How much of the neighbours' view counts already when light leaves its own ply; the rest is followed by direction.
    pub(super) const NEIGHBOURS_AT_ONCE: f64 = 0.25;
}

/// Share of the surroundings of a ply that an equal ply which touches it takes.
const VIEW_OF_TOUCHING_PLY: f64 = 0.1817;

/// Below this ratio of their variances R is much narrower than TT.
const SHARP: f64 = 0.3;

/// The effective extinction, per expected fibre, of a chain of light that keeps the weight `1 - loss` at each fibre,
/// when hard cores of area fraction `density` keep fibres apart.
///
/// rate = (b - W0(a b e^b)) / eta with b = eta / (1 - eta): 1 - a for sparse fibres, 1 / (1 - eta) for a = 0.
pub(crate) fn extinction_rate(loss: f64, density: f64) -> f64 {
    let b = density / (1.0 - density);
    if b < 1e-4 {
        return loss;
    }
    if loss >= 1.0 {
        return 1.0 / (1.0 - density);
    }
    if loss <= 0.0 {
        return 0.0;
    }
    if loss < 0.5 {
        // Newton for log1p(-x / b) - x = log1p(-loss): no difference of near equals for small losses.
        let goal = (-loss).ln_1p();
        let mut x = b * loss / (1.0 + b);
        for _ in 0..6 {
            x += ((-x / b).ln_1p() - x - goal) / (1.0 / (b - x) + 1.0);
        }
        x / density
    } else {
        // Halley-free iteration for Lambert's W of e^l, which never forms e^l for large l.
        let l = (1.0 - loss).ln() + b.ln() + b;
        let mut w = if l < 1.0 { l.exp() / (1.0 + l.exp()) } else { l - l.ln() * l / (1.0 + l) };
        for _ in 0..6 {
            w *= (1.0 + l - w.ln()) / (1.0 + w);
        }
        (b - w) / density
    }
}

/// Width of a lobe of TT: of [`super::kernel`], with its normalisation, and azimuthal, radians.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TtWidth {
    pub kappa: f32,
    /// As above.
    pub factor: f32,
    /// As above.
    pub sigma: f32,
}

impl TtWidth {
    /// That of these widths, radians squared and radians.
    fn new(beta_tt_squared: f32, beta_n: f32) -> Self {
        let kappa = kappa_of_variance(Rgb::splat(beta_tt_squared));
        let [factor, ..] = normalisation(kappa).to_array();
        Self { kappa: kappa.to_array()[0], factor, sigma: beta_n }
    }
}

/// A ply's fibres as light sees them. Lengths in yarn radii; albedos per channel.
#[derive(Clone, Debug)]
pub(crate) struct PlyOptics {
    /// What passes between them.
    pub gaps: PlyGaps,
    /// Share of TT that goes on forward in a chain.
    pub chain_share: f32,
    /// Extinction per expected fibre of light that may pass fibres as TT; at least [`LEAST_RATE`].
    pub rho: Rgb,
    /// Weight that TT keeps on its way forward, at each fibre.
    pub chain: Rgb,
    /// Energy of single scattering by R, over what leaves the chain.
    pub single_r: Rgb,
    /// Energy of single scattering by D, over what leaves the chain.
    pub single_d: Rgb,
    /// Energy of single scattering by the part of TT that leaves the chain, over what leaves it.
    pub single_tt: Rgb,
    /// Their sum: the albedo of an event that ends a chain.
    pub albedo: Rgb,
    /// Of light scattered twice or more, evenly in the ply: the share that leaves the yarn at last, when its other plies are
    /// met at random.
    pub leaves_yarn: Rgb,
    /// What leaves this ply at last of light that meets another fibre after one at a place in it, and what leaves the yarn at last
    /// of light that meets a fibre of this ply on its way from another one.
    pub leaving: Arc<Leaving>,
    /// Of that light: the share that was only ever reflected, and keeps a longitudinal lobe.
    pub mirrored: Rgb,
    /// Inverse width of that lobe, of [`super::kernel`], and its normalisation.
    pub mirrored_kappa: Rgb,
    /// As above.
    pub mirrored_factor: Rgb,
    /// Whether R is so much narrower than TT that what met no TT on its way is told from what did.
    pub sharp: bool,
    /// Of light that goes on in chains: TT events per expected fibre.
    pub events: Rgb,
    /// The share that has met none falls so fast with the fibres passed,
    pub untouched: Rgb,
    /// Squares of the fibre's widths.
    pub beta_r_squared: f32,
    /// As above.
    pub beta_tt_squared: f32,
    /// The width of one event of TT.
    pub tt: TtWidth,
    /// What light meets after a fibre.
    pub after: AfterFiber,
    /// How much longer the way of the light is than measured between cores.
    pub lead: f32,
    /// Of light that wanders about: its mean way, in core radii, and how fast what is lost makes it fade with the distance, per core radius;
    /// means of the channels.
    pub mean_way: f32,
    /// As above.
    pub fading: f32,
}

/// The least extinction per fibre. Where TT loses nothing at all a chain ends nowhere; which place is then drawn for an end
/// that has no weight must still be defined.
pub(crate) const LEAST_RATE: f64 = 1e-6;

impl PlyOptics {
    /// For a ply among `plies` of a yarn whose section is pressed to axes of `stretch` : 1, with transport that is solved already.
    pub(crate) fn new(
        material: &FiberMaterial,
        ply: &PlyShape,
        plies: usize,
        stretch: f64,
        solutions: &Solutions,
    ) -> Self {
        let n = f64::from(ply.fibers);
        let (fiber, core) = (f64::from(ply.fiber_radius), f64::from(ply.core_radius));
        let density = ply.density();
        let sigma = 2.0 * fiber * n / (PI * core * core);
        let f = material.chain_share();
        let per_channel = |value: &dyn Fn(usize) -> f64| Rgb::from([value(0), value(1), value(2)]);

        let r = |c: usize| material.r[c];
        let d = |c: usize| material.d[c];
        let tt_out = |c: usize| material.tt[c] * (1.0 - f);
        let chain = |c: usize| material.tt[c] * f;
        let ended = |c: usize| 1.0 - chain(c);
        let dead_zone = ply.mean_dead_zone();
        let rho = |c: usize| extinction_rate(ended(c), dead_zone);
        // Light that leaves the chain, over what the chain loses; 0 where nothing is lost.
        let single = |part: f64, c: usize| if ended(c) > 0.0 { (part / ended(c)).min(1.0) } else { 0.0 };
        let albedo = |c: usize| single(r(c) + d(c) + tt_out(c), c);
        // Light that is scattered on starts at fibres, on no line that was drawn: its extinction is the mean medium's.
        let extinction = |c: usize| sigma * extinction_rate(ended(c), density);
        let radius_optical = |c: usize| extinction(c) * core;
        let own_escape = |c: usize| calibrated::ESCAPE_OF_FIBER * extinction(c) * fiber;
        let escape = |c: usize| escape::past_itself(escape_probability_of_disc(radius_optical(c)), own_escape(c));
        let neighbours = ((plies - 1) as f64 * VIEW_OF_TOUCHING_PLY).min(1.0);
        let taken_back = |c: usize| neighbours * (escape(c) * radius_optical(c) * PI / 2.0).min(1.0);
        let escape_yarn = |c: usize| escape(c) * (1.0 - taken_back(c));
        let closure = |escape: f64, c: usize| {
            let gain = albedo(c) * escape;
            // 1 - c' (1 - E), with 1 - c' from the absorbed light itself.
            let absorbed = single((1.0 - r(c) - d(c) - material.tt[c]).max(0.0), c);
            if gain > 0.0 { (gain / (absorbed + gain)).min(1.0) } else { 0.0 }
        };
        // Chains are bent: a chain that keeps the share a of TT at each fibre gets as far as a straight one that keeps a g, with g the
        // mean cosine by which TT of a chain turns. Where it turns and goes on nothing is lost.
        let straight = if f > 1e-9 { ((-0.5 * material.beta_n.powi(2)).exp() / f).min(1.0) } else { 1.0 };
        let media = [0, 1, 2].map(|c| {
            let loss = 1.0 - straight * chain(c);
            let (rate, bent_rate) = (extinction_rate(ended(c), density), extinction_rate(loss, density));
            let absorbed = if bent_rate > 0.0 { (1.0 - albedo(c)) * rate / bent_rate } else { 1.0 - albedo(c) };
            Medium {
                radius: sigma * bent_rate * core,
                // The mean way to the next fibre is one, between the ends of chains 1 / loss.
                apart: if loss > 1e-9 { (bent_rate / loss - 1.0).max(0.0) } else { 0.0 },
                albedo: (1.0 - absorbed).clamp(0.0, 1.0),
                first: albedo(c),
                sent_back: calibrated::NEIGHBOURS_AT_ONCE * taken_back(c),
                taken_back: taken_back(c),
            }
        });
        // Of what a fibre sends out of a chain: the share that it reflects, and of a ply's events: those that another follows.
        let reflected = |c: usize| {
            let out = r(c) + d(c) + tt_out(c);
            if out > 0.0 { r(c) / out } else { 0.0 }
        };
        let again = |c: usize| albedo(c) * (1.0 - escape_yarn(c));
        let mirrored = |c: usize| {
            let share = reflected(c);
            share * share * (1.0 - again(c)) / (1.0 - again(c) * share).max(1e-12)
        };
        let gaps = PlyGaps::new(dead_zone as f32);
        // So that chains end at their first fibre as often as each hit ends one, and meet TT so often on the mean.
        let hit = |c: usize| if ended(c) > 1e-9 { rho(c) / ended(c) } else { 1.0 };
        let events = |c: usize| chain(c) * hit(c);
        let untouched = |c: usize| (f64::from(gaps.rate) - rho(c)).max(0.0);
        // Of a flight that ends within the ply or leaves it, the mean length is what it meets: each of these passes TT so
        // often, and there are three flights and more.
        let mirrored_variance = |c: usize| {
            let again = again(c) * reflected(c);
            let more = again / (1.0 - again).max(1e-12);
            let flight = events(c) / rho(c).max(LEAST_RATE) * (1.0 - escape(c));
            (2.0 + more) * material.beta_r.powi(2) + (3.0 + more) * flight * material.beta_tt.powi(2)
        };
        let mirrored_kappa = kappa_of_variance(per_channel(&mirrored_variance));
        let (beta_tt_squared, beta_n) = ((material.beta_tt * material.beta_tt) as f32, material.beta_n as f32);
        // The length of diffusion, by which light fades, is the mean way over the root of 3 (1 - albedo).
        let fading = per_channel(&|c| radius_optical(c) * (3.0 * (1.0 - albedo(c))).max(0.0).sqrt());
        let radius_optical = per_channel(&radius_optical);
        Self {
            gaps,
            chain_share: f as f32,
            rho: per_channel(&|c| rho(c).max(LEAST_RATE)),
            chain: per_channel(&chain),
            single_r: per_channel(&|c| single(r(c), c)),
            single_d: per_channel(&|c| single(d(c), c)),
            single_tt: per_channel(&|c| single(tt_out(c), c)),
            albedo: per_channel(&albedo),
            leaves_yarn: per_channel(&|c| closure(escape_yarn(c), c)),
            leaving: Arc::new(Leaving::new(&media, stretch, solutions)),
            mirrored: per_channel(&mirrored),
            mirrored_kappa,
            mirrored_factor: normalisation(mirrored_kappa),
            sharp: material.beta_r.powi(2) < SHARP * material.beta_tt.powi(2),
            events: per_channel(&events),
            untouched: per_channel(&untouched),
            beta_r_squared: (material.beta_r * material.beta_r) as f32,
            beta_tt_squared,
            tt: TtWidth::new(beta_tt_squared, beta_n),
            after: ply.after.unwrap_or(AfterFiber::free(gaps.dead_zone)),
            lead: (FRAC_PI_4 * fiber) as f32,
            mean_way: radius_optical.mean().recip().min(10.0),
            fading: fading.mean(),
        }
    }
}

impl PlyOptics {
    /// Of light that `before` fibres passed on before its node, and so many expected ones may after it: the share that none does, if R tells
    /// it from the rest, and how many TT events the rest has on the mean.
    #[inline]
    pub(crate) fn touched(&self, before: f32, after: Rgb) -> (Rgb, Rgb) {
        let events = self.events * after + Rgb::splat(before);
        if !self.sharp {
            return (Rgb::ZERO, events);
        }
        if before > 0.0 {
            return (Rgb::ZERO, events.max(Rgb::ONE));
        }
        let untouched = (-(self.untouched * after)).exp();
        (untouched, (events / (Rgb::ONE - untouched).max(Rgb::splat(1e-6))).max(Rgb::ONE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extinction_rate_solves_its_equation_and_meets_its_limits() {
        for density in [1e-6, 1e-3, 0.1, 0.5, 0.85] {
            let b = density / (1.0 - density);
            for i in 0..400 {
                let loss = 10f64.powf(-12.0 + 12.0 * f64::from(i) / 400.0);
                let rate = extinction_rate(loss, density);
                assert!(rate > 0.0 && rate.is_finite());
                if b > 1e-4 {
                    // W e^W = a b e^b with W = b - rate eta, in logarithms.
                    let x = rate * density;
                    let residual = (-x / b).ln_1p() - x - (-loss).ln_1p();
                    assert!((residual / (-loss).ln_1p()).abs() < 1e-9, "density {density} loss {loss}: {residual}");
                }
            }
            assert_eq!(extinction_rate(0.0, density), 0.0);
            let opaque = extinction_rate(1.0, density);
            assert!((opaque * (1.0 - density) - 1.0).abs() < 1e-3);
            let (below, above) = (extinction_rate(0.5 - 1e-12, density), extinction_rate(0.5 + 1e-12, density));
            assert!((below / above - 1.0).abs() < 1e-9, "both branches meet at density {density}");
        }
        assert!((extinction_rate(0.3, 1e-7) - 0.3).abs() < 1e-6);
    }

    /// What loses all at each fibre falls as what meets none.
    #[test]
    fn the_rate_of_unscattered_light_is_that_of_chains_that_keep_nothing() {
        for density in [1e-3, 0.1, 0.5, 0.8] {
            let ply = &crate::geometry::yarn::tests::touching_yarn(1, 50, density, 0.0, 0.0).plies[0];
            let rate = f64::from(PlyGaps::new(ply.density() as f32).rate);
            assert!((rate / extinction_rate(1.0, ply.density()) - 1.0).abs() < 1e-6, "density {density}: {rate}");
        }
    }
}
