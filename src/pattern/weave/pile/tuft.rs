//! Cut tufts: a yarn opens into the strands that it was twisted of, whose tips share the plane of the cut evenly.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    super::{
        PatternStrand,
        edges::{Point, from_points, points},
    },
    random,
};
use crate::geometry::contact::{PointGrid, Walk};

/// Strands across a tuft's yarn: of seven there are 37.
const ACROSS: u32 = 7;
/// How much thicker strands are at their tips than in the yarn, at most.
const BLOOM: f64 = 3.0;
/// How far a tip is from its place by chance, in distances of tips, and from the cut, in radii of the yarn.
const UNEVEN: f64 = 0.2;
const CUT: f64 = 0.1;
/// How much thinner the yarn is where it is held: other yarns press its strands together.
const PRESSED: f64 = 0.9;
/// Up to this height above their feet strands lie side by side: there is the ground. In radii of the yarn, and of the pile's height at
/// most.
const GROUND: f64 = 1.4;
const MOST_GROUND: f64 = 0.4;
/// How soon they part above it: 1 as straight lines, 2 as a bow that is upright at its tip.
const SOON: f64 = 1.5;
/// How much later they thicken.
const LATER: f64 = 1.6;
/// Thickness of strands in the yarn, in distances of neighbours: they turn a little there.
const LOOSE: f64 = 0.93;
/// Steps along the yarn from one point of a leg's strands to the next: they are nearly straight.
const STRIDE: usize = 2;

/// How a tuft opens.
pub(super) struct Tuft {
    /// Unit vector across the plane in which it is bent.
    pub(super) across: DVec3,
    /// Points of its first leg and of its last.
    pub(super) legs: [usize; 2],
    /// Points of what lies in the ground from one of its strands to the next.
    pub(super) stride: usize,
    /// Radius of the yarn where it carries none of its own.
    pub(super) radius: f64,
    /// Half the room of a leg's tips, across the yarn and along it.
    pub(super) spread: [f64; 2],
    pub(super) cut: Cut,
    pub(super) seed: u32,
}

/// The face of a cut pile: even, or a vault over each wale.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    /// Height of its feet and of its highest tips.
    pub(super) foot: f64,
    pub(super) top: f64,
    pub(super) vault: Option<Vault>,
}

/// A vault along x or y: its middle, half its width, and how much lower its sides are, of the pile's height.
#[derive(Clone, Copy)]
pub(super) struct Vault {
    pub(super) axis: usize,
    pub(super) middle: f64,
    pub(super) half: f64,
    pub(super) lower: f64,
}

impl Cut {
    fn height(&self, at: DVec2) -> f64 {
        let lower = self.vault.map_or(0.0, |vault| {
            let beside = (at[vault.axis] - vault.middle) / vault.half;
            vault.lower * beside.powi(2).min(1.0)
        });
        self.top - lower * (self.top - self.foot)
    }
}

/// One end of a strand, which is still in its yarn.
struct Tip {
    tuft: usize,
    /// Which of its tuft's.
    strand: usize,
    /// Its points from the tip to the ground, the first and by how much the index grows.
    first: usize,
    step: isize,
    /// How far each has parted from the others, 1 at the tip.
    parted: Vec<f64>,
    /// Where it is in its yarn, from the yarn's middle.
    within: DVec2,
    /// Which of its tuft's legs.
    leg: usize,
    /// Where it would stand if it were alone, and how much room it has.
    stood: DVec2,
    room: f64,
    /// Height at which it is cut, by chance.
    cut: Cut,
    chance: f64,
}

/// Opens tufts, each a yarn with points that stand where its strands together have room: the tips of all share it.
pub(super) fn open(tufts: &[(&PatternStrand, &Tuft)]) -> Vec<Vec<PatternStrand>> {
    let opened: Vec<(Vec<PatternStrand>, Vec<Tip>)> =
        tufts.par_iter().map(|(strand, tuft)| tuft.strands(strand)).collect();
    let (mut strands, mut tips) = (Vec::new(), Vec::new());
    for (tuft, (of_one, its_tips)) in opened.into_iter().enumerate() {
        tips.extend(its_tips.into_iter().map(|tip| Tip { tuft, ..tip }));
        strands.push(of_one);
    }
    let (mut places, mut nearest) = share_room(&tips);
    untangle(&tips, &mut places, &mut nearest);
    for ((tip, to), nearest) in tips.iter().zip(places).zip(nearest) {
        let curve = &mut strands[tip.tuft][tip.strand].curve;
        let index = |k: usize| tip.first.wrapping_add_signed(tip.step * k as isize);
        let from = curve.points[tip.first];
        let by = to.extend(tip.cut.height(to) + tip.chance) - from;
        // They lean, and so are nearer to each other than their tips.
        let thick = 0.5 * nearest * lean(&curve.points, &index, by, tip.parted.len());
        if let Some(radii) = &mut curve.radii {
            let thick = thick.clamp(radii[tip.first] * 0.9, radii[tip.first] * BLOOM);
            // Later than they part, so that none lies in another where they turn to their places.
            let mut thicken = |k: usize, parted: f64| radii[index(k)] += (thick - radii[index(k)]) * parted.powf(LATER);
            tip.parted.iter().enumerate().for_each(|(k, parted)| thicken(k, *parted));
        }
        tip.parted.iter().enumerate().for_each(|(k, parted)| curve.points[index(k)] += by * *parted);
    }
    strands
}

/// Cosine of the angle by which a strand leans, once its tip has gone on.
fn lean(points: &[DVec3], index: &impl Fn(usize) -> usize, by: DVec3, count: usize) -> f64 {
    let way = points[index(0)] + by - points[index(count)];
    (way.z.abs() / way.length().max(1e-12)).clamp(0.5, 1.0)
}

impl Tuft {
    /// Its strands, side by side all along, and their tips.
    fn strands(&self, strand: &PatternStrand) -> (Vec<PatternStrand>, Vec<Tip>) {
        let mut way = points(strand);
        let flat = strand.curve.flattening.is_some();
        if strand.curve.radii.is_none() {
            way.iter_mut().for_each(|p| p.1 = self.radius);
        }
        let [first, second] = self.legs;
        let ends = [first, way.len() - 1 - second];
        round_off(&mut way, ends);
        let kept = self.kept(way.len());
        let bundle = bundle();
        let turned = DVec2::from_angle(PI * random(self.seed, 0));
        let room = 4.0 * self.spread[0] * self.spread[1] / bundle.len() as f64;
        let (mut strands, mut tips) = (Vec::new(), Vec::new());
        for (k, at) in bundle.iter().enumerate() {
            let at = turned.rotate(*at);
            let places: Vec<Point> = kept.iter().map(|&i| self.beside(&way, i, at, flat)).collect();
            let mut made = from_points(strand.kind, strand.index, &places, flat);
            made.curve.radii = Some(places.iter().map(|p| p.1).collect());
            made.share = strand.share / bundle.len() as f64;
            strands.push(made);
            tips.extend([0, 1].into_iter().filter(|leg| self.legs[*leg] > 0).map(|leg| {
                let path = way[if leg == 0 { 0 } else { way.len() - 1 }].0.truncate();
                self.tip(k, at, leg, path, (&kept, way.len(), room))
            }));
        }
        (strands, tips)
    }

    /// Which of so many points of the yarn its strands keep: the tips and the middle of the ground among them.
    fn kept(&self, count: usize) -> Vec<usize> {
        let last = count - 1;
        let [first, second] = self.legs;
        let (ground, middle) = (first..=last - second, (first + last - second) / 2);
        let is_kept = |i: &usize| {
            let (of, stride) = match *i {
                i if i < first => (0, STRIDE),
                i if ground.contains(&i) => (middle, self.stride),
                _ => (last, STRIDE),
            };
            i.abs_diff(of).is_multiple_of(stride)
        };
        (0..=last).filter(is_kept).collect()
    }

    /// The point of a strand that is `at` such a place of the yarn's section, beside point `i` of the yarn's way.
    fn beside(&self, way: &[Point], i: usize, at: DVec2, flat: bool) -> Point {
        let (p, radius, axis, coordinates) = way[i];
        let tangent = (way[(i + 1).min(way.len() - 1)].0 - way[i.saturating_sub(1)].0).normalize_or(DVec3::Z);
        let major = (self.across - self.across.dot(tangent) * tangent).normalize_or(self.across);
        let minor = tangent.cross(major);
        // Pressed flat as the yarn is.
        let ratio = if flat { f64::from(axis.length()) } else { 1.0 };
        let off = at.x * major + at.y * ratio * minor;
        let radius = PRESSED * radius;
        (p + off * radius, LOOSE / f64::from(ACROSS) * radius, minor.as_vec3() * ratio as f32, coordinates)
    }

    /// The tip of strand `k` on a leg that ends above `path`, with the points that strands keep of the yarn's `count` and the room
    /// of a tip.
    fn tip(&self, k: usize, at: DVec2, leg: usize, path: DVec2, (kept, count, room): (&[usize], usize, f64)) -> Tip {
        let chance = |what: u32| random(self.seed, 1 + 8 * k as u32 + 4 * leg as u32 + what);
        // Across the yarn and along it, in the plane of the cut. As `minor` is: upwards the yarn goes the other way at its end.
        let across = self.across.truncate();
        let along = if leg == 0 { -across.perp() } else { across.perp() };
        let even = evenly(at);
        let off = across * (even.x * self.spread[0]) + along * (even.y * self.spread[1]);
        let by_chance = DVec2::new(chance(0), chance(1)) * (UNEVEN * room.sqrt());
        let points = self.legs[leg];
        let parted = |i: usize| (i < points).then(|| self.parted(1.0 - i as f64 / points as f64));
        // From the tip on.
        let parted: Vec<f64> = match leg {
            0 => kept.iter().filter_map(|&i| parted(i)).collect(),
            _ => kept.iter().rev().filter_map(|&i| parted(count - 1 - i)).collect(),
        };
        let (first, step) = if leg == 0 { (0, 1) } else { (kept.len() - 1, -1) };
        Tip {
            tuft: 0,
            strand: k,
            within: across * at.x + along * at.y,
            leg,
            first,
            step,
            parted,
            stood: path + off + by_chance,
            room,
            cut: self.cut,
            chance: CUT * self.radius * chance(2),
        }
    }

    /// How far strands have parted at a share of a leg's way from its foot: not at all in the ground, 1 at the tip.
    fn parted(&self, s: f64) -> f64 {
        let height = (self.cut.top - self.cut.foot).abs().max(1e-12);
        let ground = (GROUND * self.radius / height).min(MOST_GROUND);
        let x = ((s - ground) / (1.0 - ground)).max(0.0);
        x * (SOON - (SOON - 1.0) * x)
    }
}

/// Gives the places of each leg to its strands so that no two cross on their way: what is beside what in the yarn is so at the
/// tips.
fn untangle(tips: &[Tip], places: &mut [DVec2], nearest: &mut [f64]) {
    const ROUNDS: usize = 40;
    let mut order: Vec<usize> = (0..tips.len()).collect();
    order.sort_by_key(|&i| (tips[i].tuft, tips[i].leg));
    for leg in order.chunk_by(|&a, &b| (tips[a].tuft, tips[a].leg) == (tips[b].tuft, tips[b].leg)) {
        for _ in 0..ROUNDS {
            let mut changed = false;
            for (k, &i) in leg.iter().enumerate() {
                for &j in &leg[k + 1..] {
                    if (tips[i].within - tips[j].within).dot(places[i] - places[j]) < 0.0 {
                        places.swap(i, j);
                        nearest.swap(i, j);
                        changed = true;
                    }
                }
            }
            if !changed {
                break;
            }
        }
    }
}

/// Takes the edge off a way where legs rise, or strands on the inner side would fold.
fn round_off(way: &mut [Point], corners: [usize; 2]) {
    const ROUNDS: usize = 4;
    const AROUND: usize = 3;
    for _ in 0..ROUNDS {
        for corner in corners {
            let range = corner.saturating_sub(AROUND).max(1)..(corner + AROUND + 1).min(way.len().saturating_sub(1));
            let smooth: Vec<DVec3> =
                range.clone().map(|i| 0.25 * (way[i - 1].0 + way[i + 1].0) + 0.5 * way[i].0).collect();
            range.zip(smooth).for_each(|(i, p)| way[i].0 = p);
        }
    }
}

/// Where the strands of a yarn of radius 1 are in its section: in rings of six, as close as they lie.
fn bundle() -> Vec<DVec2> {
    let rings = ACROSS as i32 / 2;
    let step = 2.0 / f64::from(ACROSS);
    let place =
        |(a, b): (i32, i32)| DVec2::new(f64::from(a) + 0.5 * f64::from(b), 0.75f64.sqrt() * f64::from(b)) * step;
    let all = (-rings..=rings).flat_map(|a| (-rings..=rings).map(move |b| (a, b)));
    all.filter(|(a, b)| (a + b).abs() <= rings).map(place).collect()
}

/// Takes the circle of radius 1 to the square of -1 to 1, areas to equal areas, and keeps what is beside what.
fn evenly(at: DVec2) -> DVec2 {
    let x = at.x.clamp(-1.0, 1.0);
    let chord = (1.0 - x * x).sqrt();
    DVec2::new((x * chord + x.asin()) / FRAC_PI_2, (at.y / chord.max(1e-9)).clamp(-1.0, 1.0))
}

/// Lets tips find their places among those of all others: each has its room of the plane, and pushes those away that are nearer
/// than in the closest packing of such rooms. Tells where they come to rest, and how far the nearest other one is.
fn share_room(tips: &[Tip]) -> (Vec<DVec2>, Vec<f64>) {
    /// In which tips come to rest, and in which neighbours stay the same.
    const ROUNDS: usize = 80;
    const SAME: usize = 8;
    /// How far a tip goes from where it stood, at most, in distances of neighbours.
    const FURTHEST: f64 = 2.5;
    /// They press on each other, or cracks would stay where tufts stood apart.
    const CLOSER: f64 = 1.15;
    /// Farther tips do not become neighbours meanwhile, in distances.
    const NEAR: f64 = 1.5;
    let room = tips.iter().map(|tip| tip.room).fold(0.0, f64::max);
    let distance = CLOSER * (2.0 / 3f64.sqrt() * room).sqrt();
    let mut places: Vec<DVec2> = tips.iter().map(|tip| tip.stood).collect();
    if places.is_empty() || distance <= 0.0 {
        return (places, vec![0.0; tips.len()]);
    }
    let neighbours = |places: &[DVec2]| -> Vec<Vec<u32>> {
        let flat: Vec<DVec3> = places.iter().map(|p| p.extend(0.0)).collect();
        let grid = PointGrid::new(&flat, NEAR * distance, None);
        let of_one = |walk: &mut Walk<'_>, (i, at): (usize, &DVec3)| {
            let mut near = Vec::new();
            walk.within(*at, NEAR * distance, |other| {
                if other.index as usize != i {
                    near.push(other.index);
                }
            });
            near
        };
        flat.par_iter().enumerate().map_init(|| grid.walk(), of_one).collect()
    };
    let mut near = Vec::new();
    for round in 0..ROUNDS {
        if round % SAME == 0 {
            near = neighbours(&places);
        }
        let pushed = |(i, p): (usize, &DVec2)| {
            let push: DVec2 = near[i]
                .iter()
                .map(|&k| {
                    let off = *p - places[k as usize];
                    let apart = off.length();
                    if apart < distance { 0.5 * (distance - apart) * off.normalize_or(DVec2::X) } else { DVec2::ZERO }
                })
                .sum();
            // Half of it: each is pushed by several.
            tips[i].stood + (*p + 0.5 * push - tips[i].stood).clamp_length_max(FURTHEST * distance)
        };
        places = places.par_iter().enumerate().map(pushed).collect();
    }
    let nearest = |(i, near): (usize, &Vec<u32>)| {
        near.iter().map(|&k| places[i].distance(places[k as usize])).fold(distance, f64::min)
    };
    let nearest = neighbours(&places).par_iter().enumerate().map(nearest).collect();
    (places, nearest)
}
