//! The words of a chart's row.

use super::{ChartError, PATTERNS, Step, Top};
use crate::input::diagnostic::excerpt;

/// Most steps of a row that a chart may have.
const MOST_STEPS: usize = 20_000;
/// Most stitches in a cable.
pub(in super::super) const WIDEST_CABLE: u8 = 24;
const STEPS: &str = "steps are k, p, k4, p2, ktbl, ptbl, yo, k2tog, ssk, p2tog, ssp, k3tog, sssk, cdd, p3tog, sssp, cddp, \
                     kfb, pfb, m1l, m1r, m1lp, m1rp, \
                     sl, slwyif, miss, tuck, c4f, c4b, t3f, t3b, 2/1lc, 2/1rpc, mb, bo4, bop4, co4, -, ds, with spaces between them";

/// The steps of a row.
pub(super) fn parse_steps(text: &str, line: usize) -> Result<Vec<Step>, ChartError> {
    let mut steps = Vec::new();
    for token in text.split([' ', ',', '\t']).filter(|t| !t.is_empty()) {
        // Books write `K2 P2` and `C4F`.
        let word = token.to_ascii_lowercase();
        let (count, step) = parse_step(&word).map_err(|wrong| {
            let shown = excerpt(token, 20);
            let (problem, hint) = match wrong {
                Wrong::Count => ("no step", format!("steps are counted from 1 to {MOST_STEPS}")),
                Wrong::Cable => ("no cable", format!("cables have 2 to {WIDEST_CABLE} stitches")),
                Wrong::Unknown if PATTERNS.iter().any(|(name, _)| *name == word) => {
                    let hint = "that is the name of a pattern: pattern =";
                    ("unknown step", format!("{hint} \"{word}\" in a scene, `--pattern {word}` of `make knit`"))
                }
                Wrong::Unknown => ("unknown step", STEPS.to_owned()),
            };
            ChartError::new(Some(line), format!("{problem} \"{shown}\""), hint)
        })?;
        if steps.len() + count > MOST_STEPS {
            return Err(ChartError::new(Some(line), format!("more than {MOST_STEPS} steps in a row"), "steps repeat"));
        }
        steps.extend(std::iter::repeat_n(step, count));
    }
    if steps.iter().all(|s| s.takes_and_makes().0 == 0) {
        return Err(ChartError::new(Some(line), "a row that takes no stitch of the row below", STEPS));
    }
    Ok(steps)
}

/// What is wrong with a word.
enum Wrong {
    /// It is no step.
    Unknown,
    /// It is a step, so often as none is.
    Count,
    /// It is a cable of no width that there is.
    Cable,
}

fn parse_step(token: &str) -> Result<(usize, Step), Wrong> {
    let plain = |purl, twisted| Step::Plain { purl, twisted };
    let together = |take, purl, top| Step::Together { take, purl, top };
    let named = match token {
        "k2tog" => together(2, false, Top::Left),
        "ssk" | "skp" => together(2, false, Top::Right),
        "p2tog" => together(2, true, Top::Left),
        "ssp" => together(2, true, Top::Right),
        "k3tog" => together(3, false, Top::Left),
        "sssk" | "sk2p" => together(3, false, Top::Right),
        "p3tog" => together(3, true, Top::Left),
        "cdd" | "s2kp" => together(3, false, Top::Middle),
        "sssp" => together(3, true, Top::Right),
        "cddp" => together(3, true, Top::Middle),
        "kfb" => Step::FrontBack { purl: false },
        "pfb" => Step::FrontBack { purl: true },
        "yo" => Step::YarnOver,
        "m1l" | "m1" => Step::MakeOne { left: true, purl: false },
        "m1r" => Step::MakeOne { left: false, purl: false },
        "m1lp" | "m1p" => Step::MakeOne { left: true, purl: true },
        "m1rp" => Step::MakeOne { left: false, purl: true },
        "mb" | "bobble" => Step::Bobble,
        _ => {
            let cable = parse_cable(token).map(|cable| cable.map(|step| (1, step)));
            return cable.or_else(|| parse_counted(token, &plain)).unwrap_or(Err(Wrong::Unknown));
        }
    };
    Ok((1, named))
}

/// Steps that may be counted: `k4`, `sl2`, `ktbl3`, `bo4`.
fn parse_counted(token: &str, plain: &dyn Fn(bool, bool) -> Step) -> Option<Result<(usize, Step), Wrong>> {
    let word = token.trim_end_matches(|c: char| c.is_ascii_digit());
    let step = match word {
        "k" | "brk" => plain(false, false),
        "p" | "brp" => plain(true, false),
        "ktbl" => plain(false, true),
        "ptbl" => plain(true, true),
        "sl" | "slwyib" | "miss" => Step::Slip { front: false },
        "slwyif" => Step::Slip { front: true },
        "tuck" | "sl1yo" | "ds" => Step::Tuck,
        "bo" => Step::BindOff { purl: false },
        "bop" => Step::BindOff { purl: true },
        "co" => Step::CastOn,
        "-" => Step::Unworked,
        _ => return None,
    };
    let digits = &token[word.len()..];
    let count = if digits.is_empty() { Some(1) } else { digits.parse().ok() };
    Some(count.filter(|n| (1..=MOST_STEPS).contains(n)).map(|count| (count, step)).ok_or(Wrong::Count))
}

/// `c4f`, `t3b`, `2/1lc`, `2/2rpc`.
fn parse_cable(token: &str) -> Option<Result<Step, Wrong>> {
    let cable = |front: u32, back: u32, left, purl| {
        let fits = front > 0 && back > 0 && front.saturating_add(back) <= WIDEST_CABLE.into();
        let step = Step::Cable { front: front as u8, back: back as u8, left, purl };
        Some(if fits { Ok(step) } else { Err(Wrong::Cable) })
    };
    // More digits than fit are more stitches than fit.
    let number = |digits: &str| {
        let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
        is_number.then(|| digits.parse().unwrap_or(u32::MAX))
    };
    if let Some((front, rest)) = token.split_once('/') {
        let word = rest.trim_start_matches(|c: char| c.is_ascii_digit());
        let back = number(&rest[..rest.len() - word.len()])?;
        let (left, purl) = match word {
            "lc" => (true, false),
            "rc" => (false, false),
            "lpc" => (true, true),
            "rpc" => (false, true),
            _ => return None,
        };
        return cable(number(front)?, back, left, purl);
    }
    let purl = token.starts_with('t');
    let left = token.ends_with('f');
    let size = number(token.strip_prefix(['c', 't'])?.strip_suffix(['f', 'b'])?)?;
    cable(size.div_ceil(2), size / 2, left, purl)
}
