//! Batches of curves as stages keep them, as curves of this program.
//!
//! What the bases and ends of `UsdGeomBasisCurves` mean, and what becomes of them here (Alembic's are the same):
//! * `bspline`: the same B-spline; `pinned` ends get the mirrored point that USD puts beyond them.
//! * `catmullRom`: `pinned` and `periodic` are the same curves; a `nonperiodic` one begins at its second point, and its
//!   first only bends it, which an open curve here cannot say: it is put through points of its own, [`STEPS`] a segment.
//! * `bezier`: likewise put through points.
//! * `linear`: the same.
//!
//! Widths are diameters in the space of the object.

use glam::{DMat4, DVec3};

use super::{MAX_POINTS, Problem};
use crate::geometry::curve::{Basis, Curve, CurveSet};

/// Points of a segment whose basis is put through points: the curve through them is off by about a hundredth of the
/// segment's bulge, most where two segments meet at an angle.
const STEPS: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StageBasis {
    Linear,
    Bezier,
    BSpline,
    CatmullRom,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wrap {
    NonPeriodic,
    Periodic,
    #[cfg_attr(not(feature = "usd"), allow(dead_code, reason = "Alembic has no pinned curves"))]
    Pinned,
}

/// Names of numbers of curves; the first that an object has counts. Other programs have their own.
pub(super) const ID_NAMES: [&str; 3] = ["yarnId", "id", "curveId"];
/// The name of the number of a curve's ply.
pub(super) const PLY_NAMES: [&str; 1] = ["plyId"];

/// What all curves of a batch share.
struct Kind {
    basis: StageBasis,
    wrap: Wrap,
    /// Whether pinned curves have as many varying values as open ones, as usd-core counts them.
    few_varying: bool,
}

/// The curves of one object, as stages keep them: all points in one list.
pub(super) struct Batch {
    pub(super) basis: StageBasis,
    pub(super) wrap: Wrap,
    /// Number of points of each curve.
    pub(super) counts: Vec<i64>,
    pub(super) points: Vec<DVec3>,
    /// Diameters, and how they are spread.
    pub(super) widths: Option<(Vec<f64>, Spread)>,
    /// Colours, linear Rec.709.
    pub(super) colors: Option<(Vec<DVec3>, Spread)>,
    /// Numbers of the curves' yarns.
    pub(super) ids: Option<(Vec<i64>, Spread)>,
    /// Numbers of their plies.
    pub(super) plies: Option<(Vec<i64>, Spread)>,
}

/// How values are spread over an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spread {
    Constant,
    Uniform,
    Varying,
    Vertex,
    FaceVarying,
}

impl Spread {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Uniform => "uniform",
            Self::Varying => "varying",
            Self::Vertex => "vertex",
            Self::FaceVarying => "faceVarying",
        }
    }
}

impl Batch {
    /// Adds the curves, in the space of the stage.
    pub(super) fn add_to(self, set: &mut CurveSet, to_stage: &DMat4) -> Result<(), Problem> {
        if !to_stage.is_finite() {
            return Err(Problem::new("its transform is not finite"));
        }
        let mut kind = Kind::new(self.basis, self.wrap);
        let Self { counts, points, .. } = self;
        let mut total = 0usize;
        for (i, &count) in counts.iter().enumerate() {
            let least = kind.fewest_points();
            let count = usize::try_from(count).ok().filter(|c| (least..=MAX_POINTS).contains(c)).ok_or_else(|| {
                Problem::new(format!("curve {i} has {count} points; {} curves have at least {least}", kind.name()))
            })?;
            if kind.basis == StageBasis::Bezier && !kind.bezier_count_fits(count) {
                let rule =
                    if kind.wrap == Wrap::Periodic { "a multiple of 3" } else { "one more than a multiple of 3" };
                return Err(Problem::unknown(format!("curve {i} has {count} points; of a bezier curve it is {rule}")));
            }
            total = total.saturating_add(count);
        }
        if total != points.len() {
            let found = points.len();
            return Err(Problem::new(format!("the counts of points add up to {total}, but there are {found} points")));
        }
        if let Some(i) = points.iter().position(|p| !p.is_finite()) {
            return Err(Problem::new(format!("point {i} is not finite")));
        }
        let scale = to_stage.determinant().abs().cbrt();
        if let (Wrap::Pinned, Some((widths, Spread::Varying))) = (kind.wrap, &self.widths) {
            let open: i64 = counts.iter().map(|&c| (c - 2).max(2)).sum();
            kind.few_varying = widths.len() as i64 == open;
        }
        let widths = Widths::new(self.widths, &kind, &counts)?;
        let before = set.curves.len();
        let mut first = 0;
        let mut first_varying = 0;
        for (i, &count) in counts.iter().enumerate() {
            let count = count as usize;
            let own: Vec<DVec3> = points[first..first + count].iter().map(|p| to_stage.transform_point3(*p)).collect();
            let radius = |width: f64| 0.5 * scale * width.max(0.0);
            let radii = widths.of_curve(&kind, i, first, first_varying, count);
            set.curves.push(kind.curve(own, radii.map(|widths| widths.into_iter().map(radius).collect())));
            first += count;
            first_varying += kind.varying_values(count);
        }
        let labels = Labels { kind: &kind, counts: &counts };
        labels.add_to(set, before, self.colors, [self.ids, self.plies]);
        let stretch = [to_stage.x_axis, to_stage.y_axis, to_stage.z_axis].map(|axis| axis.truncate().length());
        let (least, most) =
            (stretch.iter().copied().fold(f64::INFINITY, f64::min), stretch.iter().copied().fold(0.0, f64::max));
        if widths != Widths::None && most > 1.01 * least {
            set.notes.push("curves stretched by their transform have the mean of their widths".into());
        }
        Ok(())
    }
}

impl Kind {
    fn new(basis: StageBasis, wrap: Wrap) -> Self {
        // Only the two bases that do not reach their ends know pinned ones.
        let wrap = match (basis, wrap) {
            (StageBasis::Linear | StageBasis::Bezier, Wrap::Pinned) => Wrap::NonPeriodic,
            _ => wrap,
        };
        Self { basis, wrap, few_varying: false }
    }

    fn name(&self) -> &'static str {
        match self.basis {
            StageBasis::Linear => "linear",
            StageBasis::Bezier => "bezier",
            StageBasis::BSpline => "bspline",
            StageBasis::CatmullRom => "catmullRom",
        }
    }

    fn fewest_points(&self) -> usize {
        match (self.basis, self.wrap) {
            (StageBasis::Linear, Wrap::Periodic) => 3,
            (StageBasis::Linear, _) | (_, Wrap::Pinned) => 2,
            (StageBasis::Bezier, Wrap::Periodic) => 3,
            (_, Wrap::Periodic) => 3,
            _ => 4,
        }
    }

    fn bezier_count_fits(&self, count: usize) -> bool {
        if self.wrap == Wrap::Periodic { count.is_multiple_of(3) } else { count % 3 == 1 }
    }

    /// Segments of a curve of so many points.
    fn segments(&self, count: usize) -> usize {
        match (self.basis, self.wrap) {
            (StageBasis::Bezier, Wrap::Periodic) => count / 3,
            (StageBasis::Bezier, _) => (count - 1) / 3,
            (_, Wrap::Periodic) => count,
            (StageBasis::Linear, _) | (_, Wrap::Pinned) => count - 1,
            _ => count - 3,
        }
    }

    /// How many varying values such a curve has: one for each end of a segment.
    fn varying_values(&self, count: usize) -> usize {
        if self.few_varying {
            return (count - 2.min(count)).max(2);
        }
        self.segments(count) + usize::from(self.wrap != Wrap::Periodic)
    }

    /// The curve, from all its points and radii.
    fn curve(&self, points: Vec<DVec3>, radii: Option<Vec<f64>>) -> Curve {
        let closed = self.wrap == Wrap::Periodic;
        let beyond = |end: DVec3, next: DVec3| 2.0 * end - next;
        match (self.basis, self.wrap) {
            (StageBasis::Linear, _) => Curve { basis: Basis::Linear, closed, points, radii, flattening: None },
            (StageBasis::BSpline, Wrap::Pinned) => {
                let n = points.len();
                let mut all = vec![beyond(points[0], points[1])];
                all.extend(&points);
                all.push(beyond(points[n - 1], points[n - 2]));
                let radii = radii.map(|r| {
                    let mut all = vec![(2.0 * r[0] - r[1]).max(0.0)];
                    all.extend(&r);
                    all.push((2.0 * r[n - 1] - r[n - 2]).max(0.0));
                    all
                });
                Curve { basis: Basis::BSpline, closed, points: all, radii, flattening: None }
            }
            (StageBasis::BSpline, _) => Curve { basis: Basis::BSpline, closed, points, radii, flattening: None },
            (StageBasis::CatmullRom, Wrap::Periodic | Wrap::Pinned) => {
                Curve { basis: Basis::CatmullRom, closed, points, radii, flattening: None }
            }
            (StageBasis::CatmullRom, Wrap::NonPeriodic) | (StageBasis::Bezier, _) => {
                self.through_points(&points, radii)
            }
        }
    }

    /// A curve through points of this one.
    fn through_points(&self, points: &[DVec3], radii: Option<Vec<f64>>) -> Curve {
        let closed = self.wrap == Wrap::Periodic;
        let segments = self.segments(points.len());
        let places = segments * STEPS + usize::from(!closed);
        let place = |k: usize| ((k / STEPS).min(segments - 1), k);
        let mut out = Vec::with_capacity(places);
        let mut out_radii = radii.as_ref().map(|_| Vec::with_capacity(places));
        for (segment, k) in (0..places).map(place) {
            let u = (k - segment * STEPS) as f64 / STEPS as f64;
            let weights = self.weights(u);
            let first = if self.basis == StageBasis::Bezier { 3 * segment } else { segment };
            let index = |i: usize| (first + i) % points.len();
            out.push((0..4).map(|i| weights[i] * points[index(i)]).sum());
            if let (Some(out), Some(radii)) = (&mut out_radii, &radii) {
                out.push((0..4).map(|i| weights[i] * radii[index(i)]).sum::<f64>().max(0.0));
            }
        }
        Curve { basis: Basis::CatmullRom, closed, points: out, radii: out_radii, flattening: None }
    }

    /// Weights of the four points of a segment.
    fn weights(&self, u: f64) -> [f64; 4] {
        let v = 1.0 - u;
        if self.basis == StageBasis::Bezier {
            [v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u]
        } else {
            [
                0.5 * u * (u * (2.0 - u) - 1.0),
                0.5 * (u * u * (3.0 * u - 5.0) + 2.0),
                0.5 * u * (u * (4.0 - 3.0 * u) + 1.0),
                0.5 * u * u * (u - 1.0),
            ]
        }
    }
}

/// What curves are labelled with, by the numbers of their points.
struct Labels<'a> {
    kind: &'a Kind,
    counts: &'a [i64],
}

impl Labels<'_> {
    /// Gives the curves from `before` on their colours and the numbers of their yarns and plies.
    fn add_to(
        &self,
        set: &mut CurveSet,
        before: usize,
        colors: Option<(Vec<DVec3>, Spread)>,
        numbers: [Option<(Vec<i64>, Spread)>; 2],
    ) {
        let mean = |v: &[DVec3]| v.iter().sum::<DVec3>() / v.len().max(1) as f64;
        let color = |v: DVec3| {
            Some(v.max(DVec3::ZERO).to_array().map(|c| c as f32)).filter(|c| c.iter().all(|c| c.is_finite()))
        };
        let colors = self.of("colours", colors, mean, &mut set.notes);
        set.add_labels(before, colors.map(|all| all.into_iter().map(color).collect()), |set| &mut set.colors);
        let [ids, plies] = numbers;
        let ids = self.of("ids", ids, |v| v[0], &mut set.notes);
        set.add_labels(before, ids.map(|all| all.into_iter().map(Some).collect()), |set| &mut set.ids);
        let plies = self.of("numbers of plies", plies, |v| v[0], &mut set.notes);
        set.add_labels(before, plies.map(|all| all.into_iter().map(Some).collect()), |set| &mut set.plies);
    }

    /// One value for each curve; of values along a curve what `one` makes of them. What does not fit is left out with a note:
    /// curves are as good without.
    fn of<T: Copy>(
        &self,
        name: &str,
        given: Option<(Vec<T>, Spread)>,
        one: impl Fn(&[T]) -> T,
        notes: &mut Vec<String>,
    ) -> Option<Vec<T>> {
        let (values, spread) = given.filter(|(v, _)| !v.is_empty())?;
        let curves = self.counts.len();
        // One value is that of all, whatever it is called.
        if values.len() == 1 {
            return Some(vec![values[0]; curves]);
        }
        let sizes: Vec<usize> = match spread {
            Spread::Constant | Spread::Uniform => vec![1; curves],
            Spread::Vertex => self.counts.iter().map(|&c| c as usize).collect(),
            Spread::Varying | Spread::FaceVarying => {
                let ends: Vec<usize> = self.counts.iter().map(|&c| self.kind.varying_values(c as usize)).collect();
                // Many programs take the word for values of points.
                let of_points = values.len() as i64 == self.counts.iter().sum::<i64>();
                if of_points { self.counts.iter().map(|&c| c as usize).collect() } else { ends }
            }
        };
        let expected: usize = sizes.iter().sum();
        if values.len() != expected {
            let (spread, found) = (spread.name(), values.len());
            notes.push(format!("{name} are left out: {spread} values are {expected} here, found {found}"));
            return None;
        }
        let mut rest = values.as_slice();
        let of_curve = |&size: &usize| {
            let (own, others) = rest.split_at(size);
            rest = others;
            one(own)
        };
        Some(sizes.iter().map(of_curve).collect())
    }
}

/// The widths of a batch, as they are spread.
#[derive(Clone, Debug, PartialEq)]
enum Widths {
    None,
    Constant(f64),
    Uniform(Vec<f64>),
    Varying(Vec<f64>),
    Vertex(Vec<f64>),
}

impl Widths {
    fn new(given: Option<(Vec<f64>, Spread)>, kind: &Kind, counts: &[i64]) -> Result<Self, Problem> {
        let Some((widths, spread)) = given.filter(|(w, _)| !w.is_empty()) else { return Ok(Self::None) };
        if let Some(i) = widths.iter().position(|w| !w.is_finite()) {
            return Err(Problem::new(format!("width {i} is not finite")));
        }
        let mut widths = widths;
        let segments: usize = counts.iter().map(|&c| kind.segments(c as usize)).sum();
        if spread == Spread::Varying && kind.wrap == Wrap::Periodic && widths.len() == segments + counts.len() {
            // Some writers give a ring's first value again at its end, as usd-core counts linear ones.
            let mut rest = widths.as_slice();
            let mut kept = Vec::with_capacity(segments);
            for &count in counts {
                let (own, others) = rest.split_at(kind.segments(count as usize));
                kept.extend_from_slice(own);
                rest = &others[1..];
            }
            widths = kept;
        }
        let points: usize = counts.iter().map(|&c| c as usize).sum();
        let varying: usize = counts.iter().map(|&c| kind.varying_values(c as usize)).sum();
        let wrong = |name: &str, expected: usize| {
            let found = widths.len();
            Err(Problem::new(format!("{name} widths are {expected} here, found {found}")))
        };
        // One width is that of all, whatever it is called: USD's own renderers take it so.
        match spread {
            _ if widths.len() == 1 => Ok(Self::Constant(widths[0])),
            Spread::Constant => wrong("constant", 1),
            Spread::Uniform if widths.len() == counts.len() => Ok(Self::Uniform(widths)),
            Spread::Uniform => wrong("uniform", counts.len()),
            Spread::Varying if widths.len() == varying => Ok(Self::Varying(widths)),
            Spread::Varying => wrong("varying", varying),
            Spread::Vertex if widths.len() == points => Ok(Self::Vertex(widths)),
            Spread::Vertex => wrong("vertex", points),
            Spread::FaceVarying => Err(Problem::new("faceVarying widths mean nothing on curves")),
        }
    }

    /// The widths of one curve, one for each of its points.
    fn of_curve(&self, kind: &Kind, i: usize, first: usize, first_varying: usize, count: usize) -> Option<Vec<f64>> {
        match self {
            Self::None => None,
            Self::Constant(width) => Some(vec![*width; count]),
            Self::Uniform(widths) => Some(vec![widths[i]; count]),
            Self::Vertex(widths) => Some(widths[first..first + count].to_vec()),
            Self::Varying(widths) => {
                let own = &widths[first_varying..first_varying + kind.varying_values(count)];
                Some((0..count).map(|point| kind.varying_at(own, point, count)).collect())
            }
        }
    }
}

impl Kind {
    /// Widths that run evenly from end to end of each segment, at a control point; beyond the ends they run on.
    fn varying_at(&self, ends: &[f64], point: usize, count: usize) -> f64 {
        // Where along the curve, counted in segments, the control point counts.
        let place = match (self.basis, self.wrap) {
            (StageBasis::Bezier, _) => point as f64 / 3.0,
            (StageBasis::BSpline | StageBasis::CatmullRom, Wrap::NonPeriodic) => point as f64 - 1.0,
            // Segment i of a closed B-spline or Catmull-Rom curve begins at its point i + 1.
            (StageBasis::BSpline | StageBasis::CatmullRom, Wrap::Periodic) => point as f64 - 1.0,
            (_, Wrap::Pinned) => point as f64 * (ends.len() - 1) as f64 / (count - 1) as f64,
            _ => point as f64,
        };
        if self.wrap == Wrap::Periodic {
            let n = ends.len();
            let place = place.rem_euclid(n as f64);
            let (i, share) = (place as usize % n, place.fract());
            return ends[i] + share * (ends[(i + 1) % n] - ends[i]);
        }
        if ends.len() < 2 {
            return ends[0];
        }
        let i = (place.max(0.0) as usize).min(ends.len() - 2);
        ends[i] + (place - i as f64) * (ends[i + 1] - ends[i])
    }
}
