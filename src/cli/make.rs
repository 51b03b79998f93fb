//! `yarnray make`: curve files of cloth that the program makes.

mod colors;
mod knit;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use self::knit::KnitArgs;
use super::{
    Failure,
    fibers::{self, FibersArgs},
    files::{Attempts, Files},
    garment::{self, GarmentArgs},
    level::{LEVELS, LevelArgs},
    log, named, positive,
    working::Working,
};
use crate::{
    files::curve_file,
    geometry::{
        curve::{Curve, CurveSet},
        overlap::overlap_of_plied,
    },
    image::output,
    input::system::in_words,
    math::words::counted,
    pattern::{
        PatternStrand, StrandKind,
        draft::{Draft, DraftError},
        weave::{self, Extent, Impossible, Measures, Weave},
        wif::{self, WifUse, WovenWif},
    },
    scene::Yarn,
};

const EXAMPLES: &str = "Examples:
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

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct MakeArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Debug)]
enum What {
    /// Knitted cloth from a named pattern or a chart.
    Knit(Box<KnitArgs>),
    /// Woven cloth from a draft.
    Weave(Box<WeaveArgs>),
    /// The yarns of a scene's cloth, such as those laid on a garment.
    Garment(Box<GarmentArgs>),
    /// The explicit fibres or plies of a scene's cloth.
    Fibers(Box<FibersArgs>),
}

/// What all of them share.
#[derive(Args, Debug)]
struct Output {
    #[arg(
        short,
        long = "out",
        value_name = "PATH",
        required = true,
        help = format!("Where to write; the extension names the format: {}. Repeatable", curve_file::written_extensions())
    )]
    out: Vec<PathBuf>,
    /// Radius of the yarn; that of --yarn, or of a WIF draft, or 0.5, if not given.
    #[arg(long, value_name = "R", value_parser = positive)]
    radius: Option<f64>,
    #[command(flatten)]
    level: LevelArgs,
    /// Say nothing.
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
struct WeaveArgs {
    #[command(flatten)]
    output: Output,
    /// plain, 'basket 2', 'twill 2/1', 'satin 5', 'satin 8/3', 'sateen 5'; a row of a matrix of # and ., top row first
    /// (repeatable); or a draft of a weaving program (.wif), whose lengths count as millimetres.
    #[arg(long, default_value = "plain", value_name = "DRAFT")]
    draft: Vec<String>,
    /// Number of warps; 20, or those of the file.
    #[arg(long, conflicts_with = "width", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    warps: Option<u32>,
    /// Number of wefts; 20, or those of the file.
    #[arg(long, conflicts_with = "height", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    wefts: Option<u32>,
    /// How wide the cloth is, in place of a number of warps: as many as fill it best.
    #[arg(long, value_name = "L", value_parser = positive)]
    width: Option<f64>,
    /// How high the cloth is, in place of a number of wefts.
    #[arg(long, value_name = "L", value_parser = positive)]
    height: Option<f64>,
    /// Radius of the weft yarn, if not that of the warp.
    #[arg(long, value_name = "R", value_parser = positive)]
    weft_radius: Option<f64>,
    /// Distance between warps; the least possible if not given.
    #[arg(long, value_name = "L", value_parser = positive)]
    warp_spacing: Option<f64>,
    /// Distance between wefts.
    #[arg(long, value_name = "L", value_parser = positive)]
    weft_spacing: Option<f64>,
    /// Share of the plane that yarns cover, 0 to 1; what the loom gives if neither this nor spacings are given.
    #[arg(long, value_name = "X", value_parser = share)]
    cover: Option<f64>,
    /// The warp's share of the crimp, 0 to 1; by the yarns' stiffness if not given.
    #[arg(long, value_name = "X", value_parser = share)]
    crimp: Option<f64>,
    /// Cut all around (the default), with selvedges at the sides, with a fringe or with hems.
    #[arg(long, value_parser = named(&weave::Edges::NAMES))]
    edges: Option<weave::EdgesOf>,
    /// Whole repeats, cut all around: cloth that goes on at one border as it begins at the other.
    #[arg(long, conflicts_with = "edges")]
    tile: bool,
    /// How high the pile of terry, velvet and corduroy stands.
    #[arg(long, value_name = "L", value_parser = positive)]
    pile_height: Option<f64>,
    /// Control points between two crossings.
    #[arg(long, default_value_t = weave::POINTS, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=24))]
    points: u32,
}

/// Radius of the yarn unless given.
const RADIUS: f64 = 0.5;
/// Crossings of a repeat from which on a weave takes more than some seconds.
const LONG_REPEAT: usize = 1024;

fn share(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v| (0.0..=1.0).contains(v)).ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

pub(super) fn run(args: &MakeArgs) -> Result<(), Failure> {
    match &args.what {
        What::Knit(args) => knit::run(args),
        What::Weave(args) => weave(args),
        What::Garment(args) => garment::run(args),
        What::Fibers(args) => fibers::run(args),
    }
}

fn weave(args: &WeaveArgs) -> Result<(), Failure> {
    let wrong = |error: DraftError| Failure::Input(format!("error: {error}"));
    let (draft, file) = match args.draft.as_slice() {
        [path] if path.to_lowercase().ends_with(".wif") => {
            wif_draft(path).map(|file| (file.draft.clone(), Some(file)))?
        }
        [name] if !name.contains(['#', '.']) => (Draft::named(name).map_err(wrong)?, None),
        rows => (Draft::matrix(rows).map_err(wrong)?, None),
    };
    let yarn = args.output.checked()?;
    let [warps, wefts] = file.as_ref().map_or([weave::YARNS; 2], |f| f.count);
    let own = |given: Option<f64>, side: usize| given.or(file.as_ref().and_then(|f| f.radius[side]));
    let otherwise = yarn.as_ref().map_or(RADIUS, |y| y.radius);
    let radius = own(args.output.radius, 0).unwrap_or(otherwise);
    let spaced = |side: usize| file.as_ref().and_then(|f| f.spacing[side]).filter(|_| args.cover.is_none());
    let weft_radius = own(args.weft_radius, 1).unwrap_or(radius);
    let half_width = yarn.as_ref().map_or(1.0, Yarn::half_width);
    let half_rooms = [radius, weft_radius].map(|radius| radius * half_width);
    let piece = Weave {
        warps: args.width.map_or(Extent::Yarns(args.warps.unwrap_or(warps)), Extent::Length),
        wefts: args.height.map_or(Extent::Yarns(args.wefts.unwrap_or(wefts)), Extent::Length),
        half_rooms,
        half_width: [half_width; 2],
        warp_spacing: args.warp_spacing.or_else(|| spaced(0)),
        weft_spacing: args.weft_spacing.or_else(|| spaced(1)),
        cover: args.cover,
        crimp: args.crimp,
        // Curve files know round yarns only.
        flatten: 1.0,
        points: args.points,
        edges: args.edges.map_or(weave::Edges::Live, |edges| edges(weave::fringe(half_rooms[0]))),
        pile_height: args.pile_height.unwrap_or_else(|| weave::pile_height(&draft, half_rooms[0])),
        draft,
        shuttles: file.as_ref().map(|f| weave::shuttles(&f.colors[1])).unwrap_or_default(),
        threads: file.as_ref().map(|f| f.threads.clone()).unwrap_or_default(),
        tile: args.tile,
    };
    if let Err((problem, instead)) = piece.edges.suit(&piece.draft) {
        return Err(Failure::hinted(problem, format!("--edges {}", instead.name())));
    }
    let repeat = [piece.draft.warps(), piece.draft.wefts()];
    let task = format!("bringing a repeat of {} x {} threads to equilibrium", repeat[0], repeat[1]);
    let given = [args.warp_spacing, args.weft_spacing].map(|s| s.is_some());
    let most = weave::longest(half_rooms[0]);
    if piece.pile_height > most {
        return Err(Failure::Input(format!(
            "error: --pile-height is at most {most}, five hundred times a warp's width"
        )));
    }
    args.output.hold(piece.least_points())?;
    if !args.output.quiet && repeat[0] * repeat[1] > LONG_REPEAT {
        log::say(&task);
    }
    let working = Working::on(task, args.output.quiet);
    let cloth = piece.relax().map_err(|why| not_woven(&why, given))?;
    drop(working);
    args.output.hold(cloth.least_points())?;
    let color = |strand: &PatternStrand| file.as_ref().and_then(|f| f.color_of(strand));
    write(cloth.strands(), &args.output, [radius, weft_radius], yarn.as_ref(), color)?;
    if !args.output.quiet {
        let Measures { spacing, see_through, crimp, thickness, size, length } = cloth.measures();
        log::say(&format!("{:.4} from warp to warp, {:.4} from weft to weft", spacing[0], spacing[1]));
        log::say(&format!("crimp {:.1} % of the warp, {:.1} % of the weft", 100.0 * crimp[0], 100.0 * crimp[1]));
        log::say(&format!("{:.1} % see-through, {thickness:.3} thick", 100.0 * see_through));
        let extent = match args.tile {
            true => format!("period {:.6} across, {:.6} up", size[0], size[1]),
            false => format!("{:.3} wide, {:.3} high", size[0], size[1]),
        };
        log::say(&format!("{extent}; {:.1} of warp, {:.1} of weft", length[0], length[1]));
    }
    Ok(())
}

/// Why a weave cannot be; a spacing is the command line's or the file's.
fn not_woven(why: &Impossible, given: [bool; 2]) -> Failure {
    Failure::Input(match *why {
        Impossible::TooTight { warp, least } => {
            let name = if warp { "warp" } else { "weft" };
            if given[usize::from(!warp)] {
                format!("error: --{name}-spacing leaves the yarns no room to pass; at least {least:.4} here")
            } else {
                return Failure::hinted(
                    format!(
                        "the {name} spacing of the draft leaves the yarns no room to pass; at least {least:.4} here"
                    ),
                    format!("thinner yarns (--radius), or a spacing of your own (--{name}-spacing)"),
                );
            }
        }
        Impossible::TooMuchCover { most } => {
            format!("error: these yarns cover at most {most:.3} of the plane in this weave")
        }
        Impossible::TooSmall { warp, least } => {
            let name = if warp { "width" } else { "height" };
            format!("error: --{name} has no room for one yarn, or one repeat of a tile; at least {least:.3}")
        }
        Impossible::TooLarge => "error: more than 2^27 control points; fewer warps, wefts or points".to_owned(),
    })
}

/// A draft of a weaving program; what it leaves open is said.
fn wif_draft(path: &str) -> Result<WovenWif, Failure> {
    let wrong = |problem: String| Failure::Input(format!("error: {path}: {problem}"));
    let bytes = std::fs::read(path).map_err(|e| wrong(in_words(&e)))?;
    let file = wif::parse(&bytes).map_err(|e| wrong(e.to_string()))?;
    let woven = file.woven(WifUse::default()).map_err(|e| wrong(e.to_string()))?;
    woven.notes.iter().for_each(|note| log::say(&format!("{path}: {note}")));
    Ok(woven)
}

impl Output {
    /// The yarn that cloth is of, if one is named; files that cannot be written are refused first, before any work.
    fn checked(&self) -> Result<Option<Yarn>, Failure> {
        refuse_unknown(&self.out)?;
        Files::default().writes("-o", &self.out).check(self.quiet)?;
        self.level.yarn()
    }

    /// Refuses files whose format has no room for a curve of so many points, before any work.
    fn hold(&self, points: u64) -> Result<(), Failure> {
        // Plies and fibres have points of their own.
        if self.level.level != LEVELS[0] {
            return Ok(());
        }
        let most = |path: &PathBuf| curve_file::most_points(path).filter(|most| points > *most as u64);
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
fn write(
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
    let plain = output.out.iter().find(|path| !curve_file::holds_colors(path));
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
            log::say(&super::overlap_in_words(&found, of_tufts.contains(&true)));
        }
    }
    Ok(())
}

/// Refuses names of files whose format is not written.
pub(super) fn refuse_unknown(paths: &[PathBuf]) -> Result<(), Failure> {
    match paths.iter().find(|path| !curve_file::can_write(path)) {
        None => Ok(()),
        Some(path) => {
            let known = curve_file::written_extensions();
            Err(Failure::Input(format!("error: {}: expected a name that ends in {known}", path.display())))
        }
    }
}

/// Writes curves to every file that can be written, and says what they hold.
pub(super) fn write_all(paths: &[PathBuf], set: &CurveSet, quiet: bool) -> Result<(), Failure> {
    let mut attempts = Attempts::default();
    for path in paths {
        let _working = Working::on(format!("writing {}", path.display()), quiet);
        if attempts.note(write_curves(path, set)) && !quiet {
            log::say(&format!("wrote {}", path.display()));
        }
    }
    if !quiet {
        set.notes.iter().for_each(|note| log::say(&format!("note: {note}")));
        let points: usize = set.curves.iter().map(|c| c.points.len()).sum();
        let what = if set.plies.is_empty() { "yarn" } else { "curve" };
        log::say(&format!("{}, {}", counted(set.curves.len(), what), counted(points, "control point")));
    }
    attempts.finish()
}

/// Writes curves to a file that appears whole or not at all.
pub(super) fn write_curves(path: &Path, set: &CurveSet) -> Result<(), Failure> {
    Ok(output::write_file(path, |file| {
        let mut file = std::io::BufWriter::new(file);
        curve_file::write(path, set, &mut file)?;
        std::io::Write::flush(&mut file)
    })?)
}
