//! `yarnray make weave`

use clap::Args;
use glam::Vec3;

use super::output::{EXAMPLES, Output, RADIUS, write};
use crate::{
    cli::{Failure, log, named, positive, working::Working},
    input::system::in_words,
    pattern::{
        PatternStrand,
        draft::{Draft, DraftError},
        period::counts_that_hold,
        weave::{self, Cloth, Edges, Extent, Impossible, Measures, Weave},
        wif::{self, WifUse, WovenWif},
    },
    scene::{Yarn, drawn_draft::Legend, palette},
};

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct WeaveArgs {
    #[command(flatten)]
    output: Output,
    /// plain, 'basket 2', 'twill 2/1', 'satin 5', 'satin 8/3', 'sateen 5'; a row of a matrix of # and ., top row first
    /// (repeatable); a draft of a weaving program (.wif), whose lengths count as millimetres; or a picture (.png), a pixel for
    /// each end and pick, dark where the warp is on top, or in the colours of --weave.
    #[arg(long, default_value = "plain", value_name = "DRAFT")]
    draft: Vec<String>,
    /// The weave that a colour of the picture stands for, as '#b02020=satin 8' (repeatable).
    #[arg(long, value_name = "COLOR=WEAVE", value_parser = colored)]
    weave: Vec<(Vec3, Draft)>,
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
    #[arg(long, value_parser = named(&Edges::NAMES))]
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

/// Crossings of a repeat from which on a weave takes more than some seconds.
const LONG_REPEAT: usize = 1024;

fn share(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v| (0.0..=1.0).contains(v)).ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

pub(super) fn run(args: &WeaveArgs) -> Result<(), Failure> {
    let (draft, file) = args.draft()?;
    let yarn = args.output.checked()?;
    let (piece, radii) = args.piece(draft, file.as_ref(), yarn.as_ref());
    args.check(&piece)?;
    let quiet = args.output.quiet;
    args.output.hold(piece.least_points())?;
    let repeat = [piece.draft.warps(), piece.draft.wefts()];
    let task = format!("bringing a repeat of {} x {} threads to equilibrium", repeat[0], repeat[1]);
    if !quiet && repeat[0] * repeat[1] > LONG_REPEAT {
        log::say(&task);
    }
    let working = Working::on(task, quiet);
    let given = [args.warp_spacing, args.weft_spacing].map(|s| s.is_some());
    let cloth = piece.relax().map_err(|why| not_woven(&why, given))?;
    drop(working);
    args.output.hold(cloth.least_points())?;
    let strands = cloth.strands();
    let measures = cloth.measures();
    if !quiet {
        warn(&cloth, &piece, &measures, &strands);
    }
    let length = weave::yarn_lengths(&strands);
    let color = |strand: &PatternStrand| file.as_ref().and_then(|f| f.color_of(strand));
    write(strands, &args.output, radii, yarn.as_ref(), color)?;
    if !quiet {
        args.report(&measures, length);
    }
    Ok(())
}

impl WeaveArgs {
    /// The draft, and the file of a weaving program that it is of.
    fn draft(&self) -> Result<(Draft, Option<WovenWif>), Failure> {
        let wrong = |error: DraftError| Failure::Input(format!("error: {error}"));
        Ok(match (drawn(self)?, self.draft.as_slice()) {
            (Some(draft), _) => (draft, None),
            (None, [path]) if path.to_lowercase().ends_with(".wif") => {
                wif_draft(path).map(|file| (file.draft.clone(), Some(file)))?
            }
            (None, [name]) if !name.contains(['#', '.']) => (Draft::named(name).map_err(wrong)?, None),
            (None, rows) => (Draft::matrix(rows).map_err(wrong)?, None),
        })
    }

    /// The picture that the draft is, if it is one.
    fn picture(&self) -> Option<&str> {
        match self.draft.as_slice() {
            [path] if path.to_lowercase().ends_with(".png") => Some(path),
            _ => None,
        }
    }

    /// What is to be woven, and the radii of its yarns.
    fn piece(&self, draft: Draft, file: Option<&WovenWif>, yarn: Option<&Yarn>) -> (Weave, [f64; 2]) {
        // Of a picture all is woven.
        let whole = self.picture().map(|_| [draft.warps() as u32, draft.wefts() as u32]);
        let [warps, wefts] = file.map(|f| f.count).or(whole).unwrap_or([weave::YARNS; 2]);
        let own = |given: Option<f64>, side: usize| given.or(file.and_then(|f| f.radius[side]));
        let otherwise = yarn.map_or(RADIUS, |y| y.radius);
        let radius = own(self.output.radius, 0).unwrap_or(otherwise);
        let radii = [radius, own(self.weft_radius, 1).unwrap_or(radius)];
        let spaced = |side: usize| file.and_then(|f| f.spacing[side]).filter(|_| self.cover.is_none());
        let half_width = yarn.map_or(1.0, Yarn::half_width);
        let half_rooms = radii.map(|radius| radius * half_width);
        let piece = Weave {
            warps: self.width.map_or(Extent::Yarns(self.warps.unwrap_or(warps)), Extent::Length),
            wefts: self.height.map_or(Extent::Yarns(self.wefts.unwrap_or(wefts)), Extent::Length),
            half_rooms,
            half_width: [half_width; 2],
            warp_spacing: self.warp_spacing.or_else(|| spaced(0)),
            weft_spacing: self.weft_spacing.or_else(|| spaced(1)),
            cover: self.cover,
            crimp: self.crimp,
            // Curve files know round yarns only.
            flatten: 1.0,
            points: self.points,
            edges: self.edges.map_or(Edges::Live, |edges| edges(weave::fringe(half_rooms[0]))),
            pile_height: self.pile_height.unwrap_or_else(|| weave::pile_height(&draft, half_rooms[0])),
            draft,
            shuttles: file.map(|f| weave::shuttles(&f.colors[1])).unwrap_or_default(),
            threads: file.map(|f| f.threads.clone()).unwrap_or_default(),
            tile: self.tile,
        };
        (piece, radii)
    }

    /// Refuses options that do not go together.
    fn check(&self, piece: &Weave) -> Result<(), Failure> {
        if self.pile_height.is_some() && piece.draft.pile().is_none() {
            let hint = "--draft terry, velvet or corduroy, or leave it out";
            return Err(Failure::hinted("--pile-height: this draft has no pile", hint));
        }
        if let Err((problem, instead)) = piece.edges.suit(&piece.draft) {
            return Err(Failure::hinted(problem, format!("--edges {}", instead.name())));
        }
        let most = weave::longest(piece.half_rooms[0]);
        if piece.pile_height > most {
            return Err(Failure::Input(format!(
                "error: --pile-height is at most {most}, five hundred times a warp's width"
            )));
        }
        Ok(())
    }

    /// Says what was woven, with the length of yarn of warp and weft.
    fn report(&self, measures: &Measures, [warp, weft]: [f64; 2]) {
        let Measures { spacing, see_through, crimp, thickness, size, .. } = *measures;
        log::say(&format!("{:.4} from warp to warp, {:.4} from weft to weft", spacing[0], spacing[1]));
        log::say(&format!("crimp {:.1} % of the warp, {:.1} % of the weft", 100.0 * crimp[0], 100.0 * crimp[1]));
        log::say(&format!("{:.1} % see-through, {thickness:.3} thick", 100.0 * see_through));
        let extent = match self.tile {
            true => format!("period {:.6} across, {:.6} up", size[0], size[1]),
            false => format!("{:.3} wide, {:.3} high", size[0], size[1]),
        };
        log::say(&format!("{extent}; {warp:.1} of warp, {weft:.1} of weft"));
    }
}

/// Says what a scene would warn of.
fn warn(cloth: &Cloth<'_>, piece: &Weave, measures: &Measures, strands: &[PatternStrand]) {
    if let Some(problem) = piece.draft.loose_in_words() {
        log::say(&format!("note: {problem}; warps count from the left, wefts from the bottom"));
    }
    let low = if piece.edges == Edges::Finished { measures.too_low_for_hems(1.0) } else { None };
    for told in low.into_iter().chain(cloth.crowded(strands)) {
        log::say(&format!("warning: {told}"));
    }
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
        Impossible::TooLittleCover { least } => {
            format!("error: these yarns cover at least {least:.3} of the plane in this weave; a greater --cover")
        }
        Impossible::TooFewWarps { least } => {
            let problem = format!("wefts that turn at the sides take at least {least} warps in this weave");
            return Failure::hinted(problem, format!("--warps {least}, or --edges live"));
        }
        Impossible::TooSmall { warp, least } => {
            let name = if warp { "width" } else { "height" };
            format!("error: --{name} has no room for one yarn, or one repeat of a tile; at least {least:.3}")
        }
        Impossible::Unpaired { warps } => {
            return Failure::hinted(
                format!("this weave twines its warps in pairs: of {warps} one is left alone"),
                format!("--warps {}", counts_that_hold(2, warps)),
            );
        }
        Impossible::TooLarge => "error: more than 2^27 control points; fewer warps, wefts or points".to_owned(),
    })
}

/// A colour and its weave.
fn colored(text: &str) -> Result<(Vec3, Draft), String> {
    let (sign, name) = text.split_once('=').ok_or_else(|| "expected COLOR=WEAVE, as '#b02020=satin 8'".to_owned())?;
    let color = palette::color(sign.trim()).ok_or_else(|| format!("`{sign}` is no colour, as #b02020 is"))?;
    let draft = Draft::named(name).map_err(|error| error.to_string())?;
    Legend::suits(name, &draft).map_err(|error| error.to_string())?;
    Ok((color, draft))
}

/// The draft that is a picture, if one is given.
fn drawn(args: &WeaveArgs) -> Result<Option<Draft>, Failure> {
    let path = match args.picture() {
        Some(path) => path,
        None if args.weave.is_empty() => return Ok(None),
        None => return Err(Failure::hinted("--weave without a picture".to_owned(), "--draft FILE.png".to_owned())),
    };
    let legend = if args.weave.is_empty() { Legend::Up(Vec3::ZERO) } else { Legend::Weaves(args.weave.clone()) };
    let told = |(problem, hint): (String, Option<String>)| match hint {
        Some(hint) => Failure::hinted(problem, hint),
        None => Failure::Input(format!("error: {problem}")),
    };
    legend.draft(std::path::Path::new(path)).map(Some).map_err(told)
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
