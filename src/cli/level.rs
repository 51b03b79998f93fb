//! What of cloth a command writes: its yarns, the plies of each, or every fibre.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use crate::{
    cloth,
    geometry::curve::CurveSet,
    plan::Memory,
    scene::{
        Fabric, Mode, Scene, SceneBuilder, Yarn,
        load::{LoadOptions, load_definitions},
    },
};

/// What is written, and of which yarn it is made.
#[derive(Args, Debug)]
pub(super) struct LevelArgs {
    /// Write yarns, a curve for each ply, or every fibre; the last two need --yarn.
    #[arg(long = "as", value_name = "LEVEL", default_value = "yarns", value_parser = LEVELS)]
    pub(super) level: String,
    /// The yarn that the cloth is of: its radius where none is given, its colour, its plies and fibres. A yarn of the
    /// built-in library, or of --library.
    #[arg(long, value_name = "NAME")]
    yarn: Option<String>,
    /// A scene or library file (.toml) with the yarn.
    #[arg(long, value_name = "FILE.toml", requires = "yarn")]
    library: Option<PathBuf>,
}

pub(super) const LEVELS: [&str; 3] = ["yarns", "plies", "fibers"];

/// The mode in which a scene's cloth is what `--as` asks for.
pub(super) fn mode(level: &str) -> Mode {
    match level {
        "plies" => Mode::Ply,
        "fibers" => Mode::Fiber,
        _ => Mode::Yarn,
    }
}

/// The curves of a scene's cloth in its mode; those of yarns as the scene has them, without frames or fly-aways.
pub(super) fn curves(scene: &Scene) -> Result<CurveSet, Failure> {
    Ok(cloth::curves(scene, Memory::new(scene).limit)?)
}

impl LevelArgs {
    /// The yarn that is named, if one is.
    pub(super) fn yarn(&self) -> Result<Option<Yarn>, Failure> {
        let Some(name) = &self.yarn else {
            if mode(&self.level) == Mode::Yarn {
                return Ok(None);
            }
            let hint = "--yarn wool takes a yarn of the built-in library, --library FILE.toml one of a file";
            return Err(Failure::hinted(format!("--as {} needs to know what the yarn is made of", self.level), hint));
        };
        let definitions = load_definitions(self.library.as_deref(), &LoadOptions::default())?;
        Ok(Some(definitions.yarn(name)?.clone()))
    }

    /// What `--as` asks for of these yarns, millimetres; curves without radii have that of the yarn. Colours and numbers
    /// that yarns have already are kept.
    pub(super) fn apply(&self, set: CurveSet, yarn: &Yarn) -> Result<CurveSet, Failure> {
        let CurveSet { curves, colors, ids, notes, .. } = set;
        let mut builder = SceneBuilder::new("cloth");
        let kind = builder.add_yarn(yarn.clone());
        let mut fabric = Fabric::new("cloth", kind, curves, yarn.radius, 0);
        for (curve, radii) in &mut fabric.curves {
            *radii = curve.radii.take().unwrap_or_else(|| std::mem::take(radii));
        }
        builder.fabrics.push(fabric);
        builder.render.mode = mode(&self.level);
        let scene = builder.build().map_err(|e| Failure::Input(format!("error: {e}")))?;
        let mut made = self::curves(&scene)?;
        for (id, color) in made.ids.iter_mut().zip(&mut made.colors) {
            let yarn = id.and_then(|id| usize::try_from(id).ok()).unwrap_or(usize::MAX);
            let own = |list: &[Option<i64>]| list.get(yarn).copied().flatten();
            *color = colors.get(yarn).copied().flatten().or(*color);
            *id = own(&ids).or(*id);
        }
        made.notes.splice(0..0, notes.into_iter().chain(scene.warnings));
        Ok(made)
    }
}
