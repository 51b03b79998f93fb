//! Curves of an archive, with the colours and numbers that programs give them.

use glam::DVec3;

use super::{Archive, Object, property::Compound, spread_of, vectors};
use crate::files::stage::{
    Problem,
    curves::{Batch, ID_NAMES, PLY_NAMES, Spread, StageBasis, Wrap},
    polygons::AtCorners,
};

/// Colours of curves by the names that programs give them; the first that an object has counts.
const COLOR_NAMES: [&str; 4] = ["displayColor", "Cs", "Cd", "rgb"];

/// Values of curves beside their points, as `Batch` has them.
#[derive(Default)]
struct Labels {
    colors: Option<(Vec<DVec3>, Spread)>,
    ids: Option<(Vec<i64>, Spread)>,
    plies: Option<(Vec<i64>, Spread)>,
}

/// The numbers of a parameter, how many of them make a value, and how values are spread.
type Found = Option<(Vec<f64>, usize, Spread)>;

impl Archive {
    pub(super) fn batch(&self, object: &Object<'_>, time: Option<f64>) -> Result<Option<Batch>, Problem> {
        let Some(geometry) = self.geometry(object)? else { return Ok(None) };
        let numbers = |name: &str| self.numbers(&geometry, name, time);
        let points = numbers("P")?.unwrap_or_default();
        let counts = geometry.at("nVertices", time, &self.samplings)?;
        let counts = counts.map_or(Ok(Vec::new()), |around| around.before.integers("nVertices"))?;
        let kind = numbers("curveBasisAndType")?.unwrap_or_default();
        let code = |i: usize| kind.get(i).map_or(0, |&x| x as i64);
        let basis = match (code(0), code(2)) {
            (1, _) => StageBasis::Linear,
            (0, 1) => StageBasis::Bezier,
            (0, 2) => StageBasis::BSpline,
            (0, 3) => StageBasis::CatmullRom,
            (0, other) => return Err(Problem::unknown(format!("cubic curves of basis {other} are not read"))),
            (other, _) => {
                return Err(Problem::unknown(format!("curves of type {other} are not read; linear and cubic are")));
            }
        };
        let wrap = if code(1) == 1 { Wrap::Periodic } else { Wrap::NonPeriodic };
        let widths = self.values(&geometry, "width", 1, time)?.map(|values| {
            // Some programs do not say how they are spread: then their number does.
            let by_number = match values.len() {
                1 => Spread::Constant,
                n if 3 * n == points.len() => Spread::Vertex,
                n if n == counts.len() => Spread::Uniform,
                _ => Spread::Varying,
            };
            (values, spread_of(geometry.metadata("width"), by_number))
        });
        let Labels { colors, ids, plies } = self.labels(&geometry, time)?;
        Ok(Some(Batch { basis, wrap, counts, points: vectors(&points, "P")?, widths, colors, ids, plies }))
    }

    /// What programs add of their own.
    fn labels(&self, geometry: &Compound<'_>, time: Option<f64>) -> Result<Labels, Problem> {
        let Some(more) = geometry.compound(".arbGeomParams", &self.metadata)? else { return Ok(Labels::default()) };
        let find = |names: &[&str], extents: &[usize]| -> Result<Found, Problem> {
            for name in names {
                let extent = self.extent(&more, name)?.filter(|e| extents.contains(e));
                let Some(extent) = extent else { continue };
                // Texts and empty lists under these names mean something else.
                if let Ok(Some(values)) = self.values(&more, name, extent, time) {
                    return Ok(Some((values, extent, spread_of(more.metadata(name), Spread::Constant))));
                }
            }
            Ok(None)
        };
        let numbers = |found: Found| {
            found.map(|(values, _, spread)| (values.into_iter().map(|x| x as i64).collect::<Vec<i64>>(), spread))
        };
        let colors = find(&COLOR_NAMES, &[3, 4])?.map(|(values, extent, spread)| {
            (values.chunks_exact(extent).map(DVec3::from_slice).collect::<Vec<DVec3>>(), spread)
        });
        Ok(Labels { colors, ids: numbers(find(&ID_NAMES, &[1])?), plies: numbers(find(&PLY_NAMES, &[1])?) })
    }

    /// A parameter without its indices: `extent` numbers for each value.
    fn values(
        &self,
        own: &Compound<'_>,
        name: &str,
        extent: usize,
        time: Option<f64>,
    ) -> Result<Option<Vec<f64>>, Problem> {
        let Some(AtCorners { values, indices }) = self.indexed(own, name, time)? else { return Ok(None) };
        let Some(indices) = indices else { return Ok(Some(values)) };
        let of_index = |&i: &u32| {
            let first = i as usize * extent;
            let value = values.get(first..first + extent);
            value.ok_or_else(|| Problem::new(format!("`{name}` has index {i} of {} values", values.len() / extent)))
        };
        Ok(Some(indices.iter().map(of_index).collect::<Result<Vec<&[f64]>, Problem>>()?.concat()))
    }

    /// How many numbers one value of a parameter has, however it is kept.
    pub(super) fn extent(&self, own: &Compound<'_>, name: &str) -> Result<Option<usize>, Problem> {
        Ok(match own.compound(name, &self.metadata)? {
            Some(indexed) => indexed.extent(".vals"),
            None => own.extent(name),
        })
    }
}
