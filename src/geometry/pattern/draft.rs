//! Weaving drafts: at which crossings the warp lies over the weft.

use std::fmt;

/// A repeat of a weave.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draft {
    warps: usize,
    /// Row by row from the bottom: whether the warp is on top.
    over: Vec<bool>,
}

/// Why text is no draft: what is wrong and what to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DraftError {
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub hint: String,
}

impl fmt::Display for DraftError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.problem, self.hint)
    }
}

impl std::error::Error for DraftError {}

/// Largest repeat of a named weave, and largest side of a matrix.
const LARGEST: usize = 1024;
const NAMES: &str = "weaves are plain, basket 2, twill 2/1, satin 5, satin 8/3 and sateen 5";

impl Draft {
    fn from_fn(warps: usize, wefts: usize, over: impl Fn(usize, usize) -> bool) -> Self {
        let over = (0..wefts).flat_map(|weft| (0..warps).map(move |warp| (weft, warp))).map(|(i, j)| over(i, j));
        Self { warps, over: over.collect() }
    }

    /// A weave by its name: `plain`, `basket N`, `twill N/M` (each warp goes over N wefts and under M, one weft later
    /// than its left neighbour), `satin N` or `satin N/STEP` (over all but one of N wefts), `sateen N` (the weft's side
    /// of it).
    ///
    /// # Errors
    /// No such weave, or numbers that make none.
    pub fn named(text: &str) -> Result<Self, DraftError> {
        let wrong = |problem: String| DraftError { problem, hint: NAMES.to_owned() };
        let (name, numbers) = text.trim().split_once(' ').unwrap_or((text.trim(), ""));
        let numbers: Option<Vec<usize>> = if numbers.trim().is_empty() {
            Some(Vec::new())
        } else {
            numbers.split('/').map(|n| n.trim().parse().ok().filter(|n| (1..=LARGEST).contains(n))).collect()
        };
        let unknown = || {
            let shown: String = text.chars().take(30).collect();
            wrong(format!("unknown weave \"{}\"", shown.escape_debug()))
        };
        match (name, numbers.ok_or_else(unknown)?.as_slice()) {
            ("plain", []) => Ok(Self::from_fn(2, 2, |i, j| (i + j) % 2 == 0)),
            ("basket", &[n]) => Ok(Self::from_fn(2 * n, 2 * n, |i, j| (i / n + j / n) % 2 == 0)),
            ("twill", &[n, m]) => Ok(Self::from_fn(n + m, n + m, |i, j| (i + n + m - j) % (n + m) < n)),
            ("satin" | "sateen", &[n, ref rest @ ..]) if rest.len() <= 1 => {
                let coprime = |step: usize| (1..=n).all(|d| d == 1 || !n.is_multiple_of(d) || !step.is_multiple_of(d));
                // The usual step: neither neighbours, and as even as it gets.
                let even =
                    || (2..n.saturating_sub(1)).filter(|&s| coprime(s)).min_by_key(|&s| (s * s % n).abs_diff(n - 1));
                let step = rest.first().copied().or_else(even);
                match step {
                    Some(step) if n >= 5 && step > 1 && step + 1 < n && coprime(step) => {
                        Ok(Self::from_fn(n, n, |i, j| ((i * step) % n == j) == (name == "sateen")))
                    }
                    _ => Err(wrong(format!("no {name} has a repeat of {n} and this step"))),
                }
            }
            _ => Err(unknown()),
        }
    }

    /// A weave as a picture of its right side, the top row first: `#`, `x` or `1` where the warp is on top, `.`, `-` or
    /// `0` where the weft is.
    ///
    /// # Errors
    /// Other characters, rows of different lengths, nothing at all.
    pub fn matrix(rows: &[impl AsRef<str>]) -> Result<Self, DraftError> {
        let wrong =
            |problem: String| DraftError { problem, hint: "as in draft = [\"#..\", \".#.\", \"..#\"]".to_owned() };
        let mut over = Vec::new();
        let mut warps = 0;
        if rows.len() > LARGEST {
            return Err(wrong(format!("a draft of more than {LARGEST} rows")));
        }
        for (i, row) in rows.iter().rev().enumerate() {
            let row = row.as_ref();
            for c in row.chars() {
                over.push(match c {
                    '#' | 'x' | 'X' | '1' => true,
                    '.' | '-' | '0' => false,
                    other => {
                        return Err(wrong(format!("expected # or . in a draft, found '{}'", other.escape_debug())));
                    }
                });
            }
            let width = over.len() / (i + 1);
            if i == 0 {
                warps = width;
            }
            if over.len() != warps * (i + 1) || warps > LARGEST {
                return Err(wrong(format!("the rows of a draft must be equally long and at most {LARGEST}")));
            }
        }
        if warps == 0 {
            return Err(wrong("a draft without crossings".to_owned()));
        }
        Ok(Self { warps, over })
    }

    /// Warps of a repeat.
    pub fn warps(&self) -> usize {
        self.warps
    }

    /// Wefts of a repeat.
    pub fn wefts(&self) -> usize {
        self.over.len() / self.warps
    }

    /// Whether the warp is on top; both counted from 0, the draft repeats.
    pub fn warp_over(&self, weft: usize, warp: usize) -> bool {
        self.over[(weft % self.wefts()) * self.warps + warp % self.warps]
    }

    /// Share of crossings with the warp on top.
    pub fn warp_share(&self) -> f64 {
        self.over.iter().filter(|o| **o).count() as f64 / self.over.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_twill_rises_to_the_right() {
        let twill = Draft::named("twill 2/1").unwrap();
        assert_eq!(twill, Draft::matrix(&[".##", "##.", "#.#"]).unwrap());
        for i in 0..6 {
            for j in 0..6 {
                assert_eq!(twill.warp_over(i, j), twill.warp_over(i + 1, j + 1));
            }
        }
        assert_eq!((0..3).filter(|&i| twill.warp_over(i, 0)).count(), 2);
    }

    #[test]
    fn satins_scatter_their_crossings() {
        for (name, n) in [("satin 5", 5), ("satin 8", 8), ("satin 8/3", 8), ("satin 7/2", 7)] {
            let satin = Draft::named(name).unwrap();
            for i in 0..n {
                let under: Vec<usize> = (0..n).filter(|&j| !satin.warp_over(i, j)).collect();
                assert_eq!(under.len(), 1, "{name}");
                let next = (0..n).find(|&j| !satin.warp_over(i + 1, j)).unwrap();
                assert!(!matches!((next + n - under[0]) % n, 0 | 1) && (next + n - under[0]) % n != n - 1, "{name}");
            }
        }
        let sateen = Draft::named("sateen 5").unwrap();
        assert_eq!(sateen.warp_share(), 0.2);
    }

    #[test]
    fn a_matrix_is_read_as_it_is_seen() {
        let draft = Draft::matrix(&["#..", "..#"]).unwrap();
        assert!(draft.warp_over(1, 0) && draft.warp_over(0, 2) && !draft.warp_over(0, 0));
        assert_eq!((draft.warps(), draft.wefts()), (3, 2));
    }

    #[test]
    fn mistakes_are_explained() {
        for text in
            ["", "twill", "twill 2", "twill 0/1", "twill 2/x", "plane", "satin 4", "satin 6", "satin 8/2", "plain 3"]
        {
            assert!(Draft::named(text).is_err(), "{text}");
        }
        assert_eq!(Draft::named("plane").unwrap_err().problem, "unknown weave \"plane\"");
        for (rows, problem) in [
            (&["#a"][..], "expected # or . in a draft, found 'a'"),
            (&["##", "#"], "the rows of a draft must be equally long and at most 1024"),
            (&[""], "a draft without crossings"),
            (&[], "a draft without crossings"),
        ] {
            assert_eq!(Draft::matrix(rows).unwrap_err().problem, problem);
        }
    }
}
