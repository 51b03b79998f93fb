//! Sections of yarns that press on each other.
//!
//! Stitches are relaxed with yarns that keep [`Thickness::pressed`] apart, which is less than a round yarn takes. Where another
//! strand is nearer than that, the section gives way to it: it becomes an ellipse whose short axis points to the nearest strand
//! and ends half way to it. Its area stays if there is room beside; else the ellipse ends where it meets the
//! next strand, and the yarn is denser there. In bends that are tighter than the yarn is thick it gives way to itself.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::Thickness;
use crate::{
    geometry::contact::{Cubes, Entry, PointGrid, Walk, nearest},
    pattern::{PatternStrand, relax::sheared},
};

/// Along a yarn, nearer than this many diameters is not another strand.
const ALONG: f64 = 2.2;
/// Beside the short axis by less than this, as the sine of the angle, a strand does not bound the long axis.
const BESIDE: f64 = 0.15;
/// The share of half the way to another strand that a section takes: not all, for what is between points.
const HALF_WAY: f64 = 0.97;
/// No section is narrower than this along its short axis, of a round one's radius.
const NARROWEST: f64 = 0.5;
/// Sections of a larger ratio of their axes stay round.
const ROUND: f64 = 0.98;
/// The share of a bend's radius that a section takes on the inside.
const INSIDE: f64 = 0.85;
/// Segments longer than the mean one by this are looked for in parts.
const LONGER: f64 = 1.25;
/// Points that one thread takes at once.
const CHUNK: usize = 512;

/// From a point of a strand to the next one.
#[derive(Clone, Copy)]
struct Segment {
    from: DVec3,
    to: DVec3,
    /// Which of all strands, and which of all their segments.
    strand: u32,
    index: u32,
    /// Way along the strand to its start, mm.
    along: f64,
}

impl Segment {
    fn middle(&self) -> DVec3 {
        self.from.midpoint(self.to)
    }
}

/// A section: half of its axes, mm, and the direction of the short one, zero of a round one.
#[derive(Clone, Copy)]
struct Section {
    short: f32,
    long: f32,
    axis: Vec3,
}

impl Section {
    fn round(room: f64) -> Self {
        Self { short: room as f32, long: room as f32, axis: Vec3::ZERO }
    }

    /// How flat it is.
    fn ratio(&self) -> f32 {
        self.short / self.long
    }

    /// That of a yarn whose section has a radius of `room` by itself, along `tangent`, where `ways` lead half way to other strands; it
    /// is no wider than to `far`.
    fn between(tangent: DVec3, ways: &[DVec3], [room, far]: [f64; 2]) -> Self {
        let across = |way: &DVec3| way.reject_from_normalized(tangent).try_normalize();
        let nearest = ways.iter().min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let Some(nearest) = nearest.filter(|way| way.length_squared() < room * room) else { return Self::round(room) };
        let Some(axis) = across(nearest) else { return Self::round(room) };
        let short = (HALF_WAY * nearest.length()).max(NARROWEST * room);
        // An ellipse reaches as far as this along a direction whose angle with the short axis has that sine.
        let most = |way: &DVec3| {
            let cos = across(way)?.dot(axis);
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            (sin > BESIDE).then(|| (way.length_squared() - (short * cos).powi(2)).max(0.0).sqrt() / sin)
        };
        let long = ways.iter().filter_map(most).fold((room * room / short).min(far), f64::min).max(short);
        let axis = if short < ROUND * long { axis } else { DVec3::ZERO };
        Self { short: short as f32, long: long as f32, axis: axis.as_vec3() }
    }
}

/// Points that lie alike, with all that is around them.
pub(in crate::pattern) enum Alike {
    /// Nothing is known to repeat.
    No,
    /// For each point of the strands, one behind the other, what kind it is of; [`ALONE`] if it is by itself.
    Points(Vec<u64>),
    /// The whole repeats, by so much across and up; what is above begins `shear` times its height further along x.
    Tile {
        /// Width and height.
        period: DVec2,
        /// Tangent of the angle by which columns lean.
        shear: f64,
    },
}

/// The index of segments that are images of a tile's.
const IMAGE: u32 = u32::MAX;

/// The kind of a point that is like no other.
pub(super) const ALONE: u64 = u64::MAX;

/// Presses yarns flat where they are nearer to each other than round yarns come: gives their curves radii and short axes.
pub(in crate::pattern) fn flatten_where_touching(strands: &mut [PatternStrand], yarn: &Thickness, alike: &Alike) {
    if yarn.flatten == 1.0 {
        return;
    }
    let lengths = strands.iter().flat_map(|s| s.curve.points.windows(2).map(|w| w[0].distance(w[1])));
    let (mut count, mut sum, mut longest) = (0, 0.0, 0.0);
    lengths.for_each(|length| (count, sum, longest) = (count + 1, sum + length, f64::max(longest, length)));
    let reach = Reach::of(yarn, [LONGER * sum / (count as f64).max(1.0), longest]);
    // Of those that are alike, the first.
    let first_of = firsts(alike, strands, count);
    let asked = |i: u32| first_of.get(i as usize).is_none_or(|first| *first == i);
    let around = Around::new(segments(strands, &asked, reach.middles, first_of.is_empty()), reach, alike);
    let mut sections = vec![Section::round(reach.room); count];
    around.sections(asked).into_iter().for_each(|(i, section)| sections[i as usize] = section);
    for (i, first) in first_of.into_iter().enumerate() {
        sections[i] = sections[first as usize];
    }
    give(strands, &sections, yarn, matches!(alike, Alike::Tile { .. }));
}

/// Gives curves their sections, one at the start of each segment.
fn give(strands: &mut [PatternStrand], mut sections: &[Section], yarn: &Thickness, tile: bool) {
    for strand in strands {
        let points = &strand.curve.points;
        let (own, after) = sections.split_at(points.len().saturating_sub(1));
        sections = after;
        // A row of a tile ends as it begins, another strand as its last segment.
        let last = if tile { own.first() } else { own.last() };
        let own: Vec<Section> = own.iter().chain(last).copied().collect();
        strand.curve.radii = Some(own.iter().map(|s| f64::from(s.long) / yarn.half_width).collect());
        strand.curve.flattening = Some(axes(points, &own, tile));
    }
}

/// How far around a section others count, mm.
#[derive(Clone, Copy)]
struct Reach {
    /// Radius of a round section.
    room: f64,
    /// Half way to what is farther bounds no section.
    far: f64,
    /// Middles of segments that may count are not farther.
    middles: f64,
    /// Segments are looked for in parts that are no longer.
    part: f64,
    /// Of the yarn that is thicker in places, its mean half width over its radius.
    half_width: f64,
}

impl Reach {
    /// Of yarn whose longest segment, and longest part of one, are so long.
    fn of(yarn: &Thickness, [part, longest]: [f64; 2]) -> Self {
        let room = yarn.radius * yarn.half_width;
        let far = room * yarn.flatten.sqrt();
        Self { room, far, middles: 2.0 * far + longest, part, half_width: yarn.half_width }
    }

    /// The parts of a way, each by its middle, and half of their length.
    fn parts(&self, from: DVec3, to: DVec3) -> (impl Iterator<Item = DVec3>, f64) {
        let length = from.distance(to);
        let count = (length / self.part).ceil().max(1.0);
        let middles = (0..count as u32).map(move |k| from.lerp(to, (f64::from(k) + 0.5) / count));
        (middles, 0.5 * length / count)
    }
}

/// Segments, and where to look for those around a place.
struct Around {
    reach: Reach,
    segments: Vec<Segment>,
    /// Of the strands of a tile, what they end with.
    last_of: Vec<Segment>,
    parts: Vec<Part>,
    /// The middles of parts.
    grid: PointGrid,
}

/// A part of a segment.
struct Part {
    segment: u32,
    /// Whether it is the first one.
    first: bool,
    /// Half of its length.
    half: f64,
}

impl Around {
    fn new(mut segments: Vec<Segment>, reach: Reach, alike: &Alike) -> Self {
        let mut last_of = Vec::new();
        if let Alike::Tile { period, shear } = alike {
            last_of = segments.chunk_by(|a, b| a.strand == b.strand).map(|own| own[own.len() - 1]).collect();
            add_images(&mut segments, (*period, *shear), reach.middles);
        }
        let (mut middles, mut parts) = (Vec::with_capacity(segments.len()), Vec::with_capacity(segments.len()));
        for (segment, s) in (0..).zip(&segments) {
            let (own, half) = reach.parts(s.from, s.to);
            for (k, middle) in own.enumerate() {
                middles.push(middle);
                parts.push(Part { segment, first: k == 0, half });
            }
        }
        let grid = PointGrid::new(&middles, 2.0 * reach.far + reach.part, None);
        Self { reach, segments, last_of, parts, grid }
    }

    /// The sections at the starts of segments that are asked for, with the segments' indices.
    fn sections(&self, asked: impl Fn(u32) -> bool + Sync) -> Vec<(u32, Section)> {
        let own = |entry: &Entry| {
            let Part { segment, first, .. } = self.parts[entry.index as usize];
            let index = self.segments[segment as usize].index;
            (first && index != IMAGE && asked(index)).then_some((segment, index))
        };
        let entries = self.grid.in_order().par_iter().with_min_len(CHUNK).filter_map(own);
        entries
            .map_init(
                || (self.grid.walk(), Vec::new()),
                |state, (segment, index)| (index, self.section(segment as usize, state)),
            )
            .collect()
    }

    /// The section at the start of a segment, by the half of it that follows and the half of the one before.
    fn section(&self, i: usize, (walk, ways): &mut (Walk<'_>, Vec<DVec3>)) -> Section {
        let Reach { room, far, part, half_width, .. } = self.reach;
        let (own, before, after) = (&self.segments[i], self.before(i), self.segments[i].middle());
        let along = (after - before).normalize_or_zero();
        ways.clear();
        let mut look = |at: DVec3, half: f64| {
            walk.within(at, 2.0 * far + half + 0.5 * part, |entry| {
                let Part { segment, half: other_half, .. } = self.parts[entry.index as usize];
                let other = &self.segments[segment as usize];
                // However they lie.
                let most = 2.0 * far + half + other_half;
                if entry.at.distance_squared(at) > most * most {
                    return;
                }
                if own.strand == other.strand && (own.along - other.along).abs() < ALONG * 2.0 * room {
                    return;
                }
                let to = |end: DVec3| 0.5 * nearest(own.from, end, other.from, other.to).between;
                // What lies on one side of the section is nearer to the half on that side.
                let ahead = (entry.at - own.from).dot(along);
                let way = if ahead > other_half {
                    to(after)
                } else if ahead < -other_half {
                    to(before)
                } else {
                    let [a, b] = [to(before), to(after)];
                    if b.length_squared() < a.length_squared() { b } else { a }
                };
                if way.length_squared() < far * far {
                    ways.push(way);
                }
            });
        };
        let half = own.from.distance(after).max(own.from.distance(before));
        if half <= 0.5 * part {
            look(own.from, half);
        } else {
            for end in [before, after] {
                let (middles, half) = self.reach.parts(own.from, end);
                middles.for_each(|at| look(at, half));
            }
        }
        if before != own.from {
            ways.extend(inwards(before, own.from, after).map(|way| INSIDE * half_width * way));
        }
        Section::between(along, ways, [room, far])
    }

    /// The middle of what comes before a segment on its strand.
    fn before(&self, i: usize) -> DVec3 {
        let own = &self.segments[i];
        let follows = |i: &usize| self.segments[*i].strand == own.strand && self.segments[*i].index + 1 == own.index;
        match (i.checked_sub(1).filter(follows), self.last_of.get(own.strand as usize)) {
            (Some(i), _) => self.segments[i].middle(),
            // A row of a tile goes on before its first point as it ends.
            (None, Some(last)) => last.middle() + (own.from - last.to),
            (None, None) => own.from,
        }
    }
}

/// The way to the centre of the circle through three points, from the second.
fn inwards(a: DVec3, b: DVec3, c: DVec3) -> Option<DVec3> {
    let (u, v) = (a - b, c - b);
    let normal = u.cross(v);
    let square = normal.length_squared();
    let to_centre = (v * u.length_squared() - u * v.length_squared()).cross(normal) * 0.5;
    (square > 0.0).then(|| to_centre / square)
}

/// For each segment the first one whose start is alike; nothing if none are.
fn firsts(alike: &Alike, strands: &[PatternStrand], count: usize) -> Vec<u32> {
    let Alike::Points(kinds) = alike else { return Vec::new() };
    let mut known = HashMap::new();
    let mut firsts = Vec::with_capacity(count);
    let mut rest = kinds.as_slice();
    for strand in strands {
        let (own, after) = rest.split_at(strand.curve.points.len());
        rest = after;
        for kind in &own[..own.len().saturating_sub(1)] {
            let next = firsts.len() as u32;
            firsts.push(if *kind == ALONE { next } else { *known.entry(*kind).or_insert(next) });
        }
    }
    firsts
}

/// Adds what lies around a tile, as far as it may matter: beside it rows go on, above and below it are other strands.
fn add_images(segments: &mut Vec<Segment>, (period, shear): (DVec2, f64), reach: f64) {
    let (low, high) = segments.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), s| {
        let at = s.middle().truncate();
        (low.min(at), high.max(at))
    });
    let up = (reach / period.y).ceil();
    // Those above are further along x.
    let across = (reach + up * period.y * shear.abs()) / period.x;
    let [across, up] = [across.ceil() as i32, up as i32];
    let (own, strands) = (segments.len(), segments.last().map_or(0, |s| s.strand + 1));
    let mut lengths = vec![0.0; strands as usize];
    segments.iter().for_each(|s| lengths[s.strand as usize] = s.along + s.from.distance(s.to));
    let shifts = (-up..=up).flat_map(|y| (-across..=across).map(move |x| (x, y))).filter(|shift| *shift != (0, 0));
    for (image, (x, y)) in (1..).zip(shifts) {
        let by = sheared((DVec2::new(x.into(), y.into()) * period).extend(0.0), shear);
        for i in 0..own {
            let Segment { from, to, strand, along, .. } = segments[i];
            let (strand, along) = match y {
                0 => (strand, along + f64::from(x) * lengths[strand as usize]),
                _ => (strand + image * strands, along),
            };
            let moved = Segment { from: from + by, to: to + by, strand, index: IMAGE, along };
            let at = moved.middle().truncate();
            if at.cmpgt(low - reach).all() && at.cmplt(high + reach).all() {
                segments.push(moved);
            }
        }
    }
}

/// The segments of all strands, one behind the other: those near to one that is asked for, unless it is all of them.
fn segments(strands: &[PatternStrand], asked: &dyn Fn(u32) -> bool, reach: f64, all: bool) -> Vec<Segment> {
    let starts = strands.iter().flat_map(|s| s.curve.points.iter().take(s.curve.points.len().saturating_sub(1)));
    let asked_for = (0..).zip(starts).filter(|(index, _)| !all && asked(*index));
    let near = Cubes::around(asked_for.map(|(_, point)| *point), reach);
    let mut out = Vec::new();
    let mut index = 0;
    for (strand, s) in (0..).zip(strands) {
        let mut along = 0.0;
        for w in s.curve.points.windows(2) {
            let segment = Segment { from: w[0], to: w[1], strand, index, along };
            if all || near.hold(segment.middle()) {
                out.push(segment);
            }
            along += w[0].distance(w[1]);
            index += 1;
        }
    }
    out
}

/// Short axes of the sections along a strand, as long as the ratio of both axes. Their directions are evened out, so that plies
/// do not jump from one to the next. A strand that `repeats` ends as it begins.
fn axes(points: &[DVec3], sections: &[Section], repeats: bool) -> Vec<Vec3> {
    const ROUNDS: usize = 3;
    let end = points.len() - 1;
    let before = |i: usize| i.checked_sub(1).or(repeats.then(|| end.saturating_sub(1)));
    let after = |i: usize| if i < end { Some(i + 1) } else { repeats.then(|| 1.min(end)) };
    let mut lead: Vec<Vec3> = sections.iter().map(|s| s.axis * (1.0 - s.ratio())).collect();
    for _ in 0..ROUNDS {
        // An axis has no sign: those beside point to its side.
        let even = |i: usize| {
            let beside = |k: Option<usize>| k.and_then(|k| lead.get(k)).copied().unwrap_or(Vec3::ZERO);
            let (before, own, after) = (beside(before(i)), lead[i], beside(after(i)));
            let side = [own, before, after].into_iter().find(|v| *v != Vec3::ZERO).unwrap_or(Vec3::ZERO);
            let turned = |v: Vec3| if v.dot(side) < 0.0 { -v } else { v };
            0.5 * own + 0.25 * (turned(before) + turned(after))
        };
        lead = (0..lead.len()).into_par_iter().with_min_len(CHUNK).map(even).collect();
    }
    let axis = |i: usize| {
        let tangent = (points[(i + 1).min(end)] - points[i.saturating_sub(1)]).normalize_or(DVec3::X);
        let across = lead[i].as_dvec3().reject_from_normalized(tangent).try_normalize();
        let ratio = if sections[i].axis == Vec3::ZERO { 1.0 } else { f64::from(sections[i].ratio()) };
        // Where nothing is pressed near, any direction does.
        (ratio * across.unwrap_or_else(|| tangent.any_orthonormal_vector())).as_vec3()
    };
    (0..points.len()).into_par_iter().with_min_len(CHUNK).map(axis).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::overlap::{overlap, overlap_of_plied},
        pattern::{
            chart::Chart,
            knit::{Edges, FLATTEN, Form, Knit, Knitted, POINTS, Rims},
        },
    };

    const YARN: Thickness = Thickness { radius: 0.65, half_width: 0.91, flatten: FLATTEN };

    fn knit(pattern: &str, edges: Edges) -> Knit {
        let chart = Chart::named(pattern).unwrap();
        Knit {
            stitches: 24_u32.next_multiple_of(chart.even_width(100).unwrap()),
            chart,
            rows: 14,
            form: Form::Flat,
            stitch_width: None,
            row_height: None,
            yarn_per_stitch: None,
            edges,
            rims: Rims::default(),
            points: POINTS,
            colors: None,
            flat: true,
        }
    }

    fn share(made: &Knitted, round: bool) -> f64 {
        let curves = made.strands.iter().map(|s| {
            let mut curve = s.curve.clone();
            if round {
                curve.make_round();
                let radii = vec![YARN.radius; curve.points.len()];
                curve.radii = Some(radii);
            }
            curve
        });
        let curves: Vec<_> = curves.collect();
        let measured = curves.iter().map(|c| (c, c.radii.as_deref().unwrap(), YARN.half_width));
        overlap_of_plied(measured).unwrap().share
    }

    #[test]
    fn yarns_give_way_where_they_touch() {
        for pattern in ["stockinette", "rib2x2", "moss", "cable", "lace"] {
            let made = knit(pattern, Edges::Finished).pressed(&YARN).unwrap();
            let (round, pressed) = (share(&made, true), share(&made, false));
            println!(
                "{pattern}: of {:.1} % of its length, {:.2} % is left that overlaps",
                100.0 * round,
                100.0 * pressed
            );
            assert!(round > 0.3 && pressed < 0.02, "{pattern}: {round} {pressed}");
        }
    }

    #[test]
    fn sections_keep_their_area_but_where_they_have_no_room() {
        let made = knit("stockinette", Edges::Finished).pressed(&YARN).unwrap();
        let curve = &made.strands[0].curve;
        let (radii, axes) = (curve.radii.as_ref().unwrap(), curve.flattening.as_ref().unwrap());
        let area = |(radius, axis): (&f64, &Vec3)| radius * radius * f64::from(axis.length()) / YARN.radius.powi(2);
        let areas: Vec<f64> = radii.iter().zip(axes).map(area).collect();
        assert!(areas.iter().all(|a| (0.3..1.001).contains(a)));
        let mean = areas.iter().sum::<f64>() / areas.len() as f64;
        let pressed = axes.iter().filter(|axis| axis.length() < 0.9).count() as f64 / axes.len() as f64;
        assert!(mean > 0.75 && pressed > 0.3, "{mean} {pressed}");
        let widest = YARN.radius * FLATTEN.sqrt();
        assert!(radii.iter().all(|r| *r <= 1.001 * widest), "no section is wider than that of the flattest");
        // Short axes stand across the yarn.
        for (way, axis) in curve.points.windows(3).zip(&axes[1..]) {
            assert!((way[2] - way[0]).normalize().dot(axis.as_dvec3()).abs() < 1e-6);
        }
    }

    #[test]
    fn stitches_that_are_alike_are_pressed_once() {
        let knit = Knit { stitches: 14, rows: 14, ..knit("stockinette", Edges::Finished) };
        let once = knit.pressed(&YARN).unwrap();
        let mut each = once.clone();
        flatten_where_touching(&mut each.strands, &YARN, &Alike::No);
        for (a, b) in once.strands.iter().zip(&each.strands) {
            for (a, b) in a.curve.radii.iter().flatten().zip(b.curve.radii.iter().flatten()) {
                assert!((a - b).abs() < 1e-4 * YARN.radius, "{a} {b}");
            }
        }
    }

    #[test]
    fn a_tile_ends_as_it_begins() {
        let tile = Knit { stitches: 2, rows: 2, ..knit("stockinette", Edges::Tile) }.pressed(&YARN).unwrap();
        let larger = Knit { stitches: 6, rows: 6, ..knit("stockinette", Edges::Tile) }.pressed(&YARN).unwrap();
        let radii = |made: &Knitted, row: usize| made.strands[row].curve.radii.clone().unwrap();
        for row in &tile.strands {
            let radii = row.curve.radii.as_ref().unwrap();
            assert_eq!(radii.first(), radii.last());
        }
        // What is around a small one is its images: as pressed as in the middle of a large one.
        let (small, large) = (radii(&tile, 0), radii(&larger, 2));
        let inside = &large[small.len() - 1..][1..small.len() - 1];
        for (a, b) in small[1..].iter().zip(inside) {
            assert!((a - b).abs() < 1e-3 * YARN.radius, "{a} {b}");
        }
    }

    #[test]
    fn yarn_that_stays_round_is_left_alone() {
        let round = Thickness { flatten: 1.0, half_width: 1.0, ..YARN };
        let made = knit("stockinette", Edges::Live).pressed(&round).unwrap();
        assert!(made.strands.iter().all(|s| s.curve.radii.is_none() && s.curve.flattening.is_none()));
        let radii = vec![YARN.radius; made.strands[0].curve.points.len()];
        assert!(overlap(std::iter::once((&made.strands[0].curve, radii.as_slice()))).unwrap().share < 0.01);
    }
}
