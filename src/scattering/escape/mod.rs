//! What leaves a ply of light that is scattered evenly around in it, by where it is and where to: transport in its section,
//! solved when a model is made ready (docs/model.md, section 7).

use std::{
    collections::HashMap,
    f32::consts::{FRAC_PI_2, TAU},
    hash::Hash,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use glam::Vec2;
use rayon::prelude::*;

use crate::math::{Rgb, frame::sin_cos, sampler::Stream};

mod bent;
mod flight;
mod linear;
mod pressed;
mod round;

use bent::Flights;

/// Rings of equal area into which the section is cut.
pub(crate) const RINGS: usize = 16;
/// Azimuths for which what leaves is held; between them it goes straight.
pub(crate) const AZIMUTHS: usize = 24;
/// The thickest section that so few rings tell, in mean free paths of its radius: of thicker ones the outer part is as thick.
const THICKEST: f64 = 24.0;

/// Media are told apart whose lengths, or losses, differ by more than one part in so many.
const TOLD_APART: f64 = 200.0;

/// Long over short axis of a section that is as good as round.
const NEARLY_ROUND: f64 = 1.01;

/// What sends light on takes part in its own escape: a chance to escape with so much of it, in mean free paths, `own`.
pub(crate) fn past_itself(escape: f64, own: f64) -> f64 {
    escape * (1.0 + own) / (1.0 + own * escape)
}

/// A ply's section as one channel of light sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Medium {
    /// The radius in mean free paths: of the circle of the section's area.
    pub(crate) radius: f64,
    /// Of what is met.
    pub(crate) spacing: Spacing,
    /// What a meeting keeps.
    pub(crate) albedo: f64,
    /// How TT bends light, if there is any: with it a meeting sends light all round only on the mean.
    pub(crate) bends: Option<Bends>,
    /// Whether no other ply lies around.
    pub(crate) alone: bool,
    /// The share of what leaves that other plies send back at once; where the rest of them takes it is followed by direction.
    pub(crate) sent_back: f64,
    /// Of light that comes from other plies: the share of what leaves that returns to them.
    pub(crate) taken_back: f64,
}

/// How fibres keep others away. Places are those where light meets a fibre, on the side from where it came, and where it leaves again.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spacing {
    /// From there to abreast of the fibre's middle, mean free paths: by so much ways out are shorter than to the rim, up to which middles lie.
    pub(crate) lead: f64,
    /// By how much fewer others are met after a fibre than at random, those in `lead` not counted, once the way is long.
    pub(crate) apart: f64,
}

impl Spacing {
    fn map(self, of: impl Fn(f64) -> f64) -> Self {
        Self { lead: of(self.lead), apart: of(self.apart) }
    }

    fn bits(self) -> [u64; 2] {
        [self.lead, self.apart].map(f64::to_bits)
    }
}

/// The same section by each fibre that light meets, which passes it on as TT or sends it all round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bends {
    /// The radius in mean free paths.
    pub(crate) radius: f64,
    /// Of fibres.
    pub(crate) spacing: Spacing,
    /// What goes on as TT.
    pub(crate) chain: f64,
    /// What goes all round.
    pub(crate) other: f64,
    /// The deviation of the angle by which TT turns light, radians.
    pub(crate) sigma: f64,
    /// The share of TT that this is; the rest turns evenly and counts as sent all round.
    pub(crate) share: f64,
}

impl Medium {
    /// The next one of those that are told apart: colours that nobody does are solved once. What is not absorbed stays so.
    fn rounded(&self) -> Self {
        let near = |x: f64| if x > 0.0 { ((x.ln() * TOLD_APART).round() / TOLD_APART).exp() } else { 0.0 };
        let Self { radius, spacing, albedo, bends, alone, sent_back, taken_back } = *self;
        let bends = bends.map(|Bends { radius, spacing, chain, other, sigma, share }| {
            let rest = 1.0 - near(1.0 - chain - other);
            let chain = near(chain).min(rest);
            Bends { radius: near(radius), spacing: spacing.map(near), chain, other: rest - chain, sigma, share }
        });
        Self {
            bends,
            alone,
            radius: near(radius),
            spacing: spacing.map(near),
            albedo: 1.0 - near(1.0 - albedo).min(1.0),
            sent_back: near(sent_back).min(1.0),
            taken_back: near(taken_back).min(1.0),
        }
    }
}

/// Light that leaves at last.
#[derive(Clone, Copy, Debug)]
struct Outgoing {
    /// The share that does.
    share: f64,
    /// Towards each azimuth, over what would go there if it left evenly.
    azimuths: [f64; AZIMUTHS],
}

impl Outgoing {
    /// The share that leaves, and how it does, but for a factor.
    fn new(share: f64, leaving: [f64; AZIMUTHS]) -> Self {
        debug_assert!(share.is_finite() && leaving.iter().all(|part| part.is_finite()), "{share} {leaving:?}");
        let leaving = leaving.map(|part| part.max(0.0));
        let sum: f64 = leaving.iter().sum();
        let azimuths = if sum > 0.0 { leaving.map(|part| part / sum * AZIMUTHS as f64) } else { [1.0; AZIMUTHS] };
        Self { share: share.clamp(0.0, 1.0), azimuths }
    }

    /// Part of the way to another, or beyond.
    fn towards(&self, other: &Self, part: f64) -> Self {
        let between = |a: f64, b: f64| a + (b - a) * part;
        let azimuths = |k| between(self.share * self.azimuths[k], other.share * other.azimuths[k]);
        Self::new(between(self.share, other.share), std::array::from_fn(azimuths))
    }
}

/// For each sector of a quarter, from the short axis to the long one, and each ring: what leaves of light that is scattered there.
/// One sector in a circle, where azimuths count from that of the place.
struct Solved {
    /// Of [`Light::Onward`].
    onward: Vec<[Outgoing; RINGS]>,
    /// Of [`Light::Met`], and the share of [`Light::MetForGood`]: nothing of plies that are alone.
    met: Vec<[Outgoing; RINGS]>,
    for_good: Vec<[f64; RINGS]>,
    /// Of light that meets something where what leaves would come from: the share that leaves for good.
    entering: f64,
}

/// Light of cells leaves towards azimuths that were found with directions.
fn turn(cells: &mut [[Outgoing; RINGS]], azimuths: &[[f64; AZIMUTHS]]) {
    for (cell, azimuths) in cells.iter_mut().flatten().zip(azimuths) {
        cell.azimuths = *azimuths;
    }
}

/// What leaves a ply of one channel, as [`Leaving`] holds it.
#[derive(Debug)]
struct OfChannel {
    held: Vec<Outgoing>,
    for_good: Vec<f64>,
    entering: f64,
}

/// What one thread makes for all that ask for it. Who asks meanwhile waits, so that what is made must not itself ask the pool of threads.
#[derive(Debug)]
struct Made<K, V>(Mutex<HashMap<K, Pending<V>>>);

type Pending<V> = Arc<OnceLock<Arc<V>>>;

impl<K, V> Default for Made<K, V> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<K: Eq + Hash, V> Made<K, V> {
    fn get(&self, key: K, make: impl FnOnce() -> V) -> Arc<V> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let cell = Arc::clone(all.entry(key).or_default());
        drop(all);
        Arc::clone(cell.get_or_init(|| Arc::new(make())))
    }
}

/// The bits of a [`Medium`] and a section's stretch.
type ChannelKey = ([u64; 6], [u64; 2], Option<([u64; 5], [u64; 2])>);

/// Transport that is solved already: plies of a yarn, its channels and its variants are often alike.
#[derive(Debug, Default)]
pub struct Solutions {
    channels: Made<ChannelKey, OfChannel>,
    /// They are the same for all colours.
    flights: Made<([u64; 2], [u64; 2]), Flights>,
}

impl Solutions {
    fn of(&self, medium: &Medium, stretch: f64) -> Arc<OfChannel> {
        let medium = medium.rounded();
        let Medium { radius, spacing, albedo, bends, alone, sent_back, taken_back } = medium;
        let bent = bends.map(|Bends { radius, spacing, chain, other, sigma, share }| {
            ([radius, chain, other, sigma, share].map(f64::to_bits), spacing.bits())
        });
        let own = [radius, albedo, f64::from(u8::from(alone)), sent_back, taken_back, stretch].map(f64::to_bits);
        self.channels.get((own, spacing.bits(), bent), || Leaving::of_channel(&medium, stretch, self))
    }

    fn flights(&self, bends: &Bends, stretch: f64) -> Arc<Flights> {
        let Bends { radius, spacing, .. } = *bends;
        let key = ([radius, stretch].map(f64::to_bits), spacing.bits());
        self.flights.get(key, || Flights::new(radius, spacing, stretch))
    }
}

/// What leaves a ply at last, per channel.
#[derive(Clone, Debug)]
pub(crate) struct Leaving {
    /// How many sectors there are in a quarter, with both axes.
    sectors: usize,
    /// How many cells: sector by sector, ring by ring of equal area from the axis on, and at the rim.
    cells: usize,
    /// Of each [`Light`] for itself, in their order: the share of all cells.
    shares: Vec<Rgb>,
    /// And where to it leaves, but for light that leaves for good.
    azimuths: Vec<[Rgb; AZIMUTHS]>,
    /// Of light that meets something anywhere by the rim, the share that leaves for good.
    pub(crate) entering: Rgb,
}

/// Light of a place in a ply of which a share leaves at last.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Light {
    /// It comes from there and meets something next.
    Onward,
    /// It meets something there: what leaves the ply then, wherever it goes. Only of yarns of several plies.
    Met,
    /// The same: what leaves all plies of the yarn.
    MetForGood,
}

impl Leaving {
    /// For each channel, in a section of long over short axis `stretch`.
    pub(crate) fn new(channels: &[Medium; 3], stretch: f64, solutions: &Solutions) -> Self {
        let tables: Vec<Arc<OfChannel>> = channels.par_iter().map(|medium| solutions.of(medium, stretch)).collect();
        let rgb = |value: &dyn Fn(&OfChannel) -> f64| Rgb::from([0, 1, 2].map(|c: usize| value(&tables[c])));
        let held = tables[0].held.len();
        let cells = if channels[0].alone { held } else { held / 2 };
        let shares = (0..held).map(|i| rgb(&|of| of.held[i].share));
        let azimuths = |i: usize| std::array::from_fn(|k| rgb(&|of| of.held[i].azimuths[k]));
        Self {
            sectors: if stretch > NEARLY_ROUND { flight::QUARTER } else { 1 },
            cells,
            shares: shares.chain((0..held - cells).map(|i| rgb(&|of| of.for_good[i]))).collect(),
            azimuths: (0..held).map(azimuths).collect(),
            entering: rgb(&|of| of.entering),
        }
    }

    fn of_channel(medium: &Medium, stretch: f64, solutions: &Solutions) -> OfChannel {
        // Of thicker sections the outer part is as deep below the rim as in the one that is looked at.
        let thicker = (medium.radius / THICKEST).max(1.0);
        let bends = medium.bends.map(|bends| Bends { radius: bends.radius / thicker, ..bends });
        let looked_at = Medium { radius: medium.radius.min(THICKEST), bends, ..*medium };
        let solved = if stretch > NEARLY_ROUND {
            pressed::solve(&looked_at, stretch, solutions)
        } else {
            round::solve(&looked_at, solutions)
        };
        let with_rim = |rings: &[Outgoing; RINGS]| {
            let rim = rings[RINGS - 1].towards(&rings[RINGS - 2], -0.5);
            let at = |ring: usize| *rings.get(ring).unwrap_or(&rim);
            let at_ring = |i: usize| {
                let r = ((i as f64 + 0.5) / RINGS as f64).min(1.0).sqrt();
                let (ring, part) = between((1.0 - (1.0 - r) * thicker).max(0.0).powi(2) as f32);
                if thicker > 1.0 { at(ring).towards(&at(ring + 1), f64::from(part)) } else { at(i) }
            };
            (0..=RINGS).map(at_ring).collect::<Vec<_>>()
        };
        let Solved { onward, met, for_good, entering } = solved;
        let for_good = for_good.iter().map(|rings| rings.map(|share| Outgoing::new(share, [1.0; AZIMUTHS])));
        OfChannel {
            held: onward.iter().chain(&met).flat_map(with_rim).collect(),
            for_good: for_good.flat_map(|rings| with_rim(&rings)).map(|out| out.share).collect(),
            entering: entering.clamp(0.0, 1.0),
        }
    }

    /// The share of a place's light that leaves at last.
    #[inline]
    pub(crate) fn share(&self, light: Light, place: &Place) -> Rgb {
        let first = light as usize * self.cells;
        let mix = |sector: usize| {
            let from = first + sector * (RINGS + 1) + place.ring;
            let [low, high] = [self.shares[from], self.shares[from + 1]];
            low + (high - low) * place.beyond
        };
        let from = mix(place.sector);
        if self.sectors == 1 { from } else { from + (mix(place.sector + 1) - from) * place.turned }
    }

    /// Where to it leaves from there: one of the places around it, as likely as it is near.
    #[inline]
    pub(crate) fn draw(&self, light: Light, place: &Place, stream: &mut Stream) -> Outwards {
        let ring = place.ring + usize::from(stream.next() < place.beyond);
        let sector = place.sector + usize::from(self.sectors > 1 && stream.next() < place.turned);
        let first = if matches!(light, Light::Onward) { 0 } else { self.cells };
        Outwards(first + sector * (RINGS + 1) + ring)
    }

    /// What leaves towards an azimuth, given by its cosine and sine, over what would go there if it left evenly.
    #[inline]
    pub(crate) fn towards(&self, outwards: Outwards, azimuth: Vec2) -> Rgb {
        let at = azimuth.y.atan2(azimuth.x) * (AZIMUTHS as f32 / TAU) + AZIMUTHS as f32;
        let k = at as usize;
        let part = at - k as f32;
        let row = &self.azimuths[outwards.0];
        let [low, high] = [row[k % AZIMUTHS], row[(k + 1) % AZIMUTHS]];
        low + (high - low) * part
    }

    /// Draws an azimuth, as cosine and sine: with what `of` makes of the channels, over an even one.
    #[inline]
    pub(crate) fn azimuth(&self, outwards: Outwards, of: impl Fn(Rgb) -> f32, stream: &mut Stream) -> Vec2 {
        let mut left = stream.next() * AZIMUTHS as f32;
        let mut chosen = 0;
        for (k, value) in self.azimuths[outwards.0].iter().enumerate() {
            let value = of(*value);
            if value > 0.0 {
                chosen = k;
                if left < value {
                    break;
                }
            }
            left -= value;
        }
        // What goes straight between values is a sum of triangles.
        let (s, c) = sin_cos(TAU / AZIMUTHS as f32 * (chosen as f32 + stream.next() + stream.next() - 1.0));
        Vec2::new(c, s)
    }
}

/// Which of a [`Leaving`]'s distributions light leaves by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outwards(usize);

/// A place in a ply's section, among those of a [`Leaving`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    ring: usize,
    beyond: f32,
    sector: usize,
    turned: f32,
}

impl Leaving {
    /// The place at `at`, in radii of the circle that the section becomes when its axes are made equal, and the axes against which azimuths
    /// count from there. `short` is the unit vector along its short axis.
    #[inline]
    pub(crate) fn place(&self, at: Vec2, short: Vec2) -> (Place, [Vec2; 2]) {
        let (ring, beyond) = between(at.length_squared());
        if self.sectors == 1 {
            let x = at.normalize_or(Vec2::X);
            return (Place { ring, beyond, sector: 0, turned: 0.0 }, [x, x.perp()]);
        }
        let (turned, axes) = quarter(at, short);
        let turned = turned * (self.sectors - 1) as f32;
        let sector = (turned as usize).min(self.sectors - 2);
        (Place { ring, beyond, sector, turned: turned - sector as f32 }, axes)
    }
}

/// How far a vector is from the short axis to the long one, as a share of that quarter, and the axes of the quarter it lies in.
#[inline]
fn quarter(at: Vec2, short: Vec2) -> (f32, [Vec2; 2]) {
    let long = short.perp();
    let (x, y) = (at.dot(short), at.dot(long));
    let turned = (y.abs().atan2(x.abs()) / FRAC_PI_2).min(1.0);
    (turned, [short * 1f32.copysign(x), long * 1f32.copysign(y)])
}

/// Where a square distance from the axis is between two rings, and how far.
#[inline]
fn between(r2: f32) -> (usize, f32) {
    let at = (r2 * RINGS as f32 - 0.5).clamp(0.0, RINGS as f32 - 0.5);
    let ring = (at as usize).min(RINGS - 1);
    // From the last ring to the rim it is half as far as from ring to ring.
    (ring, (at - ring as f32) * if ring + 1 == RINGS { 2.0 } else { 1.0 })
}

#[cfg(test)]
mod tests;
