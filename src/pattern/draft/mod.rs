//! Weaving drafts: at which crossings the warp lies over the weft. Weaves with a name are in `named`.

mod named;
mod repeat;

use std::fmt;

pub use named::NAMES;
pub use repeat::{MOST_CROSSINGS, Threads};

/// A repeat of a weave.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draft {
    warps: usize,
    /// Row by row from the bottom: whether the warp is on top.
    over: Vec<bool>,
    /// Cloths above each other that share the loom.
    layers: usize,
    /// Whether every even warp crosses to the other side of its right neighbour, below it, after each weft.
    crossing: bool,
    pile: Option<Pile>,
}

/// Yarns that stand up from the cloth where they float.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pile {
    /// 0 for warps, 1 for wefts.
    side: usize,
    /// Which of the repeat, and whether they stand at the back.
    yarns: Vec<(usize, bool)>,
    /// Whether floats are cut; else they are loops.
    pub cut: bool,
}

impl Pile {
    /// Whether a yarn of a side (0 warps, 1 wefts) stands up at the back; `None` if it does not stand up.
    pub fn stands(&self, side: usize, yarn: usize) -> Option<bool> {
        let found = self.yarns.iter().find(|(y, _)| *y == yarn && self.side == side);
        found.map(|(_, back)| *back)
    }
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

/// Largest side of a repeat.
const LARGEST: usize = 1024;

impl Draft {
    /// Itself, unless it is too large to be relaxed.
    fn limited(self) -> Result<Self, DraftError> {
        if self.over.len() <= MOST_CROSSINGS {
            return Ok(self);
        }
        let problem = format!("the smallest repeat of the draft is {} ends x {} picks", self.warps(), self.wefts());
        let hint = format!("at most {MOST_CROSSINGS} crossings are woven, as of 512 x 512");
        Err(DraftError { problem, hint })
    }

    pub(super) fn from_fn(warps: usize, wefts: usize, over: impl Fn(usize, usize) -> bool) -> Self {
        let over = (0..wefts).flat_map(|weft| (0..warps).map(move |warp| (weft, warp))).map(|(i, j)| over(i, j));
        Self { warps, over: over.collect(), layers: 1, crossing: false, pile: None }
    }

    /// All of a cloth as its repeat: for each pick from the bottom, for each end from the left, whether the end is on top.
    ///
    /// # Errors
    /// No crossings, rows of different lengths, more than [`MOST_CROSSINGS`].
    pub fn of_crossings(over: &[Vec<bool>]) -> Result<Self, DraftError> {
        let ends = over.first().map_or(0, Vec::len);
        if ends == 0 || over.iter().any(|row| row.len() != ends) {
            let problem = "a draft without crossings".to_owned();
            return Err(DraftError { problem, hint: "every pick crosses every end".to_owned() });
        }
        Self::from_fn(ends, over.len(), |weft, warp| over[weft][warp]).limited()
    }

    /// Some warps and wefts of a cloth of one layer, from `first` on, as a repeat of their own.
    pub(super) fn part(&self, first: [usize; 2], count: [usize; 2]) -> Self {
        Self::from_fn(count[0], count[1], |weft, warp| self.warp_over(first[1] + weft, first[0] + warp))
    }

    /// Cloth whose warps all change sides after so many picks, neighbours against each other: plain, or a rib.
    pub(super) fn rib(picks: usize) -> Self {
        Self::from_fn(2, 2 * picks, |weft, warp| (weft / picks + warp).is_multiple_of(2))
    }

    /// What a loom weaves: the shaft of each warp from the left, the shafts that each treadle raises, and the treadle of
    /// each weft from the bottom; shafts and treadles are counted from 1.
    ///
    /// # Errors
    /// Empty lists, treadles that are not tied up, repeats that are too large.
    pub fn from_loom(threading: &[u32], tie_up: &[Vec<u32>], treadling: &[u32]) -> Result<Self, DraftError> {
        let wrong = |problem: String| {
            DraftError {
            problem,
            hint: "as in { threading = [1, 2, 3, 4], tie_up = [[1, 2], [2, 3], [3, 4], [4, 1]], treadling = [1, 2, 3, 4] }"
                .to_owned(),
        }
        };
        for (list, length) in [("threading", threading.len()), ("tie_up", tie_up.len()), ("treadling", treadling.len())]
        {
            if !(1..=LARGEST).contains(&length) {
                return Err(wrong(format!("`{list}` has {length} entries; expected 1 to {LARGEST}")));
            }
        }
        if let Some(shaft) = tie_up.iter().flatten().find(|s| !threading.contains(s)) {
            return Err(wrong(format!("`tie_up` raises shaft {shaft}, on which `threading` has no warp")));
        }
        if let Some(treadle) = treadling.iter().find(|t| !(1..=tie_up.len()).contains(&(**t as usize))) {
            return Err(wrong(format!("`treadling` has treadle {treadle}; `tie_up` has 1 to {}", tie_up.len())));
        }
        let over = |weft: usize, warp: usize| tie_up[treadling[weft] as usize - 1].contains(&threading[warp]);
        Self::from_fn(threading.len(), treadling.len(), over).limited()
    }

    /// A weave as a picture of its right side, the top row first: `#` where the warp is on top, `.` where the weft is.
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
                    '#' => true,
                    '.' => false,
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
        Self { warps, over, layers: 1, crossing: false, pile: None }.limited()
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

    /// Cloths above each other that are woven at once: 1 but for double cloth.
    pub fn layers(&self) -> usize {
        self.layers
    }

    /// Whether warps are twined in pairs: every even one crosses below its right neighbour after each weft (leno).
    pub fn twines(&self) -> bool {
        self.crossing
    }

    /// Yarns that stand up, if any do.
    pub fn pile(&self) -> Option<&Pile> {
        self.pile.as_ref()
    }

    /// Whether wefts stand up and are cut.
    pub fn cut_wefts(&self) -> bool {
        self.pile.as_ref().is_some_and(|pile| pile.side == 1)
    }

    /// Yarns of a repeat that never change sides and so hold nothing: warps from the left, wefts from the bottom.
    pub fn loose(&self) -> [Vec<usize>; 2] {
        if self.crossing {
            return [Vec::new(), Vec::new()];
        }
        let (warps, wefts) = (self.warps(), self.wefts());
        let one_side = |mut sides: Box<dyn Iterator<Item = bool> + '_>| {
            let first = sides.next();
            sides.all(|side| Some(side) == first)
        };
        [
            (0..warps).filter(|&j| one_side(Box::new((0..wefts).map(move |i| self.warp_over(i, j))))).collect(),
            (0..wefts).filter(|&i| one_side(Box::new((0..warps).map(move |j| self.warp_over(i, j))))).collect(),
        ]
    }

    /// Which yarns hold nothing, counted from 1 and in words, if any do.
    pub fn loose_in_words(&self) -> Option<String> {
        const TOLD: usize = 8;
        let told = |(side, places): (&str, &Vec<usize>)| {
            let list: Vec<String> = places.iter().take(TOLD).map(|p| (p + 1).to_string()).collect();
            let more = if places.len() > TOLD { ", ..." } else { "" };
            (!places.is_empty()).then(|| format!("{side} {}{more}", list.join(", ")))
        };
        let loose: Vec<String> = ["warp", "weft"].into_iter().zip(&self.loose()).filter_map(told).collect();
        (!loose.is_empty()).then(|| {
            let (yarns, warps, wefts) = (loose.join(" and "), self.warps(), self.wefts());
            format!("this draft does not interlace: {yarns} of each {warps} x {wefts} never change sides")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_read_as_it_is_seen() {
        let draft = Draft::matrix(&["#..", "..#"]).unwrap();
        assert!(draft.warp_over(1, 0) && draft.warp_over(0, 2) && !draft.warp_over(0, 0));
        assert_eq!((draft.warps(), draft.wefts()), (3, 2));
    }

    #[test]
    fn mistakes_are_explained() {
        let too_many = |draft: Result<Draft, DraftError>| draft.is_err_and(|e| e.problem.contains("smallest repeat"));
        assert!(too_many(Draft::matrix(&vec!["#".repeat(600); 600])));
        let every: Vec<u32> = (1..=600).collect();
        assert!(too_many(Draft::from_loom(&every, &vec![vec![1]; 600], &every)));
        for name in ["basket 512", "satin 1023", "herringbone 300/300", "twill 600/2", "honeycomb 600"] {
            assert!(too_many(Draft::named(name)), "{name}");
        }
        for (rows, problem) in [
            (&["#a"][..], "expected # or . in a draft, found 'a'"),
            (&["#x"], "expected # or . in a draft, found 'x'"),
            (&["##", "#"], "the rows of a draft must be equally long and at most 1024"),
            (&[""], "a draft without crossings"),
            (&[], "a draft without crossings"),
        ] {
            assert_eq!(Draft::matrix(rows).unwrap_err().problem, problem);
        }
    }

    #[test]
    fn a_loom_weaves_what_it_is_told() {
        let tie_up = [vec![1, 2], vec![2, 3], vec![3, 4], vec![4, 1]];
        let twill = Draft::from_loom(&[1, 2, 3, 4], &tie_up, &[1, 2, 3, 4]).unwrap();
        assert_eq!(twill, Draft::matrix(&["#..#", "..##", ".##.", "##.."]).unwrap());
        for (threading, tie_up, treadling, problem) in [
            (
                &[1, 2][..],
                &[vec![1], vec![3]][..],
                &[1][..],
                "`tie_up` raises shaft 3, on which `threading` has no warp",
            ),
            (&[1, 2], &[vec![1], vec![2]], &[1, 3], "`treadling` has treadle 3; `tie_up` has 1 to 2"),
            (&[1], &[], &[1], "`tie_up` has 0 entries; expected 1 to 1024"),
        ] {
            assert_eq!(Draft::from_loom(threading, tie_up, treadling).unwrap_err().problem, problem);
        }
    }

    #[test]
    fn yarns_that_do_not_interlace_are_found() {
        let none: Vec<usize> = Vec::new();
        assert_eq!(Draft::matrix(&["#.#", ".##"]).unwrap().loose(), [vec![2], none.clone()]);
        assert_eq!(Draft::matrix(&["#.", ".#", ".."]).unwrap().loose(), [none, vec![0]]);
        assert_eq!(Draft::matrix(&["#"]).unwrap().loose(), [vec![0], vec![0]]);
    }
}
