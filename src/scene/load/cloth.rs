//! `[[fabric]]`: curves from a file or a generator, and the yarn they are of.

use std::{
    collections::HashSet,
    f64::consts::TAU,
    path::{Path, PathBuf},
};

use glam::{DAffine3, DMat3, DVec3};

use super::{
    super::{Fabric, Thread, Yarn, transform_curves},
    Context, Range, Reader, UNITS, placement, radians,
    yarns::Library,
};
use crate::{
    geometry::{
        curve::{Basis, Curve},
        curve_file::{self, ReadOptions},
        generate::{Stockinette, straight},
    },
    math::sampler::Stream,
    scene::diagnostic::{Span, unknown_name},
};

/// Radius, millimetres, of a fibre whose file and fabric give none: that of fine wool and of cotton.
const FIBER_RADIUS: f64 = 0.01;

/// How finely curves are resampled, for all fabrics.
pub(super) struct Detail {
    /// `None` for that of each file: exact, where points are kept.
    basis: Option<Basis>,
    tolerance: f64,
    longest_segment: f64,
}

impl Detail {
    pub(super) fn read(table: Option<&Reader<'_>>) -> Self {
        let bases = [("auto", None), ("catmull-rom", Some(Basis::CatmullRom)), ("b-spline", Some(Basis::BSpline))];
        let basis = table.and_then(|t| t.one_of_or("curve_basis", None, &bases));
        let tolerance = table.map_or(0.005, |t| t.f64_or("curve_tolerance", 0.005, Range::between(0.0, 1.0)));
        let longest_segment = table.map_or(3.0, |t| t.f64_or("longest_segment", 3.0, Range::above(0.0)));
        Self { basis, tolerance, longest_segment }
    }
}

enum Source {
    File { path: PathBuf, span: Span, unit: Option<f64>, options: ReadOptions, up: Up },
    Stockinette(Stockinette),
    Straight { count: u32, length: f64, spacing: f64 },
}

#[derive(Clone, Copy, PartialEq)]
enum Up {
    /// As the file says; y if it does not.
    Auto,
    Y,
    Z,
}

/// What the curves of a fabric are, by name.
enum ThreadName {
    Yarn(String),
    Fiber(String),
}

impl ThreadName {
    fn into_name(self) -> String {
        match self {
            Self::Yarn(name) | Self::Fiber(name) => name,
        }
    }
}

/// A fabric whose text is sound and whose curves are not read yet.
pub(super) struct FabricPlan {
    name: Option<String>,
    thread: ThreadName,
    radius: Option<f64>,
    phases: Option<Vec<f64>>,
    seed: u32,
    transform: DAffine3,
    source: Source,
}

/// Reads one `[[fabric]]`; `curves` takes the place of the fabric's file or generator.
pub(super) fn plan(
    table: Reader<'_>,
    context: &Context<'_>,
    library: &Library,
    curves: Option<&Path>,
) -> Option<FabricPlan> {
    let fiber = table.string("fiber").map(str::to_owned);
    let yarn = if fiber.is_some() { table.string("yarn") } else { table.required_string("yarn") }.map(str::to_owned);
    for (key, name, names) in [("yarn", &yarn, &library.yarn_names), ("fiber", &fiber, &library.fiber_names)] {
        if let Some(name) = name
            && !names.contains(name)
        {
            let (message, hint) = unknown_name(key, name, names.iter().map(String::as_str));
            table.error_at(key, message, Some(&hint));
        }
    }
    if yarn.is_some() && fiber.is_some() {
        let hint = "`yarn` if its curves are yarns, `fiber` if each is a single fibre";
        table.error_at("fiber", "give `yarn` or `fiber`, not both", Some(hint));
    }
    let name = table.string("name").map(str::to_owned);
    if name.as_ref().is_some_and(|n| n.trim().is_empty()) {
        table.error_at("name", "the name of a fabric cannot be empty", None);
    }
    let radius = table.f64("radius", Range::POSITIVE).map(|r| r * context.unit);
    let seed = table.u64_or("seed", 0, 0..=u64::from(u32::MAX)) as u32;
    let phases = table.numbers("phase", Range::FINITE).map(|p| p.into_iter().map(radians).collect());
    let transform = placement(&table, context);
    let source = match table.table("source") {
        Some(source_table) => source(source_table, context, yarn.as_ref().and_then(|y| library.yarns.get(y)), curves),
        None if curves.is_some() => curves.map(|path| file_source(path.to_owned(), table.header(), None, None)),
        None => {
            table.error(
                "missing table `source`: where the curves come from",
                Some("source = { type = \"stockinette\" } or { type = \"file\", path = \"glove.bcc\" }"),
            );
            None
        }
    };
    table.finish();
    let thread = fiber.map(ThreadName::Fiber).or(yarn.map(ThreadName::Yarn))?;
    Some(FabricPlan { name, thread, radius, phases, seed, transform, source: source? })
}

fn file_source(path: PathBuf, span: Span, unit: Option<f64>, table: Option<&Reader<'_>>) -> Source {
    let mut options = ReadOptions::default();
    let mut up = Up::Auto;
    if let Some(table) = table {
        let bases = [("catmull-rom", Basis::CatmullRom), ("b-spline", Basis::BSpline)];
        options.basis = table.one_of("basis", &bases);
        up = table.one_of_or("up", Up::Auto, &[("auto", Up::Auto), ("y", Up::Y), ("z", Up::Z)]);
        if let Some(tile) = table.numbers("tile", Range::between(1.0, 100_000.0)) {
            match tile.as_slice() {
                &[x, y] if x.fract() == 0.0 && y.fract() == 0.0 => options.tile = [x as u32, y as u32],
                _ => table.error_at(
                    "tile",
                    "expected two whole numbers",
                    Some("tile = [8, 12] repeats a pattern 8 times across and 12 times up"),
                ),
            }
        }
    }
    Source::File { path, span, unit, options, up }
}

fn source(table: Reader<'_>, context: &Context<'_>, yarn: Option<&Yarn>, curves: Option<&Path>) -> Option<Source> {
    let kinds = [("file", 0), ("stockinette", 1), ("straight", 2)];
    let kind = table.required_one_of("type", &kinds);
    let header = table.header();
    let made = match kind {
        Some(0) => {
            let unit = table.one_of("unit", &UNITS);
            let named = table.string("path");
            let path = match (curves, named) {
                (Some(path), _) => Some(path.to_owned()),
                (None, Some(name)) => Some(context.resolve(name, table.span("path").unwrap_or(table.header()))),
                (None, None) => {
                    table.error(
                        "this fabric has no curve file of its own",
                        Some("give one with --curves FILE, or add `path = \"FILE\"`"),
                    );
                    None
                }
            };
            let span = if curves.is_some() { table.header() } else { table.span("path").unwrap_or(table.header()) };
            // Read all keys in any case, so that each is known.
            let source = file_source(path.clone().unwrap_or_default(), span, unit, Some(&table));
            path.map(|_| source)
        }
        Some(1) => {
            let s = Stockinette {
                stitches: table.u64_or("stitches", 20, 1..=10_000) as u32,
                rows: table.u64_or("rows", 20, 1..=10_000) as u32,
                width: table.f64_or("stitch_width", Stockinette::WIDTH, Range::between(1.0, 100.0)),
                height: table.f64_or("row_height", Stockinette::HEIGHT, Range::between(0.1, 100.0)),
                points: table.u64_or("points", 32, 8..=1000) as u32,
            };
            if u64::from(s.stitches) * u64::from(s.rows) * u64::from(s.points) > 1 << 26 {
                table.error_at("stitches", "more than 2^26 control points", Some("fewer stitches, rows or points"));
            }
            Some(Source::Stockinette(s))
        }
        Some(2) => Some(Source::Straight {
            count: table.u64_or("count", 1, 1..=1_000_000) as u32,
            length: table.f64_or("length", 10.0, Range::POSITIVE) * context.unit,
            spacing: table
                .f64("spacing", Range::POSITIVE)
                .map_or(yarn.map_or(1.0, |y| 2.0 * y.radius), |s| s * context.unit),
        }),
        _ => None,
    };
    if let (Some(path), Some(1 | 2)) = (curves, kind) {
        table.finish();
        return Some(file_source(path.to_owned(), header, None, None));
    }
    table.finish();
    made
}

impl FabricPlan {
    /// Reads or makes the curves.
    pub(super) fn make(
        self,
        index: usize,
        context: &Context<'_>,
        library: &Library,
        detail: &Detail,
        warnings: &mut Vec<String>,
    ) -> Option<Fabric> {
        let (thread, own_radius) = match &self.thread {
            ThreadName::Yarn(name) => {
                let place = library.yarns.keys().position(|n| n == name)?;
                (Thread::Yarn(place), library.yarns[name].radius)
            }
            ThreadName::Fiber(name) => (Thread::Fiber(library.fibers.keys().position(|n| n == name)?), FIBER_RADIUS),
        };
        let radius = self.radius.unwrap_or(own_radius);
        let with_radii = |curves: Vec<Curve>, own: bool, scale: f64| -> Vec<(Curve, Vec<f64>)> {
            curves
                .into_iter()
                .map(|mut curve| {
                    let radii = curve.radii.take().filter(|_| own && self.radius.is_none());
                    let radii = radii
                        .map_or_else(|| vec![radius; curve.points.len()], |r| r.iter().map(|r| r * scale).collect());
                    (curve, radii)
                })
                .collect()
        };
        let (origin, mut curves) = match self.source {
            Source::Stockinette(s) => {
                (format!("stockinette, {} x {}", s.stitches, s.rows), with_radii(s.curves(2.0 * radius), false, 1.0))
            }
            Source::Straight { count, length, spacing } => {
                (format!("{count} straight"), with_radii(straight(count, length, spacing), false, 1.0))
            }
            Source::File { path, span, unit, options, up } => {
                let set = match curve_file::read(&path, &options) {
                    Ok(set) => set,
                    Err(error) => {
                        context.error(span, error.to_string(), None);
                        return None;
                    }
                };
                warnings.extend(set.notes.iter().map(|note| format!("{}: {note}", path.display())));
                let scale = unit.or(set.unit_mm).unwrap_or(context.unit);
                let mut curves = with_radii(set.curves, true, scale);
                // Radii are in millimetres already; the transform below would scale them with the points.
                for (curve, _) in &mut curves {
                    for p in &mut curve.points {
                        *p *= scale;
                    }
                }
                if up == Up::Z || (up == Up::Auto && set.up_axis == Some(2)) {
                    // z up becomes y up: a quarter turn about x.
                    let turn = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
                    transform_curves(&mut curves, &DAffine3::from_mat3(turn));
                }
                (path.display().to_string(), curves)
            }
        };
        transform_curves(&mut curves, &self.transform);
        let phases = self.phases.unwrap_or_else(|| {
            let mut stream = Stream::new(self.seed ^ (index as u32).wrapping_mul(0x9e37_79b9));
            curves.iter().map(|_| TAU * f64::from(stream.next())).collect()
        });
        let of_file = match curves.first().map(|(curve, _)| curve.basis) {
            Some(Basis::BSpline) => Basis::BSpline,
            _ => Basis::CatmullRom,
        };
        Some(Fabric {
            name: self.name.unwrap_or_else(|| self.thread.into_name()),
            origin,
            thread,
            curves,
            phases,
            seed: self.seed,
            basis: detail.basis.unwrap_or(of_file),
            tolerance: detail.tolerance,
            longest_segment: detail.longest_segment,
        })
    }
}

/// Numbers the fabrics whose name another one before them has.
pub(super) fn tell_names_apart(fabrics: &mut [Fabric]) {
    let mut taken: HashSet<String> = HashSet::new();
    for fabric in fabrics {
        let given = fabric.name.clone();
        let mut number = 1;
        while !taken.insert(fabric.name.clone()) {
            number += 1;
            fabric.name = format!("{given}_{number}");
        }
    }
}
