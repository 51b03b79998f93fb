//! Which numbers are allowed.

use std::fmt;

/// Which numbers are allowed. Not-a-number and infinity never are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    low: Limit,
    high: Limit,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Limit {
    None,
    Including(f64),
    Excluding(f64),
}

impl Range {
    /// Every number.
    pub(crate) const FINITE: Range = Range { low: Limit::None, high: Limit::None };
    /// Above 0.
    pub(crate) const POSITIVE: Range = Range::above(0.0);
    /// A coordinate: what single precision holds with room for squares, in any unit.
    pub(crate) const PLACE: Range = Range::between(-1e12, 1e12);
    /// From 0 to 1, both included.
    pub(crate) const UNIT: Range = Range::between(0.0, 1.0);

    /// `low` and larger numbers.
    pub(crate) const fn at_least(low: f64) -> Range {
        Range { low: Limit::Including(low), high: Limit::None }
    }

    /// Numbers larger than `low`.
    pub(crate) const fn above(low: f64) -> Range {
        Range { low: Limit::Excluding(low), high: Limit::None }
    }

    /// From `low` to `high`, both included.
    pub(crate) const fn between(low: f64, high: f64) -> Range {
        Range { low: Limit::Including(low), high: Limit::Including(high) }
    }

    /// This range up to `high`, included.
    pub(crate) const fn and_at_most(self, high: f64) -> Range {
        Range { low: self.low, high: Limit::Including(high) }
    }

    /// This range up to but without `high`.
    pub(crate) const fn and_below(self, high: f64) -> Range {
        Range { low: self.low, high: Limit::Excluding(high) }
    }

    /// Whether the number is allowed.
    pub(crate) fn contains(&self, value: f64) -> bool {
        let above_low = match self.low {
            Limit::None => true,
            Limit::Including(low) => value >= low,
            Limit::Excluding(low) => value > low,
        };
        let below_high = match self.high {
            Limit::None => true,
            Limit::Including(high) => value <= high,
            Limit::Excluding(high) => value < high,
        };
        value.is_finite() && above_low && below_high
    }
}

/// The range in words, to stand after "must be": "at least 0", "above 0", "from 0 to 1", "finite".
impl fmt::Display for Range {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.low, self.high) {
            (Limit::Including(low), Limit::Including(high)) => return write!(formatter, "from {low} to {high}"),
            (Limit::None, Limit::None) => return write!(formatter, "finite"),
            _ => {}
        }
        match self.low {
            Limit::None => {}
            Limit::Including(low) => write!(formatter, "at least {low}")?,
            Limit::Excluding(low) => write!(formatter, "above {low}")?,
        }
        if self.low != Limit::None && self.high != Limit::None {
            write!(formatter, " and ")?;
        }
        match self.high {
            Limit::None => Ok(()),
            Limit::Including(high) => write!(formatter, "at most {high}"),
            Limit::Excluding(high) => write!(formatter, "below {high}"),
        }
    }
}

/// A number as a user would write it.
pub(super) fn number_text(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-5..1e16).contains(&size) && size.is_finite() {
        format!("{value:e}")
    } else {
        // TOML's own spelling of what Rust calls NaN.
        format!("{value}").replace("NaN", "nan")
    }
}
