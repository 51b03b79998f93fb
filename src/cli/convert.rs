//! `yarnray convert`: curve files from one format to another.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{
    Failure,
    curve_files::{refuse_unknown, write_curves},
    files::Files,
    level::LevelArgs,
    log, positive,
};
use crate::{
    files::{
        curve_file::{self, ReadOptions, SOME_RADIUS},
        stage::PrimPattern,
    },
    geometry::{
        curve::{Basis, CurveSet},
        proposal::UNITS,
    },
    math::words::counted,
};

const EXAMPLES: &str = "Examples:
  yarnray convert glove.bcc glove.usdc --unit cm --radius 0.08     curves for Blender, Houdini and usdview
  yarnray convert glove.bcc plies.usdc --unit cm --yarn wool --as plies

--prim '/Garment/*' takes some prims of a stage, --frame 12 one frame of it, --tile 8,12 repeats a periodic pattern.
Read: .bcc .hair .obj .pyp .yarns .smobj .txt .usd .usda .usdc .usdz .abc. Written: .bcc .hair .obj .yarns .txt .usda .usdc.
What a format cannot hold is said.";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct ConvertArgs {
    /// The curve file to read.
    input: PathBuf,
    /// Where to write; the extension names the format.
    output: PathBuf,
    /// The input's unit, where its format has none; files that have a unit say it themselves.
    #[arg(long, value_parser = UNITS.map(|(name, _)| name))]
    unit: Option<String>,
    /// The unit to write in; that of the input if not given.
    #[arg(long, value_parser = UNITS.map(|(name, _)| name))]
    to_unit: Option<String>,
    /// Which objects of a stage, such as '/Garment/*' or 'material:/Looks/Wool'.
    #[arg(long, value_name = "PATTERN", value_parser = PrimPattern::parse)]
    prim: Option<PrimPattern>,
    /// The face library (.sf) of a stitch mesh (.smobj), if it is not the file of its name.
    #[arg(long, value_name = "FILE")]
    faces: Option<PathBuf>,
    /// The frame of a stage; its first if not given.
    #[arg(long, value_name = "N")]
    frame: Option<f64>,
    /// How points are meant where the input does not say.
    #[arg(long, value_parser = ["catmull-rom", "b-spline"])]
    basis: Option<String>,
    /// How often a periodic pattern (.pyp) is repeated, across and up.
    #[arg(long, value_name = "N,M", value_parser = counts)]
    tile: Option<[u32; 2]>,
    /// Radius of curves that have none, in the input's unit.
    #[arg(long, value_name = "R", value_parser = positive)]
    radius: Option<f64>,
    #[command(flatten)]
    level: LevelArgs,
    /// Say nothing.
    #[arg(long, short)]
    quiet: bool,
}

fn counts(text: &str) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok().filter(|n| *n > 0)).collect();
    numbers.and_then(|n| n.try_into().ok()).ok_or_else(|| "expected two whole numbers, as in 8,12".to_owned())
}

/// Millimetres of a unit by its name, which clap has checked.
fn millimetres(unit: &str) -> f64 {
    UNITS.iter().find(|(name, _)| *name == unit).map_or(1.0, |(_, mm)| *mm)
}

/// What is lost on the way to a file, and what it needs and was not given, one line each.
fn losses(path: &Path, set: &CurveSet) -> Vec<String> {
    let can = curve_file::abilities(path);
    let mut lost = Vec::new();
    if !can.radii && set.curves.iter().any(|c| c.radii.is_some()) {
        lost.push("radii are lost: the format has none".to_owned());
    }
    let uneven = |r: &Vec<f64>| r.windows(2).any(|w| w[0] != w[1]);
    if can.radii && !can.varying && set.curves.iter().filter_map(|c| c.radii.as_ref()).any(uneven) {
        lost.push("radii are the mean of each curve's: the format has one for each".to_owned());
    }
    if !can.colors && set.colors.iter().any(Option::is_some) {
        lost.push("colours are lost: the format has none".to_owned());
    }
    if can.ids && set.ids.iter().any(Option::is_some) && set.ids.iter().any(Option::is_none) {
        lost.push("ids are lost: not all curves have one, so that all are numbered as they come".to_owned());
    }
    if !can.ids && set.ids.iter().any(Option::is_some) {
        lost.push("ids are lost: curves are numbered as they come".to_owned());
    }
    if !can.ids && set.plies.iter().any(Option::is_some) {
        lost.push("numbers of plies are lost: the format has none".to_owned());
    }
    if !can.unit && set.unit_mm.is_some_and(|unit| unit != 1.0) {
        let unit = set.unit_mm.unwrap_or(1.0);
        lost.push(format!("the unit is lost: lengths are of {unit} mm, which whoever reads them must know"));
    }
    if can.unit && set.unit_mm.is_none() {
        lost.push("lengths are taken for millimetres: the input has no unit; --unit says it".to_owned());
    }
    if can.unit && set.curves.iter().any(|c| c.radii.is_none()) {
        lost.push(format!("curves without a radius have {SOME_RADIUS}; --radius says it"));
    }
    if set.curves.iter().any(|c| !can.bases.contains(&c.basis)) {
        lost.push("how points are meant is lost: give it as `basis` where the file is read".to_owned());
    }
    lost
}

pub(super) fn run(args: &ConvertArgs) -> Result<(), Failure> {
    refuse_unknown(std::slice::from_ref(&args.output))?;
    let files = Files::default().reads("input", [&args.input]).writes("output", [&args.output]);
    files.refuse()?;
    let mut set = read(args)?;
    files.check(args.quiet)?;
    if set.up_axis == Some(2) {
        // Files of this program have y up: a quarter turn about x.
        let points = set.curves.iter_mut().flat_map(|c| &mut c.points);
        points.for_each(|p| *p = glam::DVec3::new(p.x, p.z, -p.y));
        set.up_axis = Some(1);
    }
    let unit = set.unit_mm;
    if let Some(yarn) = args.level.yarn()? {
        let unit = unit.ok_or_else(|| {
            let hint = "--unit cm; `yarnray info` of it proposes one";
            Failure::hinted(format!("{}: a yarn needs the unit of its curves", args.input.display()), hint)
        })?;
        scale(&mut set, unit);
        set = args.level.apply(set, &yarn)?;
        scale(&mut set, 1.0 / unit);
    }
    set.unit_mm = unit;
    if let Some(to) = args.to_unit.as_deref().map(millimetres) {
        scale(&mut set, unit.unwrap_or(1.0) / to);
        set.unit_mm = Some(to);
    }
    write_curves(&args.output, &set)?;
    if !args.quiet {
        for line in set.notes.iter().cloned().chain(losses(&args.output, &set)) {
            log::say(&format!("{}: {line}", args.output.display()));
        }
        let points: usize = set.curves.iter().map(|c| c.points.len()).sum();
        log::say(&format!(
            "wrote {}: {}, {}",
            args.output.display(),
            counted(set.curves.len(), "curve"),
            counted(points, "point")
        ));
    }
    Ok(())
}

/// The curves of the input with the unit and the radius that the command line gives them.
fn read(args: &ConvertArgs) -> Result<CurveSet, Failure> {
    let basis = args.basis.as_deref().map(|b| if b == "b-spline" { Basis::BSpline } else { Basis::CatmullRom });
    let options = ReadOptions {
        basis,
        tile: args.tile.unwrap_or([1, 1]),
        prim: args.prim.clone(),
        frame: args.frame,
        faces: args.faces.clone(),
        ..ReadOptions::default()
    };
    let mut set = curve_file::read(&args.input, &options).map_err(|e| Failure::Input(format!("error: {e}")))?;
    if set.curves.is_empty() {
        return Err(Failure::Input(format!("error: {}: there are no curves in it", args.input.display())));
    }
    if let (Some(_), Some(given)) = (&args.unit, set.unit_mm) {
        let message = format!("error: {}: its unit is {given} mm already; leave --unit out", args.input.display());
        return Err(Failure::Input(message));
    }
    set.unit_mm = set.unit_mm.or(args.unit.as_deref().map(millimetres));
    if let Some(radius) = args.radius {
        for curve in set.curves.iter_mut().filter(|c| c.radii.is_none()) {
            curve.radii = Some(vec![radius; curve.points.len()]);
        }
    }
    Ok(set)
}

fn scale(set: &mut CurveSet, by: f64) {
    for curve in &mut set.curves {
        curve.points.iter_mut().for_each(|p| *p *= by);
        curve.radii.iter_mut().flatten().for_each(|r| *r *= by);
    }
}
