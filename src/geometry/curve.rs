//! Curves as people hand them over: control points in a basis, open or closed, with or without radii.

use glam::{DVec3, Vec3};

/// How control points make a curve. All bases are uniform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Through every point; an open curve also reaches its first and its last point.
    CatmullRom,
    /// Cubic B-spline: near its points. An open curve begins near its second point, unless points are repeated.
    BSpline,
    /// Straight from point to point.
    Linear,
}

/// One curve. Lengths are in the unit of its [`CurveSet`].
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// How `points` are meant.
    pub basis: Basis,
    /// Whether the last point is followed by the first (which is then not repeated in `points`).
    pub closed: bool,
    /// Control points; at least two, all finite.
    pub points: Vec<DVec3>,
    /// One radius for each point, where the file has them.
    pub radii: Option<Vec<f64>>,
    /// How far the section is pressed flat, where it is: one vector for each point, along the section's short axis (across
    /// the curve; either of its two directions), as long as the ratio of the short axis to the long one, in (0, 1]. The
    /// radius is then half of the long axis: a round tube of that radius bounds the yarn.
    pub flattening: Option<Vec<Vec3>>,
}

impl Curve {
    /// Length from point to point, and back to the first if the curve is closed.
    pub fn polygon_length(&self) -> f64 {
        let closing = match (self.points.first(), self.points.last()) {
            (Some(first), Some(last)) if self.closed => last.distance(*first),
            _ => 0.0,
        };
        closing + self.points.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>()
    }

    /// The radius of a curve that is equally thick everywhere, but for rounding.
    pub fn even_radius(&self) -> Option<f64> {
        let radii = self.radii.as_ref()?;
        let first = *radii.first()?;
        radii.iter().all(|r| equal_radii(*r, first)).then_some(first)
    }

    /// Gives sections that are pressed flat up for round ones of equal area, which is all that files can hold.
    pub fn make_round(&mut self) {
        if let (Some(radii), Some(axes)) = (&mut self.radii, self.flattening.take()) {
            radii.iter_mut().zip(&axes).for_each(|(r, axis)| *r *= f64::from(axis.length()).sqrt());
        }
    }
}

/// Whether two radii differ by no more than single precision loses on the way.
pub fn equal_radii(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * a.abs().max(b.abs())
}

/// The curves of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurveSet {
    /// In the file's order.
    pub curves: Vec<Curve>,
    /// Millimetres per unit of length, where the format fixes it.
    pub unit_mm: Option<f64>,
    /// Which axis of the file points up (1 = y, 2 = z), where the file says so.
    pub up_axis: Option<u8>,
    /// What was repaired on the way in, one line each, for the user to see.
    pub notes: Vec<String>,
    /// Colour of each curve, linear Rec.709, where the file has one; empty where no curve has.
    pub colors: Vec<Option<[f32; 3]>>,
    /// The number of each curve's yarn, as the file gives it; empty where it gives none.
    pub ids: Vec<Option<i64>>,
    /// Which ply of its yarn each curve is, or is a fibre of, from 0; empty where curves are yarns.
    pub plies: Vec<Option<i64>>,
}

impl CurveSet {
    /// Gives the curves from `before` on what they are labelled with; those without have none.
    pub fn add_labels<T: Clone>(
        &mut self,
        before: usize,
        own: Option<Vec<Option<T>>>,
        list: impl Fn(&mut Self) -> &mut Vec<Option<T>>,
    ) {
        let count = self.curves.len();
        if own.is_none() && list(self).is_empty() {
            return;
        }
        list(self).resize(before, None);
        list(self).extend(own.unwrap_or_default());
        list(self).resize(count, None);
    }
}
