//! What a curve file leaves out, guessed from its curves: the radius of its yarns, and its unit of length.

use glam::DVec3;

use super::curve::{Curve, CurveSet};
use super::overlap::{Overlap, overlap};

/// Share of the length that may overlap at the radius that is proposed: models of cloth are made to touch, not to be
/// without any overlap.
const OVERLAP: f64 = 0.02;
/// Points that are looked at, those around the middle of the file: enough to know the rest.
const LOOKED_AT: usize = 20_000;
/// Tenths by which the radius grows at most, and at a time to begin with.
const MOST_STEPS: u32 = 60;
const STRIDE: u32 = 4;
/// Radius of a common yarn, millimetres: worsted knitting yarn has about 1, fine weaving yarn 0.2.
const COMMON_RADIUS: f64 = 0.5;
/// Units of length and their millimetres, the likeliest first.
pub(crate) const UNITS: [(&str, f64); 5] = [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4), ("um", 1e-3)];

/// A guess, in the file's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Proposal {
    /// The largest radius at which yarns hardly overlap.
    pub radius: f64,
    /// How far they overlap at that radius.
    pub overlap: Overlap,
    /// Radius of the bends: one in a hundred is tighter than the first, half are tighter than the second.
    pub bends: [f64; 2],
    /// The unit that makes the radius most like that of a yarn, and its millimetres.
    pub unit: (&'static str, f64),
}

impl Proposal {
    /// Looks at the curves around the middle of a file. `None` if they are too few to tell, or never come near each other.
    pub(crate) fn new(set: &CurveSet) -> Option<Self> {
        let curves = around_the_middle(set);
        // Points are seldom farther apart than a few radii, or nearer than a tenth of one.
        let mut steps: Vec<f64> =
            curves.iter().flat_map(|c| c.points.windows(2)).map(|p| p[0].distance(p[1])).filter(|d| *d > 0.0).collect();
        steps.sort_unstable_by(f64::total_cmp);
        let least = 0.1 * steps.get(steps.len() / 2)?;
        let radius = |step: u32| least * 1.1f64.powi(step as i32);
        let at = |step: u32| {
            let radii: Vec<Vec<f64>> = curves.iter().map(|c| vec![radius(step); c.points.len()]).collect();
            overlap(curves.iter().zip(&radii).map(|(c, r)| (c, r.as_slice())))
        };
        // Up from there in steps of a tenth, as far as 30 points apart, until yarns run into each other: first in strides,
        // as they do so more and more.
        let (mut step, mut found) = (0, at(0).filter(|o| o.share <= OVERLAP)?);
        for stride in [STRIDE, 2, 1] {
            while step + stride <= MOST_STEPS {
                match at(step + stride)? {
                    next if next.share > OVERLAP => break,
                    next => (step, found) = (step + stride, next),
                }
            }
        }
        if step == MOST_STEPS {
            return None;
        }
        let radius = radius(step);
        let log = |millimetres: f64| (radius * millimetres / COMMON_RADIUS).ln().abs();
        let unit = UNITS.into_iter().min_by(|a, b| log(a.1).total_cmp(&log(b.1)))?;
        Some(Self { radius, overlap: found, bends: bends(&curves), unit })
    }
}

/// Pieces of curves around the middle of all points.
fn around_the_middle(set: &CurveSet) -> Vec<Curve> {
    let total: usize = set.curves.iter().map(|c| c.points.len()).sum();
    if total <= LOOKED_AT {
        return set.curves.clone();
    }
    let all = || set.curves.iter().flat_map(|c| &c.points);
    let mean = all().sum::<DVec3>() / total as f64;
    // Cloth may be hollow: the point that is nearest to the middle is on it.
    let Some(centre) = all().copied().min_by(|a, b| a.distance_squared(mean).total_cmp(&b.distance_squared(mean)))
    else {
        return Vec::new();
    };
    let mut distances: Vec<f64> = all().map(|p| p.distance_squared(centre)).collect();
    let (_, reach, _) = distances.select_nth_unstable_by(LOOKED_AT, f64::total_cmp);
    let reach = *reach;
    let mut pieces = Vec::new();
    for curve in &set.curves {
        for run in curve.points.split(|p| p.distance_squared(centre) > reach).filter(|run| run.len() >= 4) {
            pieces.push(Curve { points: run.to_vec(), closed: false, radii: None, flattening: None, ..curve.clone() });
        }
    }
    pieces
}

/// Radii of the circles through each three points in a row: the first hundredth and the median.
fn bends(curves: &[Curve]) -> [f64; 2] {
    let mut radii: Vec<f64> = curves
        .iter()
        .flat_map(|c| c.points.windows(3))
        .map(|p| {
            let (a, b, c) = (p[1] - p[0], p[2] - p[1], p[2] - p[0]);
            0.5 * a.length() * b.length() * c.length() / a.cross(b).length()
        })
        .filter(|r| !r.is_nan())
        .collect();
    radii.sort_unstable_by(f64::total_cmp);
    [0.01, 0.5].map(|share| radii.get((share * radii.len() as f64) as usize).copied().unwrap_or(f64::INFINITY))
}

/// Width, height and depth of cloth in centimetres, for each unit that a file may be in.
pub(crate) fn sizes(set: &CurveSet) -> Vec<(&'static str, DVec3)> {
    let all = || set.curves.iter().flat_map(|c| &c.points).copied();
    let size = all().reduce(DVec3::max).zip(all().reduce(DVec3::min)).map_or(DVec3::ZERO, |(high, low)| high - low);
    UNITS.into_iter().map(|(name, millimetres)| (name, size * millimetres / 10.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::{chart::Chart, knit};

    /// Cloth of a known radius, as a file that does not tell it, in metres.
    #[test]
    fn the_radius_of_made_cloth_is_found_again() {
        let piece = knit::Knit {
            chart: Chart::named("stockinette").unwrap(),
            stitches: 12,
            rows: 12,
            form: knit::Form::Flat,
            stitch_width: None,
            row_height: None,
            edges: knit::Edges::Live,
            rims: knit::Rims::default(),
            yarn_per_stitch: None,
            points: knit::POINTS,
            colors: None,
            flat: true,
        };
        let mut curves: Vec<Curve> = piece.strands(1.0).unwrap().into_iter().map(|s| s.curve).collect();
        for curve in &mut curves {
            curve.points.iter_mut().for_each(|p| *p *= 1e-3);
        }
        let set = CurveSet { curves, ..CurveSet::default() };
        let found = Proposal::new(&set).unwrap();
        assert!((found.radius / 0.5e-3 - 1.0).abs() < 0.25, "{found:?}");
        assert_eq!(found.unit.0, "m");
        assert!(
            found.overlap.share <= OVERLAP && found.bends[0] > 0.2e-3 && found.bends[1] > found.bends[0],
            "{found:?}"
        );
        let of_metres = sizes(&set).into_iter().find(|(name, _)| *name == "m").unwrap().1;
        assert!((2.0..8.0).contains(&of_metres.x), "a swatch of some centimetres: {of_metres}");
        // One straight yarn touches nothing.
        let alone = CurveSet {
            curves: vec![Curve { points: (0..9).map(|i| DVec3::X * f64::from(i)).collect(), ..set.curves[0].clone() }],
            ..CurveSet::default()
        };
        assert_eq!(Proposal::new(&alone), None);
    }
}
