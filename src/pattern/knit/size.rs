//! How thick the yarn of a knit is, and how large the knit is to be: a gauge, a width or circumference and a height, which count
//! its stitches and rows.

use std::f64::consts::TAU;

use glam::DVec2;

use super::{Edges, Form, Knit, Knitted, STITCHES_PER_SQUARE};
use crate::{
    math::words,
    pattern::{
        MAX_POINTS,
        knitspeak::{EveryFew, WrittenEnd},
        revolution::Revolution,
    },
};

/// Sizes that a knit was given, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sizes {
    /// Width and height of a stitch, by the gauge.
    pub stitch: Option<[f64; 2]>,
    /// Width of a flat piece.
    pub width: Option<f64>,
    /// Way round a tube.
    pub circumference: Option<f64>,
    /// From the cast-on edge to the last row.
    pub height: Option<f64>,
    /// Whether stitches and rows are counted too.
    pub counted: [bool; 2],
    /// After how many rows the piece may end, where a height counts them.
    pub ending: Option<EveryFew>,
}

/// How large a piece is: its narrowest and its widest row, and its height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Stitches of the row that has the fewest, what is cast on among them, and of that which has the most.
    pub stitches: [u32; 2],
    /// Width of the narrowest and of the widest row, or the way round there.
    pub across: [f64; 2],
    /// Height of a piece, or the length of the profile.
    pub up: f64,
}

/// How thick a yarn is where stitches press on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thickness {
    /// Radius of the yarn by itself, mm.
    pub radius: f64,
    /// Half of the room that it takes beside others, over its radius: see [`mean_half_width`](crate::geometry::yarn::mean_half_width).
    pub half_width: f64,
    /// Width over height of its section where it is pressed, at least 1; its area stays.
    pub flatten: f64,
}

impl Thickness {
    /// Of a yarn that stays round.
    pub fn round(radius: f64) -> Self {
        Self { radius, half_width: 1.0, flatten: 1.0 }
    }

    /// Diameter of the yarn by itself, mm.
    pub fn diameter(&self) -> f64 {
        2.0 * self.radius
    }

    /// Distance of the centre lines of two such yarns that press on each other, mm: the unit of a [`Knit`].
    pub fn pressed(&self) -> f64 {
        self.diameter() * self.half_width / self.flatten.sqrt()
    }

    /// A unit of a [`Knit`] in diameters of the yarn.
    fn unit(&self) -> f64 {
        self.pressed() / self.diameter()
    }
}

/// A size that does not fit the rest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Misfit {
    /// The option at fault, as in a scene; none where yarn and gauge do not fit.
    pub key: Option<&'static str>,
    /// What is wrong.
    pub problem: String,
    /// What would fit.
    pub hint: String,
}

/// The shortest yarn of a stitch, in units: beyond it yarns would lie inside each other.
const SHORTEST: f64 = 11.0;
/// The narrowest stitch, in units, and the widest, in diameters of the yarn: below it yarns would lie inside each other, above it
/// nothing holds.
pub const STITCH_WIDTHS: [f64; 2] = [1.5, 20.0];
/// The lowest and the highest, as [`STITCH_WIDTHS`].
pub const ROW_HEIGHTS: [f64; 2] = [0.9, 20.0];
/// The shortest and the longest yarn of a stitch that can be asked for, in diameters of the yarn: below it no loop can be laid,
/// above it nothing holds.
pub const YARNS_PER_STITCH: [f64; 2] = [6.0, 60.0];
/// The fewest stitches that are knitted round, the points that a profile may have, and how far apart they are at least, in
/// radii of the yarn.
const FEWEST_ROUND: u32 = 3;
const PROFILE_POINTS: std::ops::RangeInclusive<usize> = 2..=10_000;
const CLOSEST_PROFILE_POINTS: f64 = 1e-3;
/// Width and height of a usual stitch, in units.
const USUAL: [f64; 2] = [3.0, 2.2];
/// Yarn of a firm stitch.
const FIRM: f64 = 14.0;
/// Most stitches or rows.
const MOST: f64 = 1e6;

impl Sizes {
    /// As high as written instructions say, mm, where nothing else says how many rows there are: neither a height, nor a count, nor a
    /// profile, nor a tile; and with the row as the last that they say.
    pub fn or_written(&mut self, end: WrittenEnd, form: Option<&Form>, tile: bool) {
        if !self.counted[1] && !tile && matches!(form, Some(Form::Flat | Form::Tube)) {
            self.height = self.height.or(end.height);
            self.ending = end.ending;
        }
    }

    /// What is given twice, or is no size of such a form. `measured` says whether the width and the height of a stitch are
    /// given in yarn diameters, `spelled` how an option is named.
    pub fn clashes(
        &self,
        form: Option<&Form>,
        measured: [bool; 2],
        spelled: impl Fn(&'static str) -> String,
    ) -> Vec<Misfit> {
        let mut found = Vec::new();
        let mut wrong = |key: &'static str, problem: String, hint: &str| {
            found.push(Misfit { key: Some(key), problem, hint: hint.to_owned() });
        };
        let sizes = [
            ("width", self.width.is_some()),
            ("height", self.height.is_some()),
            ("circumference", self.circumference.is_some()),
            ("gauge", self.stitch.is_some()),
        ];
        let given = |key: &str| sizes.iter().any(|(k, given)| *k == key && *given);
        match form {
            Some(Form::Tube) if given("width") => {
                let hint = format!("{} is the way round it", spelled("circumference"));
                wrong("width", "a tube has no width".to_owned(), &hint);
            }
            Some(Form::Flat) if given("circumference") => {
                let hint = format!("{}, or a tube by {}", spelled("width"), spelled("form"));
                wrong("circumference", "a flat piece has no circumference".to_owned(), &hint);
            }
            Some(Form::Revolution(_)) => {
                for (key, _) in sizes.iter().filter(|(_, given)| *given) {
                    let problem = format!("the profile says how large the piece is, not {}", spelled(key));
                    wrong(key, problem, "give one of them");
                }
            }
            _ => {}
        }
        for (key, _) in ["stitch_width", "row_height"].into_iter().zip(measured).filter(|k| k.1 && given("gauge")) {
            let problem = format!("{} and {} are given", spelled(key), spelled("gauge"));
            wrong(key, problem, "both say how large a stitch is: keep one");
        }
        for (k, keys) in [["width", "circumference"], ["height", "height"]].iter().enumerate() {
            if let Some(key) = keys.iter().find(|key| self.counted[k] && given("gauge") && given(key)) {
                let count = spelled(["stitches", "rows"][k]);
                let problem = format!("{}, {count} and {} are given", spelled(key), spelled("gauge"));
                wrong(key, problem, "two of them give the third");
            }
        }
        found
    }

    /// The knit with counts and stitches that make it so large, knitted of yarn of a thickness. Lengths of `knit` are as they
    /// were given, in diameters of the yarn; those of the result are in the knit's own unit.
    ///
    /// # Errors
    /// What cannot be knitted of such yarn is told, with what would fit.
    pub fn apply(&self, knit: &Knit, yarn: &Thickness) -> Result<Knit, Misfit> {
        let mut knit = knit.clone();
        let diameter = yarn.pressed();
        for length in [&mut knit.stitch_width, &mut knit.row_height, &mut knit.yarn_per_stitch] {
            *length = length.map(|l| l / yarn.unit());
        }
        if let Some([width, height]) = self.stitch {
            (knit.stitch_width, knit.row_height) = (Some(width / diameter), Some(height / diameter));
        }
        let [width, height] = [self.across().map(|w| w.0), self.height].map(|size| size.map(|mm| mm / diameter));
        let across = self.across().map_or("width", |(_, key)| key);
        // A size and a count give the stitch.
        if let (Some(width), true) = (width, self.counted[0]) {
            knit.stitch_width = Some(width / f64::from(knit.stitches));
        }
        if let (Some(height), true) = (height, self.counted[1]) {
            knit.row_height = Some(height / f64::from(knit.rows));
        }
        self.check(&knit, yarn)?;
        let open = [width.filter(|_| !self.counted[0]), height.filter(|_| !self.counted[1])];
        if open != [None, None] {
            let stitch = knit.gauge();
            let count = |key: &str, size: f64, own: f64, of: u32, least: u32| {
                let (least, of) = (f64::from(least.div_ceil(of.max(1))), f64::from(of.max(1)));
                let repeats = (size / own / of).round();
                if repeats < least {
                    let [size, smallest] = [size, least * of * own].map(|length| length * diameter);
                    let problem = format!("a {key} of {size:.3} mm has no room for the smallest such knit");
                    let hint = format!("it is {smallest:.1} mm");
                    return Err(Misfit { key: None, problem, hint });
                }
                if repeats * of > MOST {
                    let [size, most] = [size, MOST * own].map(|length| length * diameter);
                    let of_rows = key == "height";
                    let all = words::counted(MOST as u64, if of_rows { "row" } else { "stitch" });
                    let problem = format!("a {key} of {size:.3} mm takes more than {all}");
                    let hint = format!("at most {most:.1} mm");
                    return Err(Misfit { key: of_rows.then_some("height"), problem, hint });
                }
                Ok((repeats * of) as u32)
            };
            // Whole repeats, where rows do not fit otherwise or must close to a ring or a tile.
            let whole = knit.form.is_round() || !knit.chart.is_plain() || knit.edges == Edges::Tile;
            let wide = knit.chart.even_width(10_000).filter(|_| whole).unwrap_or(1);
            let high = if knit.edges == Edges::Tile { knit.chart.rows() } else { 1 };
            if let Some(width) = open[0] {
                // A ring of fewer cannot be laid.
                let least = if knit.form.is_round() { FEWEST_ROUND } else { 1 };
                knit.stitches = count(across, width, stitch[0], wide, least)?;
            }
            if let Some(height) = open[1] {
                knit.rows = count("height", height, stitch[1], high, 1)?;
                if let Some(ending) = self.ending {
                    knit.rows = ending.nearest((height / stitch[1]).min(MOST));
                }
                let fit = knit.chart.rows_that_fit(knit.stitches, knit.rows);
                // What is wrong within the chart is told of its row.
                if (knit.chart.rows()..knit.rows).contains(&fit) {
                    let [asked, high] = [height, f64::from(fit) * stitch[1]].map(|length| length * diameter);
                    return Err(Misfit {
                        key: Some("height"),
                        problem: format!(
                            "a height of {asked:.3} mm is {} rows, of which {fit} can be knitted of {}",
                            knit.rows,
                            words::counted(knit.stitches, "stitch")
                        ),
                        hint: format!("they are {high:.1} mm high; or cast on another number of stitches"),
                    });
                }
            }
        }
        Ok(knit)
    }

    /// Width of the piece or the way round it, with its name.
    fn across(&self) -> Option<(f64, &'static str)> {
        self.width.map(|w| (w, "width")).or(self.circumference.map(|c| (c, "circumference")))
    }

    /// Whether yarn of this thickness can be knitted so.
    fn check(&self, knit: &Knit, yarn: &Thickness) -> Result<(), Misfit> {
        let (d, unit) = (yarn.pressed(), yarn.unit());
        if let (Some(width), Some(height)) = (knit.stitch_width, knit.row_height) {
            fits_stitch(width, height, yarn)?;
        }
        let across = self.across().map_or("width", |(_, key)| key);
        let sides = [
            (knit.stitch_width, STITCH_WIDTHS, knit.stitches, ["stitches", across, "wide"]),
            (knit.row_height, ROW_HEIGHTS, knit.rows, ["rows", "height", "high"]),
        ];
        for ((size, [least, most], count, [counted, key, word]), usual) in sides.into_iter().zip(USUAL) {
            // Nothing holds beyond so many diameters of the yarn, however flat it is pressed.
            let most = most / unit;
            if let Some(size) = size.filter(|s| !(least..=most).contains(s)) {
                let noun = if counted == "rows" { "row" } else { "stitch" };
                let whole = size * f64::from(count) * d;
                let [size, least, most] = [size, least, most].map(|s| s * unit);
                return Err(Misfit {
                    key: Some(counted),
                    problem: format!(
                        "{} on a {key} of {whole:.1} mm are {size:.2} yarn diameters {word}; {} to {} can be knitted",
                        words::counted(count, noun),
                        rounded(least),
                        rounded(most)
                    ),
                    hint: format!(
                        "about {} in yarn {:.3} mm thick",
                        words::counted((whole / (usual * d)).round().clamp(1.0, MOST) as u64, noun),
                        yarn.diameter()
                    ),
                });
            }
        }
        match &knit.form {
            Form::Revolution(profile) => fits_profile(knit, &Revolution::new(profile), yarn),
            _ => Ok(()),
        }
    }
}

impl Form {
    /// A surface of revolution, for yarn of a radius in the unit of the profile.
    ///
    /// # Errors
    /// What is wrong with the profile.
    pub fn revolution(profile: Vec<DVec2>, radius: f64) -> Result<Self, String> {
        let [least, most] = [PROFILE_POINTS.start(), PROFILE_POINTS.end()];
        if !PROFILE_POINTS.contains(&profile.len()) {
            Err(format!("a profile has {least} to {most} points"))
        } else if profile.iter().any(|p| p.x < 0.0) {
            Err("the radius of a profile must be at least 0".to_owned())
        } else if profile.windows(2).any(|w| w[0].distance(w[1]) < CLOSEST_PROFILE_POINTS * radius) {
            Err("two points of the profile fall together".to_owned())
        } else {
            Ok(Self::Revolution(profile))
        }
    }
}

impl Knit {
    /// How large it came out.
    pub fn measures(&self, made: &Knitted) -> Measures {
        let height = made.gauge[1];
        let counts = self.widths().unwrap_or_default();
        let [fewest, most] = counts.iter().fold([self.stitches; 2], |[a, b], &row| [a.min(row), b.max(row)]);
        let (across, up) = match &self.form {
            Form::Revolution(profile) => {
                let surface = Revolution::new(profile);
                let step = surface.length() / f64::from(self.rows);
                let around = (0..self.rows).map(|row| TAU * surface.radius((f64::from(row) + 0.5) * step));
                (around.fold([f64::MAX, 0.0], |[a, b], way| [a.min(way), b.max(way)]), surface.length())
            }
            Form::Flat | Form::Tube => {
                let first = f64::from(self.stitches) * made.widths.first().unwrap_or(&made.gauge[0]);
                let wide = counts.iter().zip(&made.widths).map(|(count, width)| f64::from(*count) * width);
                (wide.fold([first; 2], |[a, b], row| [a.min(row), b.max(row)]), f64::from(self.rows) * height)
            }
        };
        Measures { stitches: [fewest, most], across, up }
    }

    /// Whether so many stitches and rows can be knitted in this form.
    ///
    /// # Errors
    /// They are too few, or too many.
    pub fn check_counts(&self) -> Result<(), Misfit> {
        let misfit = |problem: String, hint: &str| Misfit { key: Some("stitches"), problem, hint: hint.to_owned() };
        if self.control_points() > MAX_POINTS {
            let problem = format!("more than 2^{} control points", MAX_POINTS.ilog2());
            return Err(misfit(problem, "fewer stitches, rows or points"));
        }
        if self.form.is_round() && self.stitches < FEWEST_ROUND {
            let problem = format!("knitting in the round takes at least {FEWEST_ROUND} stitches");
            return Err(misfit(problem, "fewer are knitted flat"));
        }
        Ok(())
    }
}

/// Two digits behind the point, without zeros at the end.
fn rounded(x: f64) -> f64 {
    (100.0 * x).round() / 100.0
}

/// Whether yarn of a thickness makes stitches so wide and high, in units of the knit.
///
/// # Errors
/// They would have less yarn than a loop takes, or are too narrow or too low for it.
pub fn fits_stitch(width: f64, height: f64, yarn: &Thickness) -> Result<(), Misfit> {
    let d = yarn.pressed();
    let length = (STITCHES_PER_SQUARE * width * height).sqrt();
    if length >= SHORTEST && width >= STITCH_WIDTHS[0] && height >= ROW_HEIGHTS[0] {
        return Ok(());
    }
    let [across, up] = [width, height].map(|s| 100.0 / (s * d));
    // By how much finer the yarn has to be.
    let by = (FIRM / length).max(USUAL[0] / width).max(USUAL[1] / height);
    let radius = yarn.radius / by;
    let problem = format!(
        "a gauge of {across:.1} x {up:.1} in 10 cm is too dense for yarn {:.3} mm thick: a stitch of {:.3} x {:.3} mm takes \
         {:.1} diameters of yarn",
        yarn.diameter(),
        width * d,
        height * d,
        length * yarn.unit()
    );
    let hint = format!("at most {:.1} x {:.1}, or yarn of a radius of {radius:.3} mm", across / by, up / by);
    Err(Misfit { key: None, problem, hint })
}

/// Whether the rows of a knit fit the surface that they are spread over.
fn fits_profile(knit: &Knit, surface: &Revolution, yarn: &Thickness) -> Result<(), Misfit> {
    let (d, unit) = (yarn.pressed(), yarn.unit());
    // A chart that does not fit is told by who knits it.
    let Ok(widths) = knit.widths() else { return Ok(()) };
    let height = surface.length() / widths.len() as f64;
    let of_row = |(row, count): (usize, &u32)| {
        let round = TAU * surface.radius((row as f64 + 0.5) * height);
        (round / f64::from(*count) / d, row, round, *count)
    };
    let tightest = widths.iter().enumerate().map(of_row).min_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((width, row, round, count)) = tightest.filter(|t| t.0 < STITCH_WIDTHS[0]) {
        let most = (round / (3.0 * d)).floor().max(1.0);
        let radius = yarn.radius * width / 3.0;
        return Err(Misfit {
            key: None,
            problem: format!(
                "{count} stitches of row {} on a circumference of {round:.1} mm are {:.2} yarn diameters wide",
                row + 1,
                width * unit
            ),
            hint: format!(
                "about {} there, or yarn of a radius of {radius:.3} mm",
                words::counted(most as u64, "stitch")
            ),
        });
    }
    if height < ROW_HEIGHTS[0] * d {
        let most = (surface.length() / (2.2 * d)).floor();
        return Err(Misfit {
            key: None,
            problem: format!(
                "{} rows on a profile {:.1} mm long are {:.2} yarn diameters high",
                knit.rows,
                surface.length(),
                height / yarn.diameter()
            ),
            hint: format!("about {} in yarn {:.3} mm thick", words::counted(most as u64, "row"), yarn.diameter()),
        });
    }
    Ok(())
}
