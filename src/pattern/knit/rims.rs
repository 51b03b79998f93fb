//! How a finished piece is cast on, and how its top is closed.

use std::f64::consts::TAU;

use glam::DVec2;

use super::{
    super::chart::{ChartError, Stitch},
    Knit,
};

/// How a piece is cast on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CastOn {
    /// Twisted loops over the needle.
    #[default]
    LongTail,
    /// Each loop is drawn out between the two before it: a rope.
    Cable,
}

impl CastOn {
    /// All by name.
    pub const NAMES: [(&'static str, Self); 2] = [("long-tail", Self::LongTail), ("cable", Self::Cable)];
}

/// How the last row is closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Closing {
    /// Each stitch is drawn through the one before it.
    #[default]
    BoundOff,
    /// The yarn goes once through all loops and is drawn tight, its tail inside; of what is knitted round.
    Drawn,
}

impl Closing {
    /// All by name.
    pub const NAMES: [(&'static str, Self); 2] = [("bound-off", Self::BoundOff), ("drawn", Self::Drawn)];
}

/// Both rims of a finished piece.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rims {
    /// The first edge.
    pub cast_on: CastOn,
    /// The last one.
    pub top: Closing,
}

/// Fewest and most loops that can be drawn together: more leave a hole wider than two diameters.
const DRAWN: std::ops::RangeInclusive<usize> = 3..=16;

/// Radius of a ring of yarn drawn through so many loops, in diameters: heads lie side by side inside of it.
fn ring(count: usize) -> f64 {
    count as f64 / TAU + 1.0
}

/// A profile, in diameters, that ends where the last row is drawn together: what is given, gone on with to there, or a tube
/// that is round at its top.
///
/// # Errors
/// What cannot be drawn together: flat pieces, open edges, too many loops, a tube that is too short.
pub(super) fn drawn(knit: &Knit, given: Option<Vec<DVec2>>, rows: &[Vec<Stitch>]) -> Result<Vec<DVec2>, ChartError> {
    let wrong = |problem: String, hint: &str| Err(ChartError::new(None, problem, hint));
    if !knit.form.is_round() || !knit.is_finished() {
        let problem = "only the last row of a finished tube or revolution is drawn together";
        return wrong(problem.to_owned(), "top = \"bound-off\", or another `form` and `edges = \"finished\"`");
    }
    let count = rows.last().map_or(0, Vec::len);
    if !DRAWN.contains(&count) {
        let problem = format!("{count} stitches of the last row cannot be drawn together");
        return wrong(problem, "3 to 16 can: decrease to so many before");
    }
    let radius = ring(count);
    let Some(mut profile) = given else { return tube(knit, rows.len(), radius) };
    if let [.., before, last] = profile[..]
        && last.x > radius + 0.5
    {
        const STEEPEST: f64 = 0.5;
        let slope = (last.y - before.y) / (before.x - last.x).max(1e-3);
        let rise = slope.clamp(-STEEPEST, STEEPEST) * (last.x - radius);
        profile.push(DVec2::new(radius, last.y + rise));
    }
    Ok(profile)
}

/// A tube that is rounded to a ring at its top, which is flat where rows are few.
fn tube(knit: &Knit, rows: usize, radius: f64) -> Result<Vec<DVec2>, ChartError> {
    const STEPS: u32 = 8;
    /// How high the rounding is at least, over how far it goes inwards.
    const FLATTEST: f64 = 0.3;
    let [width, height] = knit.gauge();
    let (wide, long) = (width * f64::from(knit.stitches) / TAU, height * rows as f64);
    let round = (wide - radius).max(0.0);
    // A quarter of an ellipse's outline, after Ramanujan; one row of the tube goes straight up.
    let arc_length =
        |high: f64| 0.125 * TAU * (3.0 * (round + high) - ((3.0 * round + high) * (round + 3.0 * high)).sqrt());
    let fits = |high: f64| arc_length(high) + height <= long;
    if !fits(FLATTEST * round) {
        let least = (arc_length(FLATTEST * round) / height).ceil() + 1.0;
        let problem = format!("a tube of {rows} rows is too short to be drawn together");
        return Err(ChartError::new(None, problem, format!("{least} rows or more")));
    }
    let mut high = round;
    if !fits(round) {
        let mut low = FLATTEST * round;
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            *if fits(middle) { &mut low } else { &mut high } = middle;
        }
        high = low;
    }
    let straight = long - arc_length(high);
    let arc = (1..=STEPS).map(|k| {
        let (sin, cos) = (0.25 * TAU * f64::from(k) / f64::from(STEPS)).sin_cos();
        DVec2::new(radius + round * cos, straight + high * sin)
    });
    // Points as close as those of the arc: between far and near ones a smooth curve would swing.
    let count = (straight * f64::from(STEPS) / arc_length(high).max(1.0)).ceil().clamp(1.0, 2000.0) as u32;
    let up = (0..=count).map(|k| DVec2::new(wide, straight * f64::from(k) / f64::from(count)));
    Ok(up.chain(arc).collect())
}
