//! Curves as a USD layer: one `BasisCurves` prim for each group, binary or text by the name of the file.

use std::{
    io::{self, Cursor},
    path::Path,
};

use glam::{DVec2, DVec3};
use openusd::{
    gf::{Vec2f, Vec3f},
    sdf::{self, ChildrenKey, FieldKey, SpecType, Specifier, Value, Variability},
    usda, usdc,
};

use super::children;
use crate::{
    files::extension,
    geometry::curve::{Basis, Curve, equal_radii},
};

/// Values of a primvar beside curves.
#[derive(Clone, Debug, PartialEq)]
pub enum Interpolated {
    /// An integer for each curve, such as the yarn that a ply belongs to.
    Id(Vec<i32>),
    /// A colour for each curve, linear Rec.709.
    Color(Vec<[f32; 3]>),
    /// A pair for each curve, such as its place in the cloth.
    Pair(Vec<DVec2>),
}

/// Curves of one prim; all open or all closed, of one basis.
#[derive(Clone, Debug, PartialEq)]
pub struct CurvesOut<'a> {
    /// Name of the prim: letters, digits and `_`.
    pub name: String,
    /// The curves, in the unit of the layer.
    pub curves: Vec<&'a Curve>,
    /// Radius of those that have none of their own.
    pub radius: f64,
    /// Primvars by name, `displayColor` among them.
    pub primvars: Vec<(String, Interpolated)>,
}

/// Writes a layer whose unit is `unit_mm` millimetres, +y up, with all prims below `/cloth`. Widths are constant where
/// all radii are one, else varying (one for each end of a segment), which renderers take that refuse vertex widths; but
/// vertex where usd-core counts ends otherwise than renderers, of linear and of pinned curves. Open Catmull-Rom curves are
/// `pinned`, as they reach their ends; B-splines are `nonperiodic`.
///
/// # Errors
/// The extension is not `.usda`, `.usdc` or `.usd`, a curve has too few points for its basis, or writing failed.
pub fn write(path: &Path, unit_mm: f64, groups: &[CurvesOut<'_>], out: &mut impl io::Write) -> io::Result<()> {
    let text = match extension(path).as_deref() {
        Some("usda") => true,
        Some("usdc" | "usd") => false,
        _ => return Err(invalid("a USD file that is written ends in .usda, .usdc or .usd")),
    };
    let data = layer(unit_mm, groups).map_err(|e| invalid(&format!("{e:#}")))?;
    if text {
        let text = usda::TextWriter::write_to_string(&data).map_err(|e| invalid(&format!("{e:#}")))?;
        out.write_all(text.as_bytes())
    } else {
        let mut bytes = Cursor::new(Vec::new());
        usdc::CrateWriter::write(&data, &mut bytes).map_err(|e| invalid(&format!("{e:#}")))?;
        out.write_all(&children::as_usd_core_writes(bytes.get_ref())?)
    }
}

fn invalid(problem: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, problem)
}

const ROOT: &str = "cloth";

fn layer(unit_mm: f64, groups: &[CurvesOut<'_>]) -> anyhow::Result<sdf::Data> {
    let mut data = sdf::Data::new();
    let top = data.create_spec(sdf::Path::abs_root(), SpecType::PseudoRoot);
    top.add(ChildrenKey::PrimChildren, Value::TokenVec(vec![ROOT.into()]));
    top.add(FieldKey::DefaultPrim, Value::Token(ROOT.into()));
    top.add("metersPerUnit", Value::Double(unit_mm / 1000.0));
    top.add("upAxis", Value::Token("Y".into()));
    let root = sdf::path(format!("/{ROOT}"))?;
    let spec = data.create_spec(root.clone(), SpecType::Prim);
    spec.add(FieldKey::Specifier, Value::Specifier(Specifier::Def));
    spec.add(FieldKey::TypeName, Value::Token("Xform".into()));
    spec.add(ChildrenKey::PrimChildren, Value::TokenVec(groups.iter().map(|g| g.name.as_str().into()).collect()));
    for group in groups {
        add_curves(&mut data, &root.append_path(group.name.as_str())?, group)?;
    }
    Ok(data)
}

/// What a curve looks like in USD.
#[derive(Clone, Copy, PartialEq)]
struct Shape {
    basis: Option<&'static str>,
    wrap: &'static str,
}

fn shape(curve: &Curve) -> anyhow::Result<Shape> {
    let fewest = if curve.closed {
        3
    } else if curve.basis == Basis::BSpline {
        4
    } else {
        2
    };
    let n = curve.points.len();
    anyhow::ensure!(n >= fewest, "a curve has {n} points, USD needs at least {fewest} here");
    Ok(match (curve.basis, curve.closed) {
        (Basis::Linear, closed) => Shape { basis: None, wrap: if closed { "periodic" } else { "nonperiodic" } },
        (Basis::BSpline, closed) => {
            Shape { basis: Some("bspline"), wrap: if closed { "periodic" } else { "nonperiodic" } }
        }
        (Basis::CatmullRom, closed) => {
            Shape { basis: Some("catmullRom"), wrap: if closed { "periodic" } else { "pinned" } }
        }
    })
}

/// Radii at the ends of segments, for varying widths.
fn at_ends(curve: &Curve, radius: f64) -> Vec<f64> {
    let n = curve.points.len();
    let Some(radii) = &curve.radii else {
        let ends = if curve.basis == Basis::BSpline && !curve.closed { n - 2 } else { n };
        return vec![radius; ends];
    };
    // A B-spline's value at a knot is the mean of three of its points' values, 1 : 4 : 1.
    let knot = |i: usize| (radii[(i + n - 1) % n] + 4.0 * radii[i % n] + radii[(i + 1) % n]) / 6.0;
    match (curve.basis, curve.closed) {
        (Basis::BSpline, false) => (1..n - 1).map(knot).collect(),
        // Segment i of a closed B-spline or Catmull-Rom curve begins at its point i + 1.
        (Basis::BSpline, true) => (0..n).map(|i| knot(i + 1)).collect(),
        (Basis::CatmullRom, true) => (0..n).map(|i| radii[(i + 1) % n]).collect(),
        _ => radii.clone(),
    }
}

fn add_curves(data: &mut sdf::Data, path: &sdf::Path, group: &CurvesOut<'_>) -> anyhow::Result<()> {
    let shapes = group.curves.iter().map(|c| shape(c)).collect::<anyhow::Result<Vec<Shape>>>()?;
    let kind = shapes.first().copied().unwrap_or(Shape { basis: Some("bspline"), wrap: "nonperiodic" });
    anyhow::ensure!(shapes.iter().all(|s| *s == kind), "curves of one prim have one basis and one kind of ends");
    let counts = group.curves.iter().map(|c| c.points.len() as i32).collect();
    let narrow = |p: DVec3| Vec3f { x: p.x as f32, y: p.y as f32, z: p.z as f32 };
    let points: Vec<Vec3f> = group.curves.iter().flat_map(|c| c.points.iter().map(|p| narrow(*p))).collect();
    let ends: Vec<f64> = group.curves.iter().flat_map(|c| at_ends(c, group.radius)).collect();
    let constant = ends.iter().all(|r| equal_radii(*r, ends[0]));
    let widths: Vec<f32> = ends.iter().take(if constant { 1 } else { ends.len() }).map(|r| 2.0 * *r as f32).collect();
    let widest = ends.iter().fold(0.0, |a: f64, &b| a.max(b));

    let mut attributes: Vec<(String, &str, Value, bool, Option<&str>)> = vec![
        (
            "type".into(),
            "token",
            Value::Token(if kind.basis.is_some() { "cubic" } else { "linear" }.into()),
            true,
            None,
        ),
        ("wrap".into(), "token", Value::Token(kind.wrap.into()), true, None),
        ("curveVertexCounts".into(), "int[]", Value::IntVec(counts), false, None),
        ("points".into(), "point3f[]", Value::Vec3fVec(points), false, None),
        (
            "widths".into(),
            "float[]",
            Value::FloatVec(widths),
            false,
            Some(if constant {
                "constant"
            } else if kind.basis.is_none() || kind.wrap == "pinned" {
                "vertex"
            } else {
                "varying"
            }),
        ),
    ];
    if let Some(basis) = kind.basis {
        attributes.push(("basis".into(), "token", Value::Token(basis.into()), true, None));
    }
    if let Some((low, high)) = bounds(&group.curves) {
        let around = vec![narrow(low - DVec3::splat(widest)), narrow(high + DVec3::splat(widest))];
        attributes.push(("extent".into(), "float3[]", Value::Vec3fVec(around), false, None));
    }
    for (name, values) in &group.primvars {
        let (kind, value) = match values {
            Interpolated::Id(ids) => ("int[]", Value::IntVec(ids.clone())),
            Interpolated::Color(colors) => {
                let colors = colors.iter().map(|c| Vec3f { x: c[0], y: c[1], z: c[2] });
                ("color3f[]", Value::Vec3fVec(colors.collect()))
            }
            Interpolated::Pair(pairs) => {
                let pairs = pairs.iter().map(|p| Vec2f { x: p.x as f32, y: p.y as f32 });
                ("float2[]", Value::Vec2fVec(pairs.collect()))
            }
        };
        attributes.push((format!("primvars:{name}"), kind, value, false, Some("uniform")));
    }

    let spec = data.create_spec(path.clone(), SpecType::Prim);
    spec.add(FieldKey::Specifier, Value::Specifier(Specifier::Def));
    spec.add(FieldKey::TypeName, Value::Token("BasisCurves".into()));
    let names = attributes.iter().map(|(name, ..)| name.as_str().into()).collect();
    spec.add(ChildrenKey::PropertyChildren, Value::TokenVec(names));
    for (name, kind, value, uniform, interpolation) in attributes {
        let spec = data.create_spec(path.append_property(name.as_str())?, SpecType::Attribute);
        spec.add(FieldKey::TypeName, Value::Token(kind.into()));
        if uniform {
            spec.add(FieldKey::Variability, Value::Variability(Variability::Uniform));
        }
        if let Some(interpolation) = interpolation {
            spec.add("interpolation", Value::Token(interpolation.into()));
        }
        spec.add(FieldKey::Default, value);
    }
    Ok(())
}

fn bounds(curves: &[&Curve]) -> Option<(DVec3, DVec3)> {
    let points = curves.iter().flat_map(|c| &c.points);
    points.map(|&p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}
