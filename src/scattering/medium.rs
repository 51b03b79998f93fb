//! A ply as a medium of fibres: what its material and its packing give before any ray is known, in `f64`.

use std::{
    f64::consts::{FRAC_1_PI, FRAC_PI_4, PI},
    sync::Arc,
};

use super::{
    escape::{self, Bends, Leaving, Medium, Solutions, Spacing},
    fiber::FiberMaterial,
    kernel::{DIFFUSE, Latitudes, kappa_of_spread, kappa_of_variance, kernel, normalisation, spread},
};
use crate::{
    geometry::{after_fiber::AfterFiber, gaps::PlyGaps, ply::PlyShape},
    math::{Rgb, special::escape_probability_of_disc},
};

/// Constants of the aggregated model that were calibrated: on explicit fibres (untwisted single plies only), or on walks from fibre to fibre in a
/// circle.
mod calibrated {
    /// Weight of a fibre's own width in the escape of multiply scattered light.
    pub(super) const ESCAPE_OF_FIBER: f64 = 0.7;
    /// The power of TT's mean cosine that is taken to go straight on; on walks.
    pub(super) const STRAIGHT: f64 = 1.6;
    /// How fast, with the mean way in core radii, the last fibres that B leaves from draw nearer to the axis than the outline; on walks.
    pub(super) const LAST_PLACE: f32 = -4.6;
    /// By how much more than one event does light turns that fibres send all round about themselves; on walks.
    pub(super) const SWIRL: f32 = 1.35;
    /// How much of the neighbours' view counts already when light leaves its own ply; the rest is followed by direction.
    pub(super) const NEIGHBOURS_AT_ONCE: f64 = 0.25;
}

/// Share of the surroundings of a ply that the others of a ring of so many equal plies take, which touch.
///
/// By crossed strings the ring sends to the outside what its convex hull is of all outlines: a circle's and a string of two radii for each ply.
pub(crate) fn view_of_others(plies: usize) -> f64 {
    if plies < 2 { 0.0 } else { 1.0 - FRAC_1_PI - (plies as f64).recip() }
}

/// Below this ratio of their variances R is much narrower than TT.
const SHARP: f64 = 0.3;

/// The effective extinction, per expected fibre, of a chain of light that keeps the weight `1 - loss` at each fibre,
/// when a dead zone, as a share of the way, keeps fibres apart: the area fraction of hard cores, or what was measured in its place.
///
/// rate = (b - W0(a b e^b)) / d with b = d / (1 - d): 1 - a for sparse fibres, 1 / (1 - d) for a = 0.
pub(crate) fn extinction_rate(loss: f64, dead_zone: f64) -> f64 {
    let b = dead_zone / (1.0 - dead_zone);
    if b < 1e-4 {
        return loss;
    }
    if loss >= 1.0 {
        return 1.0 / (1.0 - dead_zone);
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
        x / dead_zone
    } else {
        // Halley-free iteration for Lambert's W of e^l, which never forms e^l for large l.
        let l = (1.0 - loss).ln() + b.ln() + b;
        let mut w = if l < 1.0 { l.exp() / (1.0 + l.exp()) } else { l - l.ln() * l / (1.0 + l) };
        for _ in 0..6 {
            w *= (1.0 + l - w.ln()) / (1.0 + w);
        }
        (b - w) / dead_zone
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
    /// The mean cosine of the angle by which TT of a chain turns; 1 without TT.
    pub cosine: f32,
}

impl TtWidth {
    /// That of a material.
    fn new(material: &FiberMaterial) -> Self {
        let kappa = kappa_of_variance(Rgb::splat(material.beta_tt.powi(2) as f32));
        let [factor, ..] = normalisation(kappa).to_array();
        let bends = material.tt.iter().any(|tt| *tt > 0.0);
        let cosine = if bends { material.chain_cosine() as f32 } else { 1.0 };
        Self { kappa: kappa.to_array()[0], factor, sigma: material.beta_n as f32, cosine }
    }
}

/// A longitudinal lobe of light that was scattered more often.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MirroredLobe {
    /// How much of that light it has.
    pub share: Rgb,
    /// Its [`spread`].
    pub spread: Rgb,
}

impl MirroredLobe {
    /// Inverse width, of [`super::kernel`], where it is spread by so much more.
    pub(super) fn kappa(&self, more: f32) -> Rgb {
        kappa_of_spread(self.spread + Rgb::splat(more))
    }
}

/// A ply's fibres as light sees them. Lengths in yarn radii; albedos per channel.
#[derive(Clone, Debug)]
pub(crate) struct PlyOptics {
    /// What passes between them.
    pub gaps: PlyGaps,
    /// Share of TT that goes on forward in a chain.
    pub chain_share: f32,
    /// Extinction per expected fibre of light that may pass fibres as TT and then goes on as straight as TT leaves it; at least
    /// [`LEAST_RATE`].
    pub rho: Rgb,
    /// Area fraction of the fibres in the ply.
    pub density: f32,
    /// Weight that TT keeps on its way forward, at each fibre.
    pub chain: Rgb,
    /// What goes straight on of it at each fibre on a way out.
    pub straight: Rgb,
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
    /// How much the fibres at the wall of the core lean against the ply's axis: the tangent of that angle. 0 where no light keeps its latitude.
    pub slope: f32,
    /// Of [`Self::swirl`].
    turns: f32,
    /// What leaves this ply at last of light that meets another fibre after one at a place in it, and what leaves the yarn at last
    /// of light that meets a fibre of this ply on its way from another one.
    pub leaving: Arc<Leaving>,
    /// Of that light: what only R and TT sent on keeps a longitudinal lobe. That of what met TT, and that of what met none, if it is told apart.
    pub mirrored: [MirroredLobe; 2],
    /// Whether R is so much narrower than TT that what met no TT on its way is told from what did.
    pub sharp: bool,
    /// Of light that goes on in chains: TT events per expected fibre.
    pub events: Rgb,
    /// The share that has met none falls so fast with the fibres passed,
    pub untouched: Rgb,
    /// The [`spread`] of R, of TT, and of TT where it is met once on the mean, as chance has it.
    pub spread_r: f32,
    /// As above.
    pub spread_tt: f32,
    /// As above.
    pub spread_expected_tt: f32,
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
    /// How far it gets along the fibres, for each unit across them between where it begins and where it leaves, and of the tangent of the
    /// latitude in which it leaves.
    pub along: f32,
}

/// Of light that meets a lobe as often as a Poisson process has it, once on the mean: the mean cosine that it keeps, e^-this, is the mean of
/// powers of the lobe's.
fn expected_spread(beta: f64) -> f64 {
    -(-spread(beta)).exp_m1()
}

/// The least extinction per fibre. Where TT loses nothing at all a chain ends nowhere; which place is then drawn for an end
/// that has no weight must still be defined.
pub(crate) const LEAST_RATE: f64 = 1e-6;

/// [`PlyOptics::along`] of light that keeps no latitude from event to event, and of light that keeps it. Walks in a circle that keep it exactly
/// have 1.45 to 2, by albedos up to .9. The first is by pictures of cloth seen in development (docs/model.md, section 7).
const ALONG: [f32; 2] = [0.4, 1.6];

impl PlyOptics {
    /// For a ply of whose view the others of its yarn take the share `others`, where the yarn's section is pressed to axes of `stretch` : 1,
    /// with transport that is solved already.
    pub(crate) fn new(
        material: &FiberMaterial,
        ply: &PlyShape,
        others: f64,
        stretch: f64,
        solutions: &Solutions,
    ) -> Self {
        let fibers = Fibers::new(ply, others);
        let channels = [0, 1, 2].map(|c| Channel::new(material, &fibers, c));
        let rgb = |of: &dyn Fn(&Channel) -> f64| Rgb::from(channels.each_ref().map(of));
        let sharp = material.beta_r.powi(2) < SHARP * material.beta_tt.powi(2);
        let lobes = channels.each_ref().map(|c| c.mirrored_lobes(material, sharp));
        let mirrored = [0, 1].map(|which| {
            let [share, spread] = [0, 1].map(|of| Rgb::from(lobes.map(|lobes| lobes[which][of])));
            MirroredLobe { share, spread }
        });
        let kept = mirrored.iter().map(|lobe| lobe.share.mean()).sum::<f32>().clamp(0.0, 1.0);
        let mean_way = rgb(&|c| c.met_along_radius()).mean().recip().min(10.0);
        let slope = ply.fiber_rate * ply.core_radius * (0.75 + 0.25 * (calibrated::LAST_PLACE * mean_way).exp()).sqrt();
        let slope = if mirrored.iter().any(|lobe| !lobe.share.is_zero()) { slope } else { 0.0 };
        Self {
            gaps: fibers.gaps,
            chain_share: material.chain_share() as f32,
            rho: rgb(&|c| c.rho().max(LEAST_RATE)),
            density: fibers.density as f32,
            chain: rgb(&|c| c.chain),
            straight: rgb(&|c| c.straight),
            single_r: rgb(&|c| c.single(c.r)),
            single_d: rgb(&|c| c.single(c.d)),
            single_tt: rgb(&|c| c.single(c.tt_out)),
            albedo: rgb(&|c| c.albedo()),
            leaves_yarn: rgb(&|c| c.closure(c.escape_yarn())),
            leaving: Arc::new(Leaving::new(
                &channels.each_ref().map(Channel::medium),
                ply.stretch_of_both(stretch),
                solutions,
            )),
            slope,
            turns: calibrated::SWIRL * kept * slope / (1.0 + slope * slope),
            mirrored,
            sharp,
            events: rgb(&|c| c.events()),
            untouched: rgb(&|c| c.untouched()),
            spread_r: spread(material.beta_r) as f32,
            spread_tt: spread(material.beta_tt) as f32,
            spread_expected_tt: expected_spread(material.beta_tt) as f32,
            tt: TtWidth::new(material),
            after: ply.after.unwrap_or(AfterFiber::free(fibers.gaps.dead_zone)),
            lead: fibers.lead() as f32,
            mean_way,
            fading: rgb(&|c| c.fading()).mean(),
            along: ALONG[0] + kept * (ALONG[1] - ALONG[0]),
        }
    }
}

/// A ply's fibres as shapes, which all channels share.
struct Fibers {
    /// Of a fibre and of the core, yarn radii.
    radius: f64,
    core: f64,
    /// Area fraction of the fibres in the ply.
    density: f64,
    /// What fibres a line across the ply meets per length, where the ply is even.
    sigma: f64,
    dead_zone: f64,
    gaps: PlyGaps,
    /// Share of the surroundings that the other plies of the yarn take.
    others: f64,
}

impl Fibers {
    fn new(ply: &PlyShape, others: f64) -> Self {
        let (radius, core) = (f64::from(ply.fiber_radius), f64::from(ply.core_radius));
        let dead_zone = ply.mean_dead_zone();
        Self {
            radius,
            core,
            density: ply.density(),
            sigma: 2.0 * radius * f64::from(ply.fibers) / (PI * core * core),
            dead_zone,
            gaps: PlyGaps::new(dead_zone as f32),
            others,
        }
    }

    /// From where light meets a fibre to abreast of its middle, on the mean, yarn radii.
    fn lead(&self) -> f64 {
        FRAC_PI_4 * self.radius
    }
}

/// What one channel of light meets in a ply.
///
/// TT bends light, and a bent way out is another one. Of what TT passes on, the share by which its mean cosine falls short of 1 is taken to
/// turn all round, as an event of its own, and the rest to go straight on.
struct Channel<'a> {
    fibers: &'a Fibers,
    /// Energies of a fibre's lobes.
    r: f64,
    d: f64,
    tt: f64,
    /// The parts of TT that go on forward in a chain and that leave it.
    chain: f64,
    tt_out: f64,
    /// The part of a chain's light that goes straight on, and the part that turns.
    straight: f64,
    turned: f64,
    /// The deviation of the angle by which TT of a chain turns, radians.
    sigma: f64,
}

impl<'a> Channel<'a> {
    fn new(material: &FiberMaterial, fibers: &'a Fibers, c: usize) -> Self {
        let (tt, f) = (material.tt[c], material.chain_share());
        let chain = tt * f;
        let goes_on = material.chain_cosine().powf(calibrated::STRAIGHT);
        let (straight, turned) = (goes_on * chain, (1.0 - goes_on) * chain);
        Self {
            fibers,
            r: material.r[c],
            d: material.d[c],
            tt,
            chain,
            tt_out: tt * (1.0 - f),
            straight,
            turned,
            sigma: material.beta_n,
        }
    }

    /// What ends a chain at a fibre.
    fn ended(&self) -> f64 {
        1.0 - self.chain
    }

    /// What a fibre takes out of light that goes straight on.
    fn lost(&self) -> f64 {
        1.0 - self.straight
    }

    fn rho(&self) -> f64 {
        extinction_rate(self.lost(), self.fibers.dead_zone)
    }

    /// A part of the light that leaves the chain, over what the chain loses; 0 where nothing is lost.
    fn single(&self, part: f64) -> f64 {
        if self.ended() > 0.0 { (part / self.ended()).min(1.0) } else { 0.0 }
    }

    fn albedo(&self) -> f64 {
        self.single(self.r + self.d + self.tt_out)
    }

    /// What is kept of light that leaves its straight way.
    fn kept(&self) -> f64 {
        if self.lost() > 0.0 { 1.0 - ((1.0 - self.r - self.d - self.tt) / self.lost()).clamp(0.0, 1.0) } else { 0.0 }
    }

    fn extinction(&self) -> f64 {
        self.fibers.sigma * self.rho()
    }

    fn radius_optical(&self) -> f64 {
        self.extinction() * self.fibers.core
    }

    /// The share that leaves the ply.
    fn escape(&self) -> f64 {
        let own = calibrated::ESCAPE_OF_FIBER * self.extinction() * self.fibers.radius;
        escape::past_itself(escape_probability_of_disc(self.radius_optical()), own)
    }

    /// The share of it that the other plies take, and of theirs that returns to them: see [`Medium`].
    fn taken_back(&self) -> f64 {
        self.fibers.others * (self.escape() * self.radius_optical() * PI / 2.0).min(1.0)
    }

    fn escape_yarn(&self) -> f64 {
        self.escape() * (1.0 - self.taken_back())
    }

    /// The share that leaves at last where each event lets so much escape.
    fn closure(&self, escape: f64) -> f64 {
        let (absorbed, gain) = (1.0 - self.kept(), self.kept() * escape);
        if gain > 0.0 { (gain / (absorbed + gain)).min(1.0) } else { 0.0 }
    }

    fn medium(&self) -> Medium {
        let taken_back = self.taken_back();
        Medium {
            radius: self.radius_optical(),
            spacing: self.spacing(self.rho(), self.lost()),
            albedo: self.kept(),
            bends: (self.turned > 0.0).then(|| self.bends()),
            alone: self.fibers.others == 0.0,
            sent_back: calibrated::NEIGHBOURS_AT_ONCE * taken_back,
            taken_back,
        }
    }

    /// Of fibres which take so much out of light, at a rate for each that is expected. The mean way to the next fibre is one, to the next that takes
    /// light out of its way 1 / lost.
    fn spacing(&self, rate: f64, lost: f64) -> Spacing {
        let lead = self.fibers.lead() * self.fibers.sigma * rate;
        let apart = if lost > 1e-9 { rate / lost - 1.0 } else { 0.0 };
        Spacing { lead, apart: (apart - lead).max(0.0) }
    }

    /// Light that ends at each fibre, and goes on from there.
    fn bends(&self) -> Bends {
        let rate = extinction_rate(1.0, self.fibers.dead_zone);
        Bends {
            radius: self.fibers.sigma * rate * self.fibers.core,
            spacing: self.spacing(rate, 1.0),
            chain: self.chain,
            other: self.r + self.d + self.tt_out,
            sigma: self.sigma,
            share: self.chain / self.tt,
        }
    }

    /// Of what is kept of light that leaves its straight way: the share that R and TT send on, in its latitude, and of that the share of R.
    fn mirrored(&self) -> [f64; 2] {
        let keeps_latitude = self.r + self.turned;
        let all = keeps_latitude + self.d + self.tt_out;
        let share = |part: f64, of: f64| if of > 0.0 { part / of } else { 0.0 };
        [share(keeps_latitude, all), share(self.r, keeps_latitude)]
    }

    /// Of what a fibre sends out of a chain: the share that it reflects.
    fn reflected(&self) -> f64 {
        let out = self.r + self.d + self.tt_out;
        if out > 0.0 { self.r / out } else { 0.0 }
    }

    /// Of a ply's events: those that another follows.
    fn again(&self) -> f64 {
        self.kept() * (1.0 - self.escape_yarn())
    }

    /// So that straight ways end at their first fibre as often as each hit ends one, and meet TT so often on the mean.
    fn events(&self) -> f64 {
        let hit = if self.lost() > 1e-9 { self.rho() / self.lost() } else { 1.0 };
        self.straight * hit
    }

    fn untouched(&self) -> f64 {
        (f64::from(self.fibers.gaps.rate) - self.rho()).max(0.0)
    }

    /// The lobes of light that kept its latitude, as share and spread: of what met TT, and, if R is so `sharp` that it is told apart, of what
    /// met none.
    ///
    /// It left its chain by R, and its way once more at least by R or TT. Of a flight that ends within the ply or leaves it, the mean
    /// length is what it meets: each of these passes TT so often, any number of them as in a geometric series, and there are three
    /// flights and more, here as if they were three longer ones.
    fn mirrored_lobes(&self, material: &FiberMaterial, sharp: bool) -> [[f64; 2]; 2] {
        let [mirrored, by_r] = self.mirrored();
        let again = self.again() * mirrored;
        let more = |again: f64| again / (1.0 - again).max(1e-12);
        let passed = self.events() / self.rho().max(LEAST_RATE) * (1.0 - self.escape());
        let none = (1.0 + passed).recip();
        let untouched =
            if sharp { none.powi(3) * by_r * (1.0 - again) / (1.0 - again * by_r * none).max(1e-12) } else { 0.0 };
        let r = spread(material.beta_r);
        let events = 1.0 + more(again);
        let met_tt = ((3.0 + more(again)) * passed + events * (1.0 - by_r)) / (1.0 - untouched).max(1e-12);
        let bent = 3.0 * (met_tt / 3.0 * expected_spread(material.beta_tt)).ln_1p();
        let touched = (1.0 + events * by_r) * r + bent;
        let reflected = |more: f64| (2.0 + more) * r;
        let all = self.reflected() * mirrored * (1.0 - self.again()) / (1.0 - again).max(1e-12);
        [[all * (1.0 - untouched), touched], [all * untouched, reflected(more(again * by_r * none))]]
    }

    /// How many fibres take light out of its way, on the mean, along a line as long as the core's radius.
    fn met_along_radius(&self) -> f64 {
        self.fibers.sigma * self.fibers.core * self.lost()
    }

    /// The length of diffusion, by which light fades, is the mean way over the root of 3 (1 - albedo).
    fn fading(&self) -> f64 {
        self.met_along_radius() * (3.0 * (1.0 - self.kept())).max(0.0).sqrt()
    }
}

impl PlyOptics {
    /// The optical depth of a way on which light that ends at the first fibre meets so many of the ply, and light that passes nearly all so
    /// many on the mean. Chains that keep nothing end at the first one, and those that keep all pass by as many as there are.
    #[inline]
    pub(crate) fn depth(&self, met: f32, counted: f32) -> Rgb {
        let lost = self.rho * self.gaps.rate.recip();
        self.rho * (Rgb::splat(counted) + lost * (met - counted))
    }

    /// The longitudinal lobe of light that was scattered twice or more, where what keeps its latitude has so much more [`spread`].
    #[inline]
    pub(crate) fn latitude_of_multiple(&self, at: Latitudes, spread: f32) -> Rgb {
        let mut latitude = Rgb::splat(DIFFUSE);
        for lobe in self.mirrored.iter().filter(|lobe| lobe.share.max_channel() > 0.0) {
            latitude += lobe.share * (kernel(lobe.kappa(spread), at) - Rgb::splat(DIFFUSE));
        }
        latitude
    }

    /// By how much light turns about the ply's axis before it leaves, radians, which has the part `axial` along the fibres, for each unit of
    /// their own part along the axis.
    ///
    /// A fibre sends it all round about itself, and so more of it to the side to which the fibre leans against the ply, if the light goes up the
    /// fibre. All fibres lean round the axis to one side, and the light keeps its part along all of them.
    #[inline]
    pub(crate) fn swirl(&self, axial: f32) -> f32 {
        let about = axial * axial / (1.0 + self.slope * self.slope);
        self.turns * (axial / (1.0 - about).max(0.01).sqrt()).clamp(-1.0, 1.0)
    }

    /// Of light that `before` fibres passed on before its node, and so many expected ones may after it: the share that none does, if R tells it
    /// from the rest, and by how much the rest is spread. `untouched` is that share where another way was counted for it.
    #[inline]
    pub(crate) fn touched(&self, before: f32, after: Rgb, untouched: Option<Rgb>) -> (Rgb, Rgb) {
        let (known, once) = (before * self.spread_tt, Rgb::splat(self.spread_expected_tt));
        let expected = self.events * after * once;
        if !self.sharp || before > 0.0 {
            return (Rgb::ZERO, expected + known);
        }
        let untouched = untouched.unwrap_or_else(|| (-(self.untouched * after)).exp());
        (untouched, (expected / (Rgb::ONE - untouched).max(Rgb::splat(1e-6))).max(once))
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
