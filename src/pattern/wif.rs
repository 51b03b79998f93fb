//! Weaving Information Files (WIF 1.1): threading, tie-up, treadling or lift plan, colours, spacing and thickness of threads.
//!
//! Weaving programs write the format freely, so the reader forgives what has one meaning (garbage before the first
//! section, empty values, private sections, missing defaults) and refuses what has none, with the line.

mod woven;

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

pub use woven::{WifUse, WovenWif};

use crate::math::words::counted;

/// The most threads of one system, and the most crossings.
const MAX_THREADS: u64 = 1 << 20;
const MAX_CROSSINGS: u64 = 1 << 27;
/// The largest number that a measure or a colour has.
const MAX_NUMBER: f64 = 1e9;

/// Why a file is no draft.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WifError {
    /// Line, counted from 1; 0 where none is at fault.
    pub line: usize,
    /// What was expected and what was found.
    pub problem: String,
    /// What might help.
    pub hint: Option<String>,
}

impl WifError {
    /// The line and the problem.
    pub fn without_hint(&self) -> String {
        if self.line > 0 { format!("line {}: {}", self.line, self.problem) } else { self.problem.clone() }
    }
}

impl fmt::Display for WifError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.without_hint())?;
        self.hint.as_ref().map_or(Ok(()), |hint| write!(out, "; {hint}"))
    }
}

impl std::error::Error for WifError {}

fn wrong(line: usize, problem: impl Into<String>) -> WifError {
    WifError { line, problem: problem.into(), hint: None }
}

/// Warp or weft: as many values as threads in each list that is not empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WifThreads {
    /// Number of threads.
    pub count: usize,
    /// Colour of each thread, sRGB from 0 to 1; empty where the file has no colours.
    pub colors: Vec<[f64; 3]>,
    /// Distance from each thread to the next, millimetres; empty where it says nothing.
    pub spacing: Vec<f64>,
    /// Thickness of each thread, millimetres; empty where it says nothing.
    pub thickness: Vec<f64>,
}

/// A draft.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wif {
    /// Its title.
    pub title: Option<String>,
    /// The warp, from the first thread of the threading on.
    pub warp: WifThreads,
    /// The weft, from the first pick on.
    pub weft: WifThreads,
    /// For each pick, for each end: whether the end lies over the pick.
    pub warp_over: Vec<Vec<bool>>,
    /// What was taken for granted, one line each.
    pub notes: Vec<String>,
}

/// A value and where it stands.
#[derive(Clone, Debug)]
struct Entry {
    line: usize,
    value: String,
}

type Section = BTreeMap<String, Entry>;

/// The sections of the file, by name in capitals; keys likewise.
struct Sections {
    sections: BTreeMap<String, Section>,
}

impl Sections {
    fn read(text: &str) -> Self {
        let mut sections: BTreeMap<String, Section> = BTreeMap::new();
        let mut current: Option<String> = None;
        for (i, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with([';', '#']) {
                continue;
            }
            if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
                let name = name.trim().to_uppercase();
                sections.entry(name.clone()).or_default();
                current = Some(name);
            } else if let Some(section) = current.as_ref().and_then(|name| sections.get_mut(name)) {
                let (key, value) = line.split_once('=').unwrap_or((line, ""));
                // A comment may follow the value.
                let value = value.split(';').next().unwrap_or_default().trim().to_owned();
                section.insert(key.trim().to_uppercase(), Entry { line: i + 1, value });
            }
        }
        Self { sections }
    }

    fn section(&self, name: &str) -> Option<&Section> {
        self.sections.get(name)
    }

    /// Whether there is a lift plan; some programs write its head alone.
    fn has_lift_plan(&self) -> bool {
        self.section("LIFTPLAN").is_some_and(|section| !section.is_empty())
    }

    fn entry(&self, section: &str, key: &str) -> Option<&Entry> {
        self.section(section)?.get(key).filter(|e| !e.value.is_empty())
    }

    fn count(&self, section: &str, key: &str) -> Result<Option<u64>, WifError> {
        let Some(entry) = self.entry(section, key) else { return Ok(None) };
        let found = &entry.value;
        let expected =
            || wrong(entry.line, format!("`{key}` of [{section}] should be a whole number, found \"{found}\""));
        found.parse().map(Some).map_err(|_| expected())
    }

    fn number(&self, section: &str, key: &str) -> Result<Option<f64>, WifError> {
        self.entry(section, key).map(|entry| number(entry, section)).transpose()
    }

    /// The lines of a section whose keys are numbers, those of threads, treadles or colours.
    fn numbered(&self, name: &str) -> Result<Vec<(u64, &Entry)>, WifError> {
        let lines = self.section(name).into_iter().flatten();
        lines
            .map(|(key, entry)| match key.parse() {
                Ok(number) => Ok((number, entry)),
                Err(_) => Err(wrong(entry.line, format!("[{name}] has a line for each number, found \"{key}\""))),
            })
            .collect()
    }
}

fn number(entry: &Entry, section: &str) -> Result<f64, WifError> {
    // Decimal commas occur.
    let value = entry.value.replace(',', ".").parse::<f64>().ok().filter(|v| (0.0..=MAX_NUMBER).contains(v));
    value.ok_or_else(|| wrong(entry.line, format!("a number in [{section}] is expected, found \"{}\"", entry.value)))
}

/// Exactly `N` numbers between commas.
fn numbers<const N: usize>(entry: &Entry, what: &str) -> Result<[f64; N], WifError> {
    let parts: Result<Vec<f64>, _> = entry.value.split(',').map(|part| part.trim().parse()).collect();
    let numbers = parts.ok().and_then(|parts| <[f64; N]>::try_from(parts).ok());
    let numbers = numbers.filter(|numbers| numbers.iter().all(|v| v.abs() <= MAX_NUMBER));
    numbers.ok_or_else(|| wrong(entry.line, format!("{what} is {N} numbers, found \"{}\"", entry.value)))
}

/// Numbers between commas, each once and in order; 0 stands for none.
fn list(entry: &Entry, section: &str, most: u64, of_what: &str) -> Result<Vec<u64>, WifError> {
    let mut out = BTreeSet::new();
    for part in entry.value.split(',').map(str::trim).filter(|p| !p.is_empty()) {
        let value: u64 = part
            .parse()
            .map_err(|_| wrong(entry.line, format!("[{section}] lists numbers of {of_what}, found \"{part}\"")))?;
        if value > most {
            let message = format!("[{section}] names {of_what} {value}, the file says that there are {most}");
            return Err(wrong(entry.line, message));
        }
        if value > 0 {
            out.insert(value);
        }
    }
    Ok(out.into_iter().collect())
}

/// Reads a file.
///
/// # Errors
/// What is missing or contradicts itself, and in which line.
pub fn parse(bytes: &[u8]) -> Result<Wif, WifError> {
    // Older programs write other encodings; only names and notes hold letters beyond ASCII.
    let text = String::from_utf8_lossy(bytes);
    let file = Sections::read(&text);
    if file.section("WEAVING").is_none() && file.section("WIF").is_none() {
        let problem = "expected a WIF draft, found neither section [WIF] nor [WEAVING]";
        return Err(WifError { hint: Some("weaving programs save it as .wif".into()), ..wrong(0, problem) });
    }
    let mut notes = Vec::new();
    let shafts = file.count("WEAVING", "SHAFTS")?.unwrap_or(u64::MAX);
    let treadles = file.count("WEAVING", "TREADLES")?.unwrap_or(u64::MAX);
    let ends = threads(&file, "WARP", "THREADING")?;
    let picks = threads(&file, "WEFT", if file.has_lift_plan() { "LIFTPLAN" } else { "TREADLING" })?;
    if ends * picks > MAX_CROSSINGS {
        return Err(wrong(0, format!("{ends} ends and {picks} picks cross more than {MAX_CROSSINGS} times")));
    }
    let warp_over = crossings(&file, [ends as usize, picks as usize], shafts, treadles, &mut notes)?;
    let palette = palette(&file)?;
    let mut system = |name: &str, count: u64| -> Result<WifThreads, WifError> {
        let count = count as usize;
        let unit = unit(&file, name)?;
        let scaled = |values: Vec<f64>| values.into_iter().map(|v| v * unit).collect();
        Ok(WifThreads {
            count,
            colors: colors(&file, name, count, palette.as_ref(), &mut notes)?,
            spacing: scaled(measures(&file, name, "SPACING", count, &mut notes)?),
            thickness: scaled(measures(&file, name, "THICKNESS", count, &mut notes)?),
        })
    };
    let (warp, weft) = (system("WARP", ends)?, system("WEFT", picks)?);
    let title = file.entry("TEXT", "TITLE").map(|e| e.value.clone());
    Ok(Wif { title, warp, weft, warp_over, notes })
}

/// The number of threads: what the file says, or as many as its lists have.
fn threads(file: &Sections, system: &str, list: &str) -> Result<u64, WifError> {
    let listed = file.numbered(list)?.iter().map(|&(n, _)| n).max();
    let said = file.count(system, "THREADS")?;
    let count = said.or(listed).unwrap_or(0);
    if count == 0 {
        return Err(wrong(0, format!("[{system}] has no `Threads`, and [{list}] lists none")));
    }
    if count > MAX_THREADS {
        return Err(wrong(0, format!("[{system}] has {count} threads; at most {MAX_THREADS} are read")));
    }
    Ok(count)
}

/// Which end lies over which pick.
fn crossings(
    file: &Sections,
    [ends, picks]: [usize; 2],
    shafts: u64,
    treadles: u64,
    notes: &mut Vec<String>,
) -> Result<Vec<Vec<bool>>, WifError> {
    if file.section("THREADING").is_none() {
        return Err(wrong(0, "there is no section [THREADING]"));
    }
    let mut shafts_of_end: Vec<Vec<u64>> = vec![Vec::new(); ends];
    for (end, entry) in file.numbered("THREADING")? {
        if (1..=ends as u64).contains(&end) {
            shafts_of_end[end as usize - 1] = list(entry, "THREADING", shafts, "shaft")?;
        }
    }
    // Shafts without an end move nothing.
    let threaded: BTreeSet<u64> = shafts_of_end.iter().flatten().copied().collect();
    let unthreaded = shafts_of_end.iter().filter(|s| s.is_empty()).count();
    if unthreaded > 0 {
        notes.push(format!("{unthreaded} of {ends} ends are on no shaft and stay down"));
    }
    let mut moved_at_pick: Vec<Vec<u64>> = vec![Vec::new(); picks];
    let within = |pick: u64| (1..=picks as u64).contains(&pick).then(|| pick as usize - 1);
    if file.has_lift_plan() {
        for (pick, entry) in file.numbered("LIFTPLAN")? {
            if let Some(pick) = within(pick) {
                moved_at_pick[pick] = list(entry, "LIFTPLAN", shafts, "shaft")?;
            }
        }
        if file.section("TREADLING").is_some() {
            notes.push("the lift plan is used, the treadling is left aside".into());
        }
    } else {
        let missing = |name: &str, needs: &str| WifError {
            hint: Some("a draft has a lift plan, or a treadling with a tie-up".into()),
            ..wrong(0, format!("there is {needs} no section [{name}]"))
        };
        if file.section("TREADLING").is_none() {
            return Err(missing("TREADLING", "no section [LIFTPLAN] and"));
        }
        if file.section("TIEUP").is_none() {
            return Err(missing("TIEUP", "a treadling, but"));
        }
        let mut shafts_of_treadle: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
        for (treadle, entry) in file.numbered("TIEUP")? {
            let mut tied = list(entry, "TIEUP", shafts, "shaft")?;
            tied.retain(|shaft| threaded.contains(shaft));
            shafts_of_treadle.insert(treadle, tied);
        }
        for (pick, entry) in file.numbered("TREADLING")? {
            let Some(pick) = within(pick) else { continue };
            let pressed = list(entry, "TREADLING", treadles, "treadle")?;
            let moved = pressed.iter().filter_map(|treadle| shafts_of_treadle.get(treadle)).flatten();
            moved_at_pick[pick] = moved.copied().collect::<BTreeSet<u64>>().into_iter().collect();
        }
    }
    let rising = match file.entry("WEAVING", "RISING SHED") {
        None => true,
        Some(entry) => match entry.value.to_lowercase().as_str() {
            "true" | "yes" | "on" | "1" => true,
            "false" | "no" | "off" | "0" => false,
            other => return Err(wrong(entry.line, format!("`Rising Shed` is true or false, found \"{other}\""))),
        },
    };
    Ok(moved_at_pick
        .into_iter()
        .map(|moved| {
            let moves = |end: &Vec<u64>| end.iter().any(|shaft| moved.binary_search(shaft).is_ok());
            shafts_of_end.iter().map(|end| moves(end) == rising && (rising || !end.is_empty())).collect()
        })
        .collect())
}

/// Colours by number, sRGB from 0 to 1.
fn palette(file: &Sections) -> Result<Option<BTreeMap<u64, [f64; 3]>>, WifError> {
    if file.section("COLOR TABLE").is_none() {
        return Ok(None);
    }
    let (low, high) = match file.entry("COLOR PALETTE", "RANGE") {
        None => (0.0, 255.0),
        Some(entry) => match numbers(entry, "`Range`")? {
            [low, high] if high > low => (low, high),
            _ => return Err(wrong(entry.line, format!("`Range` rises, found \"{}\"", entry.value))),
        },
    };
    let mut palette = BTreeMap::new();
    for (index, entry) in file.numbered("COLOR TABLE")? {
        palette.insert(index, numbers(entry, "a colour")?.map(|c| ((c - low) / (high - low)).clamp(0.0, 1.0)));
    }
    Ok(Some(palette))
}

fn colors(
    file: &Sections,
    system: &str,
    count: usize,
    palette: Option<&BTreeMap<u64, [f64; 3]>>,
    notes: &mut Vec<String>,
) -> Result<Vec<[f64; 3]>, WifError> {
    let section = format!("{system} COLORS");
    let default = file.entry(system, "COLOR");
    let Some(palette) = palette.filter(|p| !p.is_empty()) else {
        if default.is_some() || file.section(&section).is_some() {
            let system = system.to_lowercase();
            notes.push(format!("colours of the {system} are numbers without a [COLOR TABLE]: they are left aside"));
        }
        return Ok(Vec::new());
    };
    // Some programs write the colour itself behind its number.
    let color = |entry: &Entry, section: &str| -> Result<[f64; 3], WifError> {
        let first = entry.value.split(',').next().unwrap_or_default().trim();
        let index: u64 = first
            .parse()
            .map_err(|_| wrong(entry.line, format!("[{section}] names colours by number, found \"{first}\"")))?;
        palette.get(&index).copied().ok_or_else(|| {
            let known = palette.keys().next_back().copied().unwrap_or(0);
            wrong(entry.line, format!("[{section}] names colour {index}, the [COLOR TABLE] has 1 to {known}"))
        })
    };
    let default = default.map(|entry| color(entry, system)).transpose()?;
    let mut out: Vec<Option<[f64; 3]>> = vec![default; count];
    for (thread, entry) in file.numbered(&section)? {
        if (1..=count as u64).contains(&thread) && !entry.value.is_empty() {
            out[thread as usize - 1] = Some(color(entry, &section)?);
        }
    }
    let missing = out.iter().filter(|c| c.is_none()).count();
    if missing > 0 {
        let first = palette.values().next().copied().unwrap_or([1.0; 3]);
        let (missing, system) = (counted(missing as u64, "thread"), system.to_lowercase());
        notes.push(format!("{missing} of the {system} without a colour: the first of the table"));
        return Ok(out.into_iter().map(|c| c.unwrap_or(first)).collect());
    }
    Ok(out.into_iter().flatten().collect())
}

/// Millimetres in the unit of a system.
fn unit(file: &Sections, system: &str) -> Result<f64, WifError> {
    let Some(entry) = file.entry(system, "UNITS") else { return Ok(10.0) };
    match entry.value.to_lowercase().as_str() {
        "centimeters" | "centimetres" | "cm" => Ok(10.0),
        "inches" | "inch" | "in" => Ok(25.4),
        // 720 in an inch.
        "decipoints" => Ok(25.4 / 720.0),
        "millimeters" | "millimetres" | "mm" => Ok(1.0),
        other => {
            let known = "centimeters, inches and decipoints are known";
            Err(wrong(entry.line, format!("`Units` of [{system}] is \"{other}\"; {known}")))
        }
    }
}

/// Spacing or thickness of each thread; empty where nothing is said.
fn measures(
    file: &Sections,
    system: &str,
    what: &str,
    count: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<f64>, WifError> {
    let section = format!("{system} {what}");
    let default = file.number(system, what)?.filter(|v| *v > 0.0);
    let mut out: Vec<Option<f64>> = vec![default; count];
    for (thread, entry) in file.numbered(&section)? {
        if (1..=count as u64).contains(&thread) && !entry.value.is_empty() {
            out[thread as usize - 1] = Some(number(entry, &section)?).filter(|v| *v > 0.0).or(default);
        }
    }
    let given: Vec<f64> = out.iter().flatten().copied().collect();
    if given.is_empty() {
        return Ok(Vec::new());
    }
    if given.len() < count {
        let missing = counted(count - given.len(), "thread");
        let (system, what) = (system.to_lowercase(), what.to_lowercase());
        notes.push(format!("{missing} of the {system} without a {what}: the mean of the others"));
    }
    let mean = given.iter().sum::<f64>() / given.len() as f64;
    Ok(out.into_iter().map(|v| v.unwrap_or(mean)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWILL: &str = "[WIF]\nVersion=1.1\n[WEAVING]\nRising Shed=true\nTreadles=4\nShafts=4\n[WARP]\nThreads=4\n\
        Color=1\nSpacing=0.2\nUnits=centimeters\n[WEFT]\nThreads=4\nColor=2\nSpacing=5\nUnits=decipoints\n\
        [THREADING]\n1=1\n2=2\n3=3\n4=4\n[TIEUP]\n1=1,2\n2=2,3\n3=3,4\n4=1,4\n[TREADLING]\n1=1\n2=2\n3=3\n4=4\n\
        [COLOR PALETTE]\nRange=0,255\nEntries=2\n[COLOR TABLE]\n1=255,255,255\n2=255,0,51\n";

    fn picture(wif: &Wif) -> Vec<String> {
        wif.warp_over.iter().map(|row| row.iter().map(|&over| if over { '#' } else { '.' }).collect()).collect()
    }

    #[test]
    fn a_twill_is_what_its_loom_makes() {
        let wif = parse(TWILL.as_bytes()).unwrap();
        assert_eq!(picture(&wif), ["##..", ".##.", "..##", "#..#"]);
        assert_eq!(wif.warp.colors, [[1.0; 3]; 4]);
        assert_eq!(wif.weft.colors[0], [1.0, 0.0, 0.2]);
        assert!(wif.warp.spacing.iter().all(|s| (s - 2.0).abs() < 1e-12));
        assert!((wif.weft.spacing[0] - 25.4 / 144.0).abs() < 1e-12 && wif.weft.thickness.is_empty());
        assert!(wif.notes.is_empty());
    }

    #[test]
    fn a_sinking_shed_is_the_other_side() {
        let wif = parse(TWILL.replace("Shed=true", "Shed=false").as_bytes()).unwrap();
        assert_eq!(picture(&wif), ["..##", "#..#", "##..", ".##."]);
    }

    #[test]
    fn lift_plans_and_many_treadles_add_up() {
        let lift = TWILL.replace("[TREADLING]\n1=1\n2=2\n3=3\n4=4\n", "[LIFTPLAN]\n1=1,3\n2=0\n3=\n4=2\n");
        assert_eq!(picture(&parse(lift.as_bytes()).unwrap()), ["#.#.", "....", "....", ".#.."]);
        let both = TWILL.replace("[TREADLING]\n1=1\n", "[TREADLING]\n1=1,3\n");
        assert_eq!(picture(&parse(both.as_bytes()).unwrap())[0], "####");
        // Some programs write the head of a plan that is not there.
        let empty = format!("{TWILL}\n[LIFTPLAN]\n");
        assert_eq!(picture(&parse(empty.as_bytes()).unwrap()), picture(&parse(TWILL.as_bytes()).unwrap()));
        // What is said more than once counts once, and shafts without an end move nothing.
        let again = both
            .replace("1=1,3\n", "1=3,1,1,3\n")
            .replace("4=1,4\n[T", "4=4,9,1,4\n[T")
            .replace("Shafts=4", "Shafts=9");
        assert_eq!(picture(&parse(again.as_bytes()).unwrap()), picture(&parse(both.as_bytes()).unwrap()));
    }

    #[test]
    fn what_is_missing_is_said() {
        let without = |section: &str| {
            let start = TWILL.find(section).unwrap();
            let end = TWILL[start + 1..].find('[').map_or(TWILL.len(), |i| start + 1 + i);
            parse(format!("{}{}", &TWILL[..start], &TWILL[end..]).as_bytes())
        };
        assert!(without("[TIEUP]").unwrap_err().to_string().contains("[TIEUP]"));
        assert!(without("[TREADLING]").unwrap_err().to_string().contains("[TREADLING]"));
        assert!(without("[THREADING]").unwrap_err().to_string().contains("[THREADING]"));
        assert!(without("[COLOR TABLE]").unwrap().notes[0].contains("COLOR TABLE"));
        let treadle = parse(TWILL.replace("\n4=4\n[COLOR", "\n4=4,7\n[COLOR").as_bytes()).unwrap_err();
        assert!(treadle.line > 0 && treadle.problem.contains("treadle 7"), "{treadle}");
        let color = parse(TWILL.replace("Color=2", "Color=3").as_bytes()).unwrap_err();
        assert!(color.problem.contains("colour 3") && color.problem.contains("1 to 2"), "{color}");
        let color = parse(TWILL.replace("Color=1", "Color=0").as_bytes()).unwrap_err();
        assert!(color.problem.contains("colour 0"), "{color}");
        // So is what is no number, with its line.
        for (good, bad, problem) in [
            ("2=2,3\n", "2=2,x,3\n", "line 24: [TIEUP] lists numbers of shaft, found \"x\""),
            ("\n4=4\n[TIEUP]", "\nfour=4\n[TIEUP]", "line 21: [THREADING] has a line for each number, found \"FOUR\""),
            ("255,0,51", "255,x,0,51", "line 37: a colour is 3 numbers, found \"255,x,0,51\""),
            ("0,255\n", "0,x,255\n", "line 33: `Range` is 2 numbers, found \"0,x,255\""),
            ("0,255\n", "nan,255\n", "line 33: `Range` is 2 numbers, found \"nan,255\""),
            ("255,0,51", "255,inf,51", "line 37: a colour is 3 numbers, found \"255,inf,51\""),
            ("Spacing=0.2", "Spacing=1e300", "line 10: a number in [WARP] is expected, found \"1e300\""),
        ] {
            let error = parse(TWILL.replacen(good, bad, 1).as_bytes()).unwrap_err();
            assert_eq!(error.without_hint(), problem);
        }
        assert!(parse(b"hello").unwrap_err().to_string().contains("WIF"));
        assert!(parse(TWILL.replace("Threads=4", "Threads=99999999999").as_bytes()).is_err());
    }

    #[test]
    fn missing_defaults_are_notes() {
        let wif = parse(TWILL.replace("Color=1\n", "").as_bytes()).unwrap();
        assert!(wif.notes[0].contains("4 threads of the warp") && wif.warp.colors.len() == 4);
        let some = TWILL.replace("Spacing=0.2\n", "") + "[WARP SPACING]\n2=0.1\n3=0.3\n";
        let wif = parse(some.as_bytes()).unwrap();
        assert!(wif.notes[0].contains("2 threads") && (wif.warp.spacing[0] - 2.0).abs() < 1e-12);
    }
}
