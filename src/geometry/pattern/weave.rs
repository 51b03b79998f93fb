//! Woven cloth: yarns that bend around each other as in Peirce's geometry ("The Geometry of Cloth Structure", 1937).
//!
//! Where a yarn crosses another it lies on it: its centre line is an arc about the other's axis, with the sum of both
//! radii as its own; between two crossings on different sides runs the tangent of both arcs, between two on the same
//! side it floats. The centre lines of warp and weft are never nearer than that sum: for two arcs that each pass through
//! the other's centre, distance^2 = D^2 (1 + 2 (1 - cos a)(1 - cos b)).

use glam::DVec3;

use super::{MAX_POINTS, PatternStrand, StrandKind, draft::Draft};
use crate::geometry::curve::{Basis, Curve};

/// A rectangle of woven cloth in the plane z = 0: warps along y, wefts along x, right side towards +z. Lengths in the
/// unit of the radii.
#[derive(Clone, Debug, PartialEq)]
pub struct Weave {
    /// What lies over what.
    pub draft: Draft,
    /// Number of warps.
    pub warps: u32,
    /// Number of wefts.
    pub wefts: u32,
    /// Radius of the warp yarn.
    pub warp_radius: f64,
    /// Radius of the weft yarn.
    pub weft_radius: f64,
    /// Distance between warps; the least there is room for if absent.
    pub warp_spacing: Option<f64>,
    /// Distance between wefts.
    pub weft_spacing: Option<f64>,
    /// The warp's share of the crimp: 0 leaves warps straight, 1 wefts.
    pub crimp: f64,
    /// Control points between two crossings.
    pub points: u32,
}

/// A spacing that leaves yarns no room.
#[derive(Clone, Debug, PartialEq)]
pub struct TooTight {
    /// Whether it is the warps'; else the wefts'.
    pub warp: bool,
    /// The least that is possible.
    pub least: f64,
}

/// How much further than touching yarns are laid apart: what a spline through few points may cut off an arc.
const SLACK: f64 = 1.02;

/// Control points between crossings unless asked otherwise.
pub const POINTS: u32 = 4;

impl Weave {
    fn reach(&self) -> f64 {
        (self.warp_radius + self.weft_radius) * SLACK
    }

    /// The least spacing of warps and of wefts.
    pub fn least_spacing(&self) -> [f64; 2] {
        let reach = self.reach();
        // A yarn changes sides between two others whose centres are off by `offset`.
        let room = |offset: f64| 2.0 * (reach * reach - offset * offset).max(0.0).sqrt();
        let (warp, weft) = (self.crimp * reach, (1.0 - self.crimp) * reach);
        [room(warp).max(2.0 * SLACK * self.warp_radius), room(weft).max(2.0 * SLACK * self.weft_radius)]
    }

    /// Spacing of warps and of wefts.
    ///
    /// # Errors
    /// Yarns would cut through each other.
    pub fn spacing(&self) -> Result<[f64; 2], TooTight> {
        let [warp, weft] = self.least_spacing();
        let check = |asked: Option<f64>, least: f64, warp| match asked {
            // What was computed and written with few digits is no mistake.
            Some(s) if s < least * 0.999 => Err(TooTight { warp, least }),
            Some(s) => Ok(s.max(least)),
            None => Ok(least * 1.005),
        };
        Ok([check(self.warp_spacing, warp, true)?, check(self.weft_spacing, weft, false)?])
    }

    /// How many control points the cloth has.
    pub fn control_points(&self) -> u64 {
        2 * u64::from(self.warps + 1) * u64::from(self.wefts + 1) * u64::from(self.points)
    }

    /// The warps, from left to right, then the wefts, from bottom to top; each an open curve.
    ///
    /// # Errors
    /// As [`Self::spacing`].
    ///
    /// # Panics
    /// If there are more than [`MAX_POINTS`] control points.
    pub fn strands(&self) -> Result<Vec<PatternStrand>, TooTight> {
        assert!(self.control_points() <= MAX_POINTS, "a weave of {} control points", self.control_points());
        let [warp_spacing, weft_spacing] = self.spacing()?;
        let reach = self.reach();
        let (warp_offset, weft_offset) = (self.crimp * reach, (1.0 - self.crimp) * reach);
        let middle = |count: u32| 0.5 * f64::from(count);
        let run = |signs: &[f64], spacing: f64, offset: f64| path(signs, spacing, reach, offset, self.points);
        let mut out = Vec::with_capacity((self.warps + self.wefts) as usize);
        let strand = |kind, index: u32, points: Vec<DVec3>, coordinates| PatternStrand {
            curve: Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None },
            kind,
            index,
            coordinates,
        };
        for j in 0..self.warps {
            let sign = |i| if self.draft.warp_over(i as usize, j as usize) { 1.0 } else { -1.0 };
            let signs: Vec<f64> = (0..self.wefts).map(sign).collect();
            let x = (f64::from(j) + 0.5 - middle(self.warps)) * warp_spacing;
            let y0 = -middle(self.wefts) * weft_spacing;
            let (points, places) = run(&signs, weft_spacing, weft_offset)
                .into_iter()
                .map(|p| (DVec3::new(x, y0 + p.along, p.height), [j as f32 + 0.5, p.place]))
                .unzip();
            out.push(strand(StrandKind::Warp, j, points, places));
        }
        for i in 0..self.wefts {
            let sign = |j| if self.draft.warp_over(i as usize, j as usize) { -1.0 } else { 1.0 };
            let signs: Vec<f64> = (0..self.warps).map(sign).collect();
            let y = (f64::from(i) + 0.5 - middle(self.wefts)) * weft_spacing;
            let x0 = -middle(self.warps) * warp_spacing;
            let (points, places) = run(&signs, warp_spacing, warp_offset)
                .into_iter()
                .map(|p| (DVec3::new(x0 + p.along, y, p.height), [p.place, i as f32 + 0.5]))
                .unzip();
            out.push(strand(StrandKind::Weft, i, points, places));
        }
        Ok(out)
    }
}

/// A control point of a yarn across others: along it, above the cloth's middle, and its place in crossings.
struct PathPoint {
    along: f64,
    height: f64,
    place: f32,
}

/// The way of a yarn over (1) and under (-1) others `spacing` apart, whose centres are `offset` to the other side;
/// it begins and ends half a spacing beyond the first and the last.
fn path(signs: &[f64], spacing: f64, reach: f64, offset: f64, points: u32) -> Vec<PathPoint> {
    let own = reach - offset;
    let half = 0.5 * spacing;
    // Up to this angle a yarn that changes sides follows the arc.
    let angle = (reach / half.hypot(offset)).min(1.0).asin() - offset.atan2(half);
    let tangent_length = (half * half + offset * offset - reach * reach).max(0.0).sqrt();
    let half_length = reach * angle + tangent_length;
    // From above a crossing (side 1) down to the middle, by length: along and height.
    let descent = |s: f64| {
        let turned = (s / reach).min(angle);
        let rest = s - reach * turned;
        (reach * turned.sin() + rest * turned.cos(), reach * turned.cos() - offset - rest * turned.sin())
    };
    // Floats and ends have points as far apart as bends have: a spline through uneven ones has kinks.
    let even = |length: f64| (f64::from(points) * length / (2.0 * half_length)).round().max(1.0) as u32;
    let n = signs.len();
    let mut out = Vec::with_capacity((n + 1) * points as usize + 1);
    let end = |along: f64, sign: f64| PathPoint { along, height: sign * own, place: (along / spacing) as f32 };
    let ends = even(half);
    let within = |k: u32| half * f64::from(k) / f64::from(ends);
    out.extend((0..ends).map(|k| end(within(k), signs[0])));
    for (i, pair) in signs.windows(2).enumerate() {
        let start = (i as f64 + 0.5) * spacing;
        let steps = if pair[0] == pair[1] { even(spacing) } else { points };
        for k in 0..steps {
            let share = f64::from(k) / f64::from(steps);
            let (along, height) = if pair[0] == pair[1] {
                (share * spacing, own)
            } else {
                let s = 2.0 * half_length * share;
                if s <= half_length {
                    descent(s)
                } else {
                    let (along, height) = descent(2.0 * half_length - s);
                    (spacing - along, -height)
                }
            };
            out.push(PathPoint {
                along: start + along,
                height: pair[0] * height,
                place: ((start + along) / spacing) as f32,
            });
        }
    }
    out.extend((0..=ends).map(|k| end((n as f64 - 0.5) * spacing + within(k), signs[n - 1])));
    out
}

#[cfg(test)]
mod tests {
    use super::super::overlap::overlap;
    use super::*;
    use crate::geometry::strand::{StrandOptions, Strands};

    fn weave(draft: &str) -> Weave {
        Weave {
            draft: Draft::named(draft).unwrap(),
            warps: 12,
            wefts: 10,
            warp_radius: 1.0,
            weft_radius: 1.0,
            warp_spacing: None,
            weft_spacing: None,
            crimp: 0.5,
            points: POINTS,
        }
    }

    #[track_caller]
    fn does_not_overlap(weave: &Weave, name: &str) {
        let strands = weave.strands().unwrap();
        let radius = |s: &PatternStrand| if s.kind == StrandKind::Warp { weave.warp_radius } else { weave.weft_radius };
        let strands: Vec<PatternStrand> = strands.into_iter().map(PatternStrand::smooth).collect();
        let radii: Vec<Vec<f64>> = strands.iter().map(|s| vec![radius(s); s.curve.points.len()]).collect();
        let found = overlap(strands.iter().zip(&radii).map(|(s, r)| (&s.curve, r.as_slice()))).unwrap();
        eprintln!("{name}: {found:?}");
        assert_eq!(found.share, 0.0, "{name}");
        assert!(found.deepest < 0.02, "{name}");
        // Yarns touch: else it would not be cloth.
        assert!(found.nearest < 1.03, "{name}: {}", found.nearest);
    }

    #[test]
    fn yarns_touch_and_do_not_cut() {
        for draft in ["plain", "twill 2/1", "twill 2/2", "satin 5", "satin 8/3", "basket 2"] {
            does_not_overlap(&weave(draft), draft);
        }
    }

    #[test]
    fn yarns_bend_no_more_tightly_than_around_each_other() {
        for draft in ["plain", "twill 3/1", "satin 8/3", "basket 2"] {
            let strands = weave(draft).strands().unwrap();
            let curves: Vec<(Curve, Vec<f64>)> =
                strands.into_iter().map(|s| s.smooth().curve).map(|c| (c.clone(), vec![1.0; c.points.len()])).collect();
            let options = StrandOptions {
                basis: Basis::BSpline,
                tolerance: 0.005,
                longest_segment: 6.0,
                ply_rate: 0.0,
                symmetry: 1.0,
                phases: Vec::new(),
            };
            assert_eq!(Strands::new(&curves, &options).tight_bends(), [], "{draft}");
        }
    }

    #[test]
    fn unequal_yarns_and_crimps_touch_and_do_not_cut() {
        for (warp_radius, weft_radius, crimp) in [(1.0, 0.4, 0.5), (0.3, 1.0, 0.7), (1.0, 1.0, 1.0), (1.0, 0.7, 0.0)] {
            let weave = Weave { warp_radius, weft_radius, crimp, ..weave("twill 2/1") };
            does_not_overlap(&weave, &format!("{warp_radius} {weft_radius} {crimp}"));
        }
    }

    #[test]
    fn the_draft_says_what_lies_on_top() {
        let weave = weave("twill 3/1");
        let strands = weave.strands().unwrap();
        let height = |kind, index: u32, place: [f32; 2]| {
            let strand = strands.iter().find(|s| s.kind == kind && s.index == index).unwrap();
            let near = |c: &[f32; 2]| (c[0] - place[0]).hypot(c[1] - place[1]);
            let i = (0..strand.coordinates.len())
                .min_by(|&a, &b| near(&strand.coordinates[a]).total_cmp(&near(&strand.coordinates[b])))
                .unwrap();
            strand.curve.points[i].z
        };
        for i in 0..weave.wefts {
            for j in 0..weave.warps {
                let place = [j as f32 + 0.5, i as f32 + 0.5];
                let over = height(StrandKind::Warp, j, place) > height(StrandKind::Weft, i, place);
                assert_eq!(over, weave.draft.warp_over(i as usize, j as usize));
            }
        }
    }

    #[test]
    fn too_little_room_is_refused() {
        let tight = Weave { warp_spacing: Some(2.5), ..weave("plain") };
        let Err(TooTight { warp: true, least }) = tight.strands() else { panic!("accepted") };
        assert!((least - 3.5).abs() < 0.1, "{least}");
        assert!(Weave { warp_spacing: Some(least), ..tight }.strands().is_ok());
    }
}
