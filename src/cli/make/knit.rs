//! `yarnray make knit`

use std::path::Path;

use clap::Args;
use glam::DVec2;

use super::{
    colors::ColorArgs,
    output::{EXAMPLES, Output, RADIUS, write},
};
use crate::{
    cli::{Failure, log, named, positive, two, working::Working},
    geometry::curve::Curve,
    math::words::{counted, from_to},
    pattern::{
        PatternStrand,
        chart::{Chart, PATTERNS},
        knit::{self, CastOn, Closing, Edges, Form, Knit, Knitted, Measures, Misfit, Rims, Sizes, Thickness},
        knitspeak::{Asked, Instructions, KnitSpeakError, WrittenEnd},
    },
    scene::{Yarn, load::read_text},
};

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct KnitArgs {
    #[command(flatten)]
    output: Output,
    /// A pattern with a name.
    #[arg(long, conflicts_with = "chart", value_parser = PATTERNS.iter().map(|(name, _)| *name).collect::<Vec<_>>())]
    pattern: Option<String>,
    /// A row of a chart, from the cast-on edge, as in 'k2 p2', '12: k' or 'k3 mb k3' (repeatable); docs/scenes.md lists the steps.
    #[arg(long, value_name = "ROW", allow_hyphen_values = true)]
    chart: Vec<String>,
    /// Written instructions, as in 'Row 1 (RS): *k2, p2; rep from * to end.', over the stitches cast on; lines, or `@FILE`.
    #[arg(long, value_name = "TEXT", conflicts_with_all = ["pattern", "chart"])]
    instructions: Option<String>,
    /// Stitches cast on; 20, or as many as the width takes.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    stitches: Option<u32>,
    /// Rows; 20, or as many as the height takes, or those of a chart that makes more or fewer stitches, or is knitted over a profile.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    rows: Option<u32>,
    #[command(flatten)]
    size: SizeArgs,
    #[command(flatten)]
    colors: ColorArgs,
    /// Flat, or round about the y axis.
    #[arg(long, default_value = "flat", value_parser = named(&FORMS))]
    form: Form,
    /// A point of the profile to knit round over, from the cast-on edge: radius and height (repeatable).
    #[arg(long, value_name = "R,Y", value_parser = profile_point)]
    profile: Vec<[f64; 2]>,
    /// Width of a stitch in yarn diameters.
    #[arg(long, value_name = "D", value_parser = within(knit::STITCH_WIDTHS))]
    stitch_width: Option<f64>,
    /// Distance between rows in yarn diameters.
    #[arg(long, value_name = "D", value_parser = within(knit::ROW_HEIGHTS))]
    row_height: Option<f64>,
    /// Length of yarn in a stitch, in yarn diameters; what suits the gauge, or 16.2 times what two yarns need side by side, if not given.
    #[arg(long, value_name = "D", value_parser = within(knit::YARNS_PER_STITCH))]
    yarn_per_stitch: Option<f64>,
    /// Cast on and bound off, with the first stitch of each row slipped as well, or with open loops.
    #[arg(long, default_value = "finished", value_parser = named(&Edges::NAMES))]
    edges: Edges,
    /// How a finished piece is cast on: with twisted loops, or as a rope.
    #[arg(long, default_value = "long-tail", value_parser = named(&CastOn::NAMES))]
    cast_on: CastOn,
    /// How its top is closed; `drawn` together, the yarn through all loops, is for what is knitted round.
    #[arg(long, default_value = "bound-off", value_parser = named(&Closing::NAMES))]
    top: Closing,
    /// A flat patch that repeats, without edges: its rows go on at one border as they begin at the other.
    #[arg(long, conflicts_with_all = ["edges", "form", "profile", "cast_on", "top"])]
    tile: bool,
    /// A flat piece that is not blocked: its edges roll as they do by themselves.
    #[arg(long, conflicts_with_all = ["tile", "profile"])]
    curl: bool,
    /// Control points of a stitch.
    #[arg(long, default_value_t = knit::POINTS, value_name = "N", value_parser = clap::value_parser!(u32).range(12..=200))]
    points: u32,
}

/// How large it is to be; lengths count as millimetres.
#[derive(Args, Debug)]
struct SizeArgs {
    /// Stitches and rows in 100 units of length: in 10 cm, if those are millimetres.
    #[arg(long, value_name = "WALES,COURSES", value_parser = gauge)]
    gauge: Option<[f64; 2]>,
    /// Width of a flat piece: counts its stitches, or with --stitches says how wide they are.
    #[arg(long, value_name = "L", value_parser = positive)]
    width: Option<f64>,
    /// Height of the piece: counts its rows, or with --rows says how high they are.
    #[arg(long, value_name = "L", value_parser = positive)]
    height: Option<f64>,
    /// Way round a tube, as the width of a flat piece.
    #[arg(long, value_name = "L", value_parser = positive)]
    circumference: Option<f64>,
}

/// What is knitted without a profile.
static FORMS: [(&str, Form); 2] = [("flat", Form::Flat), ("tube", Form::Tube)];

/// A number from one to another.
fn within([least, most]: [f64; 2]) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = text.parse().ok().filter(|v| (least..=most).contains(v));
        number.ok_or_else(|| format!("expected a number from {least} to {most}"))
    }
}

fn profile_point(text: &str) -> Result<[f64; 2], String> {
    let problem = "expected a radius of at least 0 and a height, as in 90,20";
    two(text).filter(|[radius, _]| *radius >= 0.0).ok_or_else(|| problem.to_owned())
}

fn gauge(text: &str) -> Result<[f64; 2], String> {
    let problem = "expected stitches and rows from 0.001 to 1000000, as in 22,30";
    two(text).filter(|n| n.iter().all(|v| (1e-3..=1e6).contains(v))).ok_or_else(|| problem.to_owned())
}

fn told(Misfit { problem, hint, .. }: Misfit) -> Failure {
    Failure::hinted(problem, hint)
}

fn wrong(error: &dyn std::fmt::Display) -> Failure {
    Failure::Input(format!("error: {error}"))
}

/// A chart, and the stitches and rows that are knitted of it unless asked otherwise.
struct Charted {
    chart: Chart,
    stitches: u32,
    rows: u32,
    /// When the piece ends by its instructions.
    end: WrittenEnd,
}

/// The chart of written instructions, or of those in a file whose name stands behind `@`, over so many stitches or as many as
/// they cast on; of as many rows as are asked for.
fn written(text: &str, stitches: Option<u32>, asked: Asked) -> Result<Charted, Failure> {
    let (text, name) = match text.strip_prefix('@') {
        None => (text.to_owned(), "--instructions".to_owned()),
        Some(path) => {
            let read = read_text(Path::new(path)).map_err(|problem| wrong(&format!("{path}: {problem}")))?;
            (read, path.to_owned())
        }
    };
    let told = |error: KnitSpeakError| {
        let line = error.line.map_or(String::new(), |line| format!("line {}: ", line + 1));
        Failure::hinted(format!("{name}: {line}{}", error.problem), error.hint)
    };
    let read = Instructions::read(&text).map_err(told)?;
    let stitches = stitches.or(read.cast_on()).unwrap_or(knit::COUNT);
    let (worked, rows) = read.work_piece(stitches, asked, knit::COUNT).map_err(told)?;
    let parsed = Chart::parse(&worked.rows);
    let chart = parsed.map_err(|error| Failure::hinted(format!("{name}: {}", error.problem), error.hint))?;
    Ok(Charted { chart, stitches, rows, end: read.end() })
}

impl KnitArgs {
    /// What is to be knitted, of yarn of a thickness.
    fn piece(&self, yarn: &Thickness) -> Result<Knit, Failure> {
        let form = self.form(yarn.radius)?;
        let by_itself = |chart| {
            let rows = Knit::rows_of(&chart, &form, !self.chart.is_empty());
            Charted { chart, stitches: knit::COUNT, rows, end: WrittenEnd::default() }
        };
        let Charted { chart, stitches, rows, end } = if let Some(text) = &self.instructions {
            written(text, self.stitches, Asked::new(self.rows, self.size.height.is_some()))?
        } else if self.chart.is_empty() {
            let chart = Chart::named(self.pattern.as_deref().unwrap_or("stockinette"));
            by_itself(chart.ok_or_else(|| wrong(&"unknown pattern"))?)
        } else {
            by_itself(Chart::parse(&self.chart).map_err(|e| wrong(&e))?)
        };
        let piece = Knit {
            chart,
            stitches: self.stitches.unwrap_or(stitches),
            rows: self.rows.unwrap_or(rows),
            form,
            stitch_width: self.stitch_width,
            row_height: self.row_height,
            edges: if self.tile { Edges::Tile } else { self.edges },
            rims: Rims { cast_on: self.cast_on, top: self.top },
            yarn_per_stitch: self.yarn_per_stitch,
            points: self.points,
            colors: None,
            flat: !self.curl,
        };
        if piece.edges == Edges::Live && piece.rims != Rims::default() {
            return Err(wrong(&"open loops have neither --cast-on nor --top; --edges finished has"));
        }
        let piece = self.sized(&piece, yarn, end)?;
        piece.check_counts().map_err(told)?;
        Ok(piece)
    }

    fn form(&self, radius: f64) -> Result<Form, Failure> {
        let profile: Vec<DVec2> = self.profile.iter().map(|p| DVec2::from(*p)).collect();
        if !profile.is_empty() {
            let told = |problem| wrong(&format!("{problem}; as in --profile 90,0 --profile 60,80"));
            return Form::revolution(profile, radius).map_err(told);
        }
        Ok(self.form.clone())
    }

    /// The piece in the size that is asked for, or as high as its instructions say.
    fn sized(&self, piece: &Knit, yarn: &Thickness, end: WrittenEnd) -> Result<Knit, Failure> {
        let SizeArgs { gauge, width, height, circumference } = self.size;
        let mut sizes = Sizes {
            stitch: gauge.map(|g| g.map(|n| 100.0 / n)),
            width,
            circumference,
            height,
            counted: [self.stitches, self.rows].map(|count| count.is_some()),
            ending: None,
        };
        sizes.or_written(end, Some(&piece.form), self.tile);
        let measured = [self.stitch_width, self.row_height].map(|size| size.is_some());
        if let Some(clash) = sizes.clashes(Some(&piece.form), measured, spelled).into_iter().next() {
            return Err(told(clash));
        }
        sizes.apply(piece, yarn).map_err(told)
    }

    /// What a scene would warn of, of a piece that is knitted.
    fn warn(&self, piece: &Knit, yarn: &Thickness, strands: &[PatternStrand]) {
        let even = |curve: &Curve| vec![yarn.radius; curve.points.len()];
        let evens: Vec<Vec<f64>> =
            strands.iter().map(|s| s.curve.radii.clone().unwrap_or_else(|| even(&s.curve))).collect();
        let curves: Vec<(&Curve, &[f64])> =
            strands.iter().zip(&evens).map(|(s, radii)| (&s.curve, radii.as_slice())).collect();
        let cut_off = piece.cut_off().filter(|_| !self.chart.is_empty());
        for told in cut_off.into_iter().chain(piece.breaks_in_rounds()).chain(piece.crowded(yarn, &curves, spelled)) {
            log::say(&format!("warning: {told}"));
        }
    }
}

/// An option by the key of a scene.
fn spelled(key: &str) -> String {
    format!("--{}", key.replace('_', "-"))
}

pub(super) fn run(args: &KnitArgs) -> Result<(), Failure> {
    let yarn = args.output.checked()?;
    let radius = args.output.radius.or(yarn.as_ref().map(|y| y.radius)).unwrap_or(RADIUS);
    // Curve files know round yarns only.
    let thickness = Thickness { half_width: yarn.as_ref().map_or(1.0, Yarn::half_width), ..Thickness::round(radius) };
    let (piece, palette) = args.colors.dyed(args.piece(&thickness)?, |told| {
        if !args.output.quiet {
            log::say(told);
        }
    })?;
    args.output.hold(piece.least_points().map_err(|e| wrong(&e))?)?;
    let task = format!("knitting {} x {}", counted(piece.stitches, "stitch"), counted(piece.rows, "row"));
    let working = Working::on(task, args.output.quiet);
    let knitted = piece.pressed(&thickness).map_err(|e| wrong(&e))?;
    let Measures { stitches, across, up } = piece.measures(&knitted);
    let Knitted { strands, gauge, colors, widths: _ } = knitted;
    drop(working);
    if !args.output.quiet {
        args.warn(&piece, &thickness, &strands);
    }
    let length: f64 = strands.iter().map(|s| s.curve.polygon_length()).sum();
    // Flat cloth lies in the plane z = 0, as the files of others do.
    let color = |strand: &PatternStrand| palette.of(*colors.get(strand.index as usize)?);
    write(strands, &args.output, [radius; 2], yarn.as_ref(), color)?;
    if !args.output.quiet {
        let Knit { rows, form, .. } = &piece;
        let [width, height] = gauge;
        let (stitches, period) = (from_to(stitches.map(|n| n.to_string())), across[1]);
        let across = from_to(across.map(|length| format!("{length:.3}")));
        log::say(&format!("{width:.4} from stitch to stitch, {height:.4} from row to row"));
        log::say(&match form {
            Form::Flat if args.tile => format!("period {period:.6} across, {up:.6} up; {length:.1} of yarn"),
            Form::Flat => format!("{stitches} x {rows}, {across} wide, {up:.3} high; {length:.1} of yarn"),
            Form::Tube => format!("{stitches} x {rows}, {across} around, {up:.3} high; {length:.1} of yarn"),
            Form::Revolution(_) => {
                format!("{stitches} x {rows}, {across} around, {up:.3} along the profile; {length:.1} of yarn")
            }
        });
    }
    Ok(())
}
