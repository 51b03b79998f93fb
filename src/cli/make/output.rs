//! What `make knit` and `make weave` have in common: examples, options of files and yarns, and how strands are written.

use std::path::PathBuf;

use clap::Args;

use crate::{
    cli::{
        Failure,
        curve_files::{refuse_unknown, write_all},
        files::Files,
        level::{LEVELS, LevelArgs},
        log, overlap_in_words, positive,
        working::Working,
    },
    files::curve_file,
    geometry::{
        curve::{Curve, CurveSet},
        overlap::overlap_of_plied,
    },
    pattern::{PatternStrand, StrandKind},
    scene::Yarn,
};

pub(super) const EXAMPLES: &str = "Examples:
  yarnray make knit --pattern rib2x2 --stitches 40 --rows 40 -o rib.hair
  yarnray make knit --chart '4: k' --chart 'k2 k2tog' --stitches 80 --rows 10 --form tube -o shaped.hair
  yarnray make knit --pattern seed --gauge 22,34 --width 80 --height 60 -o seed.hair
  yarnray make knit --motif '#..' --motif '.#.' --color '.=#f0e8d8' --color '#=#c02a1f' -o colors.usdc
  yarnray make garment scenes/pullover.toml -o pullover.bcc
  yarnray make weave --draft 'twill 2/1' --warps 60 --wefts 60 --weft-radius 0.3 -o twill.txt
  yarnray make weave --draft 'satin 5' --width 30 --height 20 --radius 0.2 -o satin.txt
  yarnray make weave --yarn linen --as plies -o linen.usdc
  yarnray render scenes/glove.toml --curves rib.hair --set fabric.0.source.unit=mm -o rib.png

The extension names the format: .bcc (no radii), .hair, .obj (lines, no radii), .yarns, .txt (x y z radius, as Mitsuba reads it),
.usda and .usdc (BasisCurves with widths, colours and the numbers of yarns and plies, in millimetres). Lengths have no unit
in the others; what reads them gives one.";

/// Where cloth is written, and of which yarn it is.
#[derive(Args, Debug)]
pub(super) struct Output {
    #[arg(
        short,
        long = "out",
        value_name = "PATH",
        required = true,
        help = format!("Where to write; the extension names the format: {}. Repeatable", curve_file::written_extensions())
    )]
    pub(super) out: Vec<PathBuf>,
    /// Radius of the yarn; that of --yarn, or of a WIF draft, or 0.5, if not given.
    #[arg(long, value_name = "R", value_parser = positive)]
    pub(super) radius: Option<f64>,
    #[command(flatten)]
    pub(super) level: LevelArgs,
    /// Say nothing.
    #[arg(long, short)]
    pub(super) quiet: bool,
}

/// Radius of the yarn unless given.
pub(super) const RADIUS: f64 = 0.5;

impl Output {
    /// The yarn that cloth is of, if one is named; files that cannot be written are refused first, before any work.
    pub(super) fn checked(&self) -> Result<Option<Yarn>, Failure> {
        refuse_unknown(&self.out)?;
        Files::default().writes("-o", &self.out).check(self.quiet)?;
        self.level.yarn()
    }

    /// Refuses files whose format has no room for a curve of so many points, before any work.
    pub(super) fn hold(&self, points: u64) -> Result<(), Failure> {
        // Plies and fibres have points of their own.
        if self.level.level != LEVELS[0] {
            return Ok(());
        }
        let most = |path: &PathBuf| curve_file::abilities(path).most_points.filter(|most| points > *most as u64);
        let Some((path, most)) = self.out.iter().find_map(|path| Some((path, most(path)?))) else { return Ok(()) };
        let extension = path.extension().unwrap_or_default().display();
        Err(Failure::hinted(
            format!(
                "{}: a curve of a .{extension} file has at most {most} points, and one yarn of this piece at least {points}",
                path.display()
            ),
            "a name that ends in .bcc, .usdc or .txt, fewer --points, or a smaller piece",
        ))
    }
}

/// Writes all files and says what they hold. Radii are those of other strands and of wefts.
pub(super) fn write(
    strands: Vec<PatternStrand>,
    output: &Output,
    [radius, weft_radius]: [f64; 2],
    yarn: Option<&Yarn>,
    color: impl Fn(&PatternStrand) -> Option<[f32; 3]>,
) -> Result<(), Failure> {
    let mut set = CurveSet { up_axis: Some(1), ..CurveSet::default() };
    let of_tufts: Vec<bool> = strands.iter().map(PatternStrand::is_of_tuft).collect();
    for strand in strands {
        let radius = if strand.kind == StrandKind::Weft { weft_radius } else { radius };
        set.colors.push(color(&strand));
        let mut curve = strand.curve;
        curve.radii.get_or_insert_with(|| vec![radius; curve.points.len()]);
        set.curves.push(curve);
    }
    if set.colors.iter().all(Option::is_none) {
        set.colors = Vec::new();
    }
    let plain = output.out.iter().find(|path| !curve_file::abilities(path).colors);
    if let Some(path) = plain.filter(|_| !set.colors.is_empty() && !output.quiet) {
        log::say(&format!("{}: its format holds no colours; .usdc, .usda and .yarns do", path.display()));
    }
    let set = match yarn {
        Some(yarn) => output.level.apply(set, yarn)?,
        None => {
            set.curves.iter_mut().for_each(Curve::make_round);
            set
        }
    };
    write_all(&output.out, &set, output.quiet)?;
    let _working = Working::on("looking for yarns that overlap", output.quiet);
    if !output.quiet && set.plies.is_empty() {
        let half_width = yarn.map_or(1.0, Yarn::half_width);
        // Strands are crowded in their tuft as fibres are.
        let ground = set.curves.iter().enumerate().filter(|(i, _)| of_tufts.get(*i) != Some(&true));
        let curves = ground.filter_map(|(_, c)| Some((c, c.radii.as_deref()?, half_width)));
        if let Some(found) = overlap_of_plied(curves) {
            let by = if half_width < 1.0 {
                format!("by the mean width of plied yarn, {half_width:.3} of twice the radius written")
            } else {
                "by the radius written".to_owned()
            };
            log::say(&overlap_in_words(&found, &by, of_tufts.contains(&true)));
        }
    }
    Ok(())
}
