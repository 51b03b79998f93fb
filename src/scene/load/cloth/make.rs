//! Reading and making the curves of a fabric.

use std::{f64::consts::TAU, path::Path};

use glam::DAffine3;
use rayon::prelude::*;

use super::{
    super::{
        Context, Y_UP,
        color::{ColorPlan, FabricCoordinates},
        dyes::Dyes,
        pattern::KnitPlan,
        sequence,
        weave::{WeavePlan, Woven},
        yarns::Library,
    },
    CurveFile, Detail, FabricKeys, FabricPlan, KindName, Source, Up,
};
use crate::{
    files::{
        curve_file::{self, CurveFileError, ReadOptions},
        has_extension, stage,
    },
    geometry::curve::{Basis, Curve, CurveSet},
    math::sampler::Stream,
    pattern::straight,
    scene::{CurveKind, Fabric, FabricMotion, GarmentFacts, Taken, Tufts, defaults, transform_curves},
};

/// Columns that a yarn counts where nothing is known of its cloth.
const COLUMNS: f32 = 256.0;

/// Curves of one kind of yarn, before they are moved to their place.
struct Made {
    origin: String,
    /// What mattes call it, if not as the fabric.
    name: Option<String>,
    /// The first yarn of each panel of a garment, and its name.
    panels: Vec<(usize, String)>,
    from_file: bool,
    kind: CurveKind,
    /// Its cut tufts.
    tufts: Tufts,
    curves: Vec<(Curve, Vec<f64>)>,
    /// What is known of curves that are not made.
    taken: Taken,
    /// Where their points are in the cloth, if that is known.
    coordinates: Option<FabricCoordinates>,
    /// Their colours, if they are not the fabric's.
    color: Option<ColorPlan>,
    /// Colours that came with them.
    dyes: Option<Dyes>,
    motion: FabricMotion,
    /// Whether there are no more points than are needed.
    exact: bool,
}

impl Made {
    fn new(
        origin: String,
        kind: CurveKind,
        curves: Vec<(Curve, Vec<f64>)>,
        coordinates: Option<FabricCoordinates>,
    ) -> Self {
        Self {
            origin,
            name: None,
            panels: Vec::new(),
            from_file: false,
            kind,
            tufts: Tufts::default(),
            curves,
            taken: Taken::default(),
            coordinates,
            color: None,
            dyes: None,
            motion: FabricMotion::default(),
            exact: false,
        }
    }
}

impl FabricPlan {
    /// Reads or makes the curves: one fabric for each kind of yarn.
    pub(in crate::scene::load) fn make(
        self,
        index: usize,
        context: &Context<'_>,
        library: &Library,
        detail: &Detail,
        warnings: &mut Vec<String>,
        garments: &mut Vec<GarmentFacts>,
    ) -> Option<Vec<Fabric>> {
        let Self { keys, source } = self;
        let base = Base::new(&keys, context, library)?;
        let made = match source {
            Source::Garment(plan) => {
                let yarn = (keys.kind.name(), base.radius);
                let (panels, facts) = plan.make(yarn, &keys.color, context, library, detail, warnings)?;
                garments.push(facts);
                panels
                    .into_iter()
                    .map(|panel| {
                        let kind = base.named_or_own(panel.yarn.as_deref())?;
                        let made = Made::new(panel.origin, kind, panel.curves, Some(panel.coordinates));
                        let (color, motion, panels) = (panel.color, panel.motion, panel.panels);
                        Some(Made { name: panel.name, color, motion, panels, taken: panel.taken, exact: true, ..made })
                    })
                    .collect::<Option<Vec<Made>>>()?
            }
            Source::Knit(plan) => vec![base.knit(plan, &keys.color, warnings)?],
            Source::Weave(plan) => base.weave(&plan, warnings)?,
            Source::Straight { count, length, spacing } => {
                let curves = with_radius(straight(count, length, spacing), base.radius);
                vec![Made::new(format!("{count} straight"), base.kind, curves, None)]
            }
            Source::File(file) => vec![base.file(&file, keys.radius.is_none(), detail, warnings)?],
        };
        let mut stream = Stream::new(keys.seed ^ (index as u32).wrapping_mul(0x9e37_79b9));
        made.into_iter().map(|made| made.into_fabric(&keys, &mut stream, detail, context, library)).collect()
    }
}

/// What the curves of a fabric are where nothing else is said.
struct Base<'a> {
    kind: CurveKind,
    /// Where curves have none of their own, millimetres.
    radius: f64,
    context: &'a Context<'a>,
    library: &'a Library,
}

impl<'a> Base<'a> {
    fn new(keys: &FabricKeys, context: &'a Context<'a>, library: &'a Library) -> Option<Self> {
        let (kind, own_radius) = match &keys.kind {
            KindName::Yarn(name) => (place_of(name, library)?, library.yarns[name].radius),
            KindName::Fiber(name) => {
                (CurveKind::Fiber(library.fibers.keys().position(|n| n == name)?), defaults::FIBER_RADIUS)
            }
        };
        Some(Self { kind, radius: keys.radius.unwrap_or(own_radius), context, library })
    }

    fn named_or_own(&self, yarn: Option<&str>) -> Option<CurveKind> {
        yarn.map_or(Some(self.kind), |name| place_of(name, self.library))
    }

    fn knit(&self, plan: KnitPlan, color: &ColorPlan, warnings: &mut Vec<String>) -> Option<Made> {
        let Self { kind, radius, context, library } = *self;
        let plan = plan.sized(context, warnings)?;
        let colors = match kind {
            CurveKind::Yarn(base) if !color.is_plain() => {
                let round = plan.is_round();
                let of_rows = |widths: &[u32]| color.stitches((widths, round), base, context, library);
                plan.colors(context, &of_rows, warnings)?
            }
            _ => Default::default(),
        };
        let (curves, coordinates, origin) = plan.curves(colors, context)?;
        let curves = with_radius(curves, radius);
        plan.warn_of_overlap(&curves, warnings);
        Some(Made::new(origin, kind, curves, Some(coordinates)))
    }

    /// Warp and weft: apart if they are of different yarns.
    fn weave(&self, plan: &WeavePlan, warnings: &mut Vec<String>) -> Option<Vec<Made>> {
        let Woven { origin, sides, tufts: [warp_tufts, weft_tufts] } = plan.make(self.context, warnings)?;
        let [(warps, mut coordinates), (wefts, weft_coordinates)] = sides;
        let weft = self.named_or_own(plan.weft_yarn.as_deref())?;
        let [warp_radius, weft_radius] = plan.radii();
        let (mut warps, wefts) = (with_radius(warps, warp_radius), with_radius(wefts, weft_radius));
        let dyes = || Dyes::of_threads(&plan.colors);
        if weft == self.kind {
            let tufts = warp_tufts.followed(warps.len(), &weft_tufts);
            warps.extend(wefts);
            coordinates.join(weft_coordinates);
            return Some(vec![Made { tufts, dyes: dyes(), ..Made::new(origin, self.kind, warps, Some(coordinates)) }]);
        }
        let warp = Made::new(format!("warp of {origin}"), self.kind, warps, Some(coordinates));
        let weft = Made::new(format!("weft of {origin}"), weft, wefts, Some(weft_coordinates));
        Some(vec![Made { tufts: warp_tufts, dyes: dyes(), ..warp }, Made { tufts: weft_tufts, dyes: dyes(), ..weft }])
    }

    /// The curves of a file, with radii of their own if they may keep them.
    fn file(&self, file: &CurveFile, keep_radii: bool, detail: &Detail, warnings: &mut Vec<String>) -> Option<Made> {
        let Self { kind, radius, context, .. } = *self;
        let mut colors = None;
        let mut read = |path: &Path, frame: Option<f64>| {
            let (mut set, scale) = file.read(path, frame, context, warnings)?;
            colors.get_or_insert_with(|| std::mem::take(&mut set.colors));
            let own_radii = |mut curve: Curve| {
                let given = curve.radii.take().filter(|_| keep_radii);
                let radii =
                    given.map_or_else(|| vec![radius; curve.points.len()], |r| r.iter().map(|r| r * scale).collect());
                (curve, radii)
            };
            let mut curves: Vec<(Curve, Vec<f64>)> = set.curves.into_iter().map(own_radii).collect();
            if file.up == Up::Z || (file.up == Up::Auto && set.up_axis == Some(2)) {
                transform_curves(&mut curves, &DAffine3::from_mat3(Y_UP));
            }
            Some(curves)
        };
        let (path, curves, motion) = sequence::read(file, detail, context, &mut read)?;
        let dyes = colors.filter(|_| file.colors).map(|colors| Dyes::of_curves(&colors));
        if let Some(None) = dyes {
            warnings.push(format!("{}: `colors` is asked for, but no curve has one", path.display()));
        }
        let made = Made::new(path.display().to_string(), kind, curves, None);
        Some(Made { from_file: true, motion, dyes: dyes.flatten(), ..made })
    }
}

/// Where a yarn stands among the scene's.
fn place_of(yarn: &str, library: &Library) -> Option<CurveKind> {
    library.yarns.keys().position(|n| n == yarn).map(CurveKind::Yarn)
}

/// Curves with their own radii, or with this one.
fn with_radius(curves: Vec<Curve>, radius: f64) -> Vec<(Curve, Vec<f64>)> {
    let with = |mut curve: Curve| {
        let radii = curve.radii.take().unwrap_or_else(|| vec![radius; curve.points.len()]);
        (curve, radii)
    };
    curves.into_iter().map(with).collect()
}

impl Made {
    /// The fabric, moved to its place, with its colours; `stream` gives phases where the scene says none.
    fn into_fabric(
        self,
        keys: &FabricKeys,
        stream: &mut Stream,
        detail: &Detail,
        context: &Context<'_>,
        library: &Library,
    ) -> Option<Fabric> {
        let Self {
            origin,
            name,
            panels,
            from_file,
            kind,
            tufts,
            curves,
            taken,
            coordinates,
            color,
            dyes,
            motion,
            exact,
        } = self;
        let name = name.or_else(|| keys.name.clone());
        let random = || curves.iter().map(|_| TAU * f64::from(stream.next())).collect();
        let phases = keys.phases.clone().unwrap_or_else(random);
        let of_file = match curves.first().map(|(curve, _)| curve.basis) {
            // Only made cloth has none yet.
            Some(Basis::BSpline) | None => Basis::BSpline,
            _ => Basis::CatmullRom,
        };
        let mut fabric = Fabric {
            named: name.is_some(),
            name: name.unwrap_or_else(|| keys.kind.name().to_owned()),
            origin,
            panels,
            from_file,
            kind,
            tufts,
            curves,
            motion,
            variants: Vec::new(),
            material_indices: Vec::new(),
            printed: false,
            uvs: Vec::new(),
            taken,
            phases,
            shows_fibers: false,
            seed: keys.seed,
            basis: detail.basis.unwrap_or(of_file),
            tolerance: if exact { 0.0 } else { detail.tolerance },
            longest_segment: detail.longest_segment,
        };
        fabric.transform(&keys.transform);
        let coordinates = match detail.uv {
            false => coordinates,
            true => {
                let places = coordinates.unwrap_or_else(|| FabricCoordinates::along(COLUMNS, &fabric));
                fabric.uvs = places.uvs(&fabric);
                Some(places)
            }
        };
        color.as_ref().unwrap_or(&keys.color).apply(
            &mut fabric,
            dyes.as_ref(),
            |f| coordinates.unwrap_or_else(|| FabricCoordinates::along(COLUMNS, f)),
            context,
            library,
        )?;
        Some(fabric)
    }
}

impl CurveFile {
    /// Reads one file; points become millimetres. Gives the scale, by which radii have not been multiplied yet.
    fn read(
        &self,
        path: &Path,
        frame: Option<f64>,
        context: &Context<'_>,
        warnings: &mut Vec<String>,
    ) -> Option<(CurveSet, f64)> {
        let options = ReadOptions { frame, ..self.options.clone() };
        let read = if stage::is_stage(path) && path.is_file() {
            let open = context.stages.open(path).map_err(CurveFileError::from);
            open.and_then(|stage| curve_file::read_stage(&stage, &options))
        } else {
            curve_file::read(path, &options)
        };
        let mut set = match read {
            Ok(set) => set,
            Err(error) => {
                context.error(self.span, error.to_string(), None);
                return None;
            }
        };
        if set.curves.is_empty() {
            let is_obj = has_extension(path, "obj");
            let hint =
                is_obj.then(|| "curves of an OBJ file are its lines (`l`); its triangles go into a [[mesh]]".into());
            context.error(self.span, format!("{}: it holds no curve that can be drawn", path.display()), hint);
            return None;
        }
        let mut note = |text: String| {
            // Of a stage that is read at several times, once.
            if !warnings.contains(&text) {
                warnings.push(text);
            }
        };
        set.notes.iter().for_each(|text| note(format!("{}: {text}", path.display())));
        let scale = context.unit_of((path, self.span), set.unit_mm, self.unit).unwrap_or(context.unit);
        set.curves.par_iter_mut().for_each(|c| c.points.iter_mut().for_each(|p| *p *= scale));
        Some((set, scale))
    }
}
