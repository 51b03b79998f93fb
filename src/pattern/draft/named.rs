//! Weaves with a name.

use super::{Draft, DraftError, LARGEST, Pile};
use crate::input::diagnostic::{excerpt, listed, nearest};

/// How each weave with a name is written.
pub const NAMES: &[&str] = &[
    "plain",
    "basket 2",
    "basket 3/2",
    "twill 2/1",
    "twill 2/2 left",
    "twill 3/2 step 2",
    "herringbone",
    "herringbone 2/2 8",
    "houndstooth",
    "satin 5",
    "satin 8/3",
    "sateen 5",
    "huck",
    "honeycomb",
    "honeycomb 10",
    "leno",
    "double cloth",
    "terry",
    "velvet",
    "corduroy",
];

/// Words and numbers of a name.
struct Words<'a> {
    name: String,
    /// Groups of numbers with slashes.
    groups: Vec<Vec<usize>>,
    left: bool,
    step: Option<usize>,
    text: &'a str,
}

impl<'a> Words<'a> {
    /// Reads them; what is wrong with a number is told, `None` is of what is no name of a weave.
    fn read(text: &'a str) -> Result<Self, Option<DraftError>> {
        let mut words = Self { name: String::new(), groups: Vec::new(), left: false, step: None, text };
        let mut parts = text.split_whitespace();
        while let Some(part) = parts.next() {
            let part = part.to_lowercase();
            let part = part.as_str();
            let number = |n: &str| match n.parse() {
                Ok(n) if (1..=LARGEST).contains(&n) => Ok(n),
                _ if n.is_empty() || n.contains(|c: char| !c.is_ascii_digit()) => Err(None),
                _ => {
                    let problem = format!("{n} in the weave \"{}\"", excerpt(text, 30));
                    Err(Some(wrong(problem, format!("numbers are from 1 to {LARGEST}"))))
                }
            };
            match part {
                "left" => words.left = true,
                "right" => words.left = false,
                "step" => words.step = Some(number(parts.next().unwrap_or_default())?),
                _ if part.starts_with(|c: char| c.is_ascii_digit()) => {
                    words.groups.push(part.split('/').map(number).collect::<Result<_, _>>()?);
                }
                _ => {
                    if !words.name.is_empty() {
                        words.name.push(' ');
                    }
                    words.name.push_str(part);
                }
            }
        }
        Ok(words)
    }

    /// Whether there are words that only twills have.
    fn turned(&self) -> bool {
        self.left || self.step.is_some()
    }
}

fn wrong(problem: String, hint: String) -> DraftError {
    DraftError { problem, hint }
}

fn coprime(n: usize, step: usize) -> bool {
    (2..=n).all(|d| !n.is_multiple_of(d) || !step.is_multiple_of(d))
}

/// Steps of a satin: not to a neighbour, and every warp is reached.
fn satin_steps(shafts: usize) -> Vec<usize> {
    (2..shafts.saturating_sub(1)).filter(|&step| coprime(shafts, step)).collect()
}

fn satin(name: &str, shafts: usize, step: Option<usize>) -> Result<Draft, DraftError> {
    let steps = satin_steps(shafts);
    if steps.is_empty() {
        let problem = format!("there is no {name} of {shafts} shafts");
        return Err(wrong(problem, format!("a {name} has 5 shafts or more, but not 6")));
    }
    // The usual step is as even as it gets: its multiples go from corner to corner of a square.
    let even = || steps.iter().copied().min_by_key(|&s| (s * s % shafts).abs_diff(shafts - 1));
    let step = step.or_else(even).unwrap_or(0);
    if !steps.contains(&step) {
        let list: Vec<String> = steps.iter().take(20).map(usize::to_string).collect();
        let problem = format!("there is no {name} of {shafts} shafts and step {step}");
        return Err(wrong(problem, format!("steps of {shafts} shafts are {}", list.join(", "))));
    }
    Ok(Draft::from_fn(shafts, shafts, |i, j| ((i * step) % shafts == j) == (name == "sateen")))
}

/// Over and under in turns: which of `floats` a place is in.
fn floats_up(floats: &[usize], place: usize) -> bool {
    let mut left = place;
    for (index, &float) in floats.iter().enumerate() {
        if left < float {
            return index % 2 == 0;
        }
        left -= float;
    }
    false
}

fn herringbone(floats: &[usize], ends: usize) -> Draft {
    let n: usize = floats.iter().sum();
    Draft::from_fn(2 * ends, n, |i, j| {
        // It turns where neighbours are opposite, half a repeat on.
        let rise = if j < ends { j } else { n * ends + ends - 1 + n - n / 2 - (j - ends) };
        floats_up(floats, (i + n * (ends + 2) - rise % n) % n)
    })
}

/// Huckaback: plain weave in blocks of five by five, in which two warps or two wefts float in turns.
fn huck() -> Draft {
    Draft::from_fn(10, 10, |i, j| {
        let (a, b) = (i % 5, j % 5);
        let plain = (a + b) % 2 == 0;
        if (i / 5 + j / 5) % 2 == 0 { b % 2 == 1 || plain } else { a % 2 == 0 && plain }
    })
}

/// Diamonds with floats that shorten towards their middle line: warp floats in one, weft floats in the next.
fn honeycomb(n: usize) -> Draft {
    Draft::from_fn(n, n, |i, j| {
        let (a, b) = (i.min(n - i), j.min(n - j));
        a == b || a > b + 1
    })
}

/// Two plain weaves above each other, every other warp and weft in each.
fn double_cloth() -> Draft {
    let draft = Draft::from_fn(4, 4, |i, j| {
        let plain = (i / 2 + j / 2) % 2 == 0;
        match (i % 2, j % 2) {
            (0, 0) | (1, 1) => plain,
            // Face warps are above wefts of the back.
            (_, face) => face == 0,
        }
    });
    Draft { layers: 2, ..draft }
}

/// Terry of three picks: between two ends of the ground one makes loops on the face and one on the back.
fn terry() -> Draft {
    let rows = [
        [true, true, false, false, true, false],
        [true, false, true, false, false, true],
        [false, true, false, true, true, false],
    ];
    let draft = Draft::from_fn(6, 3, |i, j| rows[i][j]);
    let yarns = vec![(1, false), (2, true), (4, false), (5, true)];
    Draft { pile: Some(Pile { side: 0, yarns, cut: false }), ..draft }
}

/// Plain ground; every other warp is held below every other weft and cut between.
fn velvet() -> Draft {
    let draft = Draft::from_fn(4, 2, |i, j| if j % 2 == 0 { i == j / 2 } else { i != j / 2 });
    Draft { pile: Some(Pile { side: 0, yarns: vec![(1, false), (3, false)], cut: true }), ..draft }
}

/// Plain ground; two wefts after each ground weft float over three warps, are each held by one, the second by the neighbour of
/// the first's, and cut between: wales stand where they are held.
fn corduroy() -> Draft {
    let draft = Draft::from_fn(4, 6, |i, j| if i % 3 == 0 { (i / 3 + j) % 2 == 0 } else { j == i % 3 - 1 });
    let yarns = [1, 2, 4, 5].map(|i| (i, false)).to_vec();
    Draft { pile: Some(Pile { side: 1, yarns, cut: true }), ..draft }
}

impl Draft {
    /// A weave by its name; [`NAMES`] shows each: `basket N` or `basket M/N` (groups of warps and of wefts), `twill N/M`
    /// (each warp goes over N wefts and under M, and further pairs, one weft later than its left neighbour, or `step S`
    /// wefts; `left` rises to the left), `herringbone N/M ENDS` (turns after so many ends), `satin N` or `satin N/STEP`
    /// (over all but one of N wefts), `sateen N` (the weft's side of it), `honeycomb N` (N ends and wefts).
    ///
    /// ```
    /// use yarnray::pattern::{draft::Draft, weave::{Extent, Weave}};
    ///
    /// let twill = Draft::named("twill 2/2").unwrap();
    /// assert_eq!((twill.warps(), twill.wefts()), (4, 4));
    /// let cloth = Weave { warps: Extent::Yarns(12), wefts: Extent::Yarns(8), ..Weave::of(twill, 0.2) };
    /// assert_eq!(cloth.strands().unwrap().len(), 12 + 8);
    ///
    /// // A satin of six shafts would not be one; the message lists those that exist.
    /// assert!(Draft::named("satin 6").is_err());
    /// ```
    ///
    /// # Errors
    /// No such weave, or numbers that make none.
    pub fn named(text: &str) -> Result<Self, DraftError> {
        let unknown = || {
            let problem = format!("unknown weave \"{}\"", excerpt(text, 30));
            // Numbers are the user's own.
            let word = |name: &str| name.trim_end_matches(|c: char| !c.is_alphabetic()).to_lowercase();
            let known: Vec<String> = NAMES.iter().map(|name| word(name)).collect();
            let hint = match nearest(&word(text), known.iter().map(String::as_str)) {
                Some(name) if name != word(text) => format!("did you mean \"{name}\"?"),
                Some(name) if !name.is_empty() => {
                    let own = NAMES.iter().filter(|known| known.split(' ').next() == name.split(' ').next());
                    format!("it is written as {}", listed(own.map(|known| format!("\"{known}\"")), "or"))
                }
                _ => format!("weaves are {}", NAMES.join(", ")),
            };
            wrong(problem, hint)
        };
        let words = Words::read(text).map_err(|problem| problem.unwrap_or_else(unknown))?;
        let groups: Vec<&[usize]> = words.groups.iter().map(Vec::as_slice).collect();
        if words.turned() && words.name != "twill" {
            return Err(unknown());
        }
        let draft = match (words.name.as_str(), groups.as_slice()) {
            ("plain", []) => Ok(Self::from_fn(2, 2, |i, j| (i + j) % 2 == 0)),
            ("basket", [[m]]) => Ok(basket(*m, *m)),
            ("basket", [[m, n]]) => Ok(basket(*m, *n)),
            ("twill", [floats]) if floats.len().is_multiple_of(2) => twill(floats, &words),
            ("herringbone", []) => Ok(herringbone(&[2, 2], 8)),
            ("herringbone", [floats @ [n, m]]) => Ok(herringbone(floats, 2 * (n + m))),
            ("herringbone", [floats @ [_, _], [ends]]) if *ends > 1 => Ok(herringbone(floats, *ends)),
            ("houndstooth", []) => twill(&[2, 2], &words),
            ("satin" | "sateen", [[shafts]]) => satin(&words.name, *shafts, None),
            ("satin" | "sateen", [[shafts, step]]) => satin(&words.name, *shafts, Some(*step)),
            ("huck", []) => Ok(huck()),
            ("honeycomb", []) => Ok(honeycomb(8)),
            ("honeycomb", [[n]]) if *n >= 6 && n.is_multiple_of(2) => Ok(honeycomb(*n)),
            ("honeycomb", [[_]]) => {
                Err(wrong(format!("no weave \"{}\"", words.text), "a honeycomb has 6, 8, 10, ... ends".to_owned()))
            }
            ("leno", []) => Ok(Self { crossing: true, ..Self::from_fn(2, 2, |_, j| j == 0) }),
            ("double cloth", []) => Ok(double_cloth()),
            ("terry", []) => Ok(terry()),
            ("velvet", []) => Ok(velvet()),
            ("corduroy", []) => Ok(corduroy()),
            _ => Err(unknown()),
        };
        draft?.limited()
    }
}

fn basket(warps: usize, wefts: usize) -> Draft {
    Draft::from_fn(2 * warps, 2 * wefts, |i, j| (i / wefts + j / warps).is_multiple_of(2))
}

fn twill(floats: &[usize], words: &Words<'_>) -> Result<Draft, DraftError> {
    let n: usize = floats.iter().sum();
    let step = words.step.unwrap_or(1);
    if n > LARGEST {
        return Err(wrong(format!("a twill of {n} wefts"), format!("at most {LARGEST}")));
    }
    if step >= n {
        return Err(wrong(format!("a twill of {n} wefts has no step of {step}"), format!("steps are 1 to {}", n - 1)));
    }
    // It comes round when steps add up to whole repeats.
    let ends = (1..=n).find(|ends| (ends * step).is_multiple_of(n)).unwrap_or(n);
    Ok(Draft::from_fn(ends, n, |i, j| {
        let rise = if words.left { ends - j } else { j } * step % n;
        floats_up(floats, (i + n - rise) % n)
    }))
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
        assert_eq!(sateen.over.iter().filter(|over| **over).count() * 5, sateen.over.len());
    }

    #[test]
    fn every_weave_that_is_shown_exists_and_interlaces() {
        for name in NAMES {
            let draft = Draft::named(name).unwrap();
            assert_eq!(draft.loose(), [Vec::<usize>::new(), Vec::new()], "{name}");
        }
    }

    #[test]
    fn twills_lean_as_they_are_told() {
        let (right, left) = (Draft::named("twill 3/1").unwrap(), Draft::named("twill 3/1 left").unwrap());
        for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
            assert_eq!(right.warp_over(i, j), right.warp_over(i + 1, j + 1));
            assert_eq!(left.warp_over(i + 1, j), left.warp_over(i, j + 1));
        }
        let steep = Draft::named("twill 3/2 step 2").unwrap();
        assert!((0..25).all(|k| steep.warp_over(k / 5, k % 5) == steep.warp_over(k / 5 + 2, k % 5 + 1)));
        let fancy = Draft::named("twill 3/1/1/2").unwrap();
        assert_eq!((0..7).filter(|&i| fancy.warp_over(i, 0)).count(), 4);
    }

    #[test]
    fn herringbone_turns_where_neighbours_are_opposite() {
        let draft = Draft::named("herringbone").unwrap();
        for i in 0..4 {
            assert_ne!(draft.warp_over(i, 7), draft.warp_over(i, 8));
            assert_ne!(draft.warp_over(i, 15), draft.warp_over(i, 16));
            assert_eq!(draft.warp_over(i, 2), draft.warp_over(i + 1, 3));
            assert_eq!(draft.warp_over(i + 1, 10), draft.warp_over(i, 11));
        }
    }

    #[test]
    fn mistakes_are_explained() {
        for text in [
            "",
            "twill",
            "twill 2",
            "twill 0/1",
            "twill 2/x",
            "plane",
            "satin 4",
            "satin 6",
            "satin 8/2",
            "plain 3",
            "plain left",
            "basket",
            "twill 2/2 step",
            "honeycomb 7",
            "twill 2/2 step 4",
            "double",
            "twill 900/900",
            "satin 99999",
            "basket 0",
            "twill 2/2 step 0",
        ] {
            assert!(Draft::named(text).is_err(), "{text}");
        }
        let told = |text: &str| Draft::named(text).unwrap_err().to_string();
        assert_eq!(told("plane"), "unknown weave \"plane\"; did you mean \"plain\"?");
        assert_eq!(told("twil 3/1"), "unknown weave \"twil 3/1\"; did you mean \"twill\"?");
        assert!(told("jersey").starts_with("unknown weave \"jersey\"; weaves are plain, basket 2, "));
        assert_eq!(told("satin 6"), "there is no satin of 6 shafts; a satin has 5 shafts or more, but not 6");
        assert_eq!(told("sateen 8/2"), "there is no sateen of 8 shafts and step 2; steps of 8 shafts are 3, 5");
        assert_eq!(told("satin 99999"), "99999 in the weave \"satin 99999\"; numbers are from 1 to 1024");
        assert_eq!(told("twill 2/2 step 0"), "0 in the weave \"twill 2/2 step 0\"; numbers are from 1 to 1024");
        assert_eq!(told("basket"), "unknown weave \"basket\"; it is written as \"basket 2\" or \"basket 3/2\"");
        assert_eq!(told("twill 2/2 step 4"), "a twill of 4 wefts has no step of 4; steps are 1 to 3");
    }
}
