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

/// That the last row of a piece may be drawn together; gives the radius of the ring of its loops, in diameters.
///
/// # Errors
/// What cannot be: flat pieces, open edges, too many loops.
pub(super) fn drawn_to(knit: &Knit, rows: &[Vec<Stitch>]) -> Result<f64, ChartError> {
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
    Ok(ring(count))
}

/// A profile, in diameters, that goes on as far as the ring to which the last row is drawn together.
pub(super) fn drawn(mut profile: Vec<DVec2>, ring: f64) -> Vec<DVec2> {
    if let [.., before, last] = profile[..]
        && last.x > ring + 0.5
    {
        const STEEPEST: f64 = 0.5;
        let slope = (last.y - before.y) / (before.x - last.x).max(1e-3);
        let rise = slope.clamp(-STEEPEST, STEEPEST) * (last.x - ring);
        profile.push(DVec2::new(ring, last.y + rise));
    }
    profile
}
