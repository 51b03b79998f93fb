//! Suite files: which scenes, under which lights, by which methods, to which quality. TOML with the diagnostics of scenes.

use std::path::{Path, PathBuf};

use super::method::Method;
use crate::{
    input::{
        diagnostic::{Diagnostics, Sources, unknown_name},
        document::Document,
        reader::{Range, Reader},
    },
    report::table3::Paper,
    scene::load::{LoadError, LoadOptions, read_text},
};

/// What a suite measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measure {
    /// Time, memory and error at equal quality: [`super::table3`].
    Cost,
    /// How far pictures are from the reference: [`super::fidelity`].
    Fidelity,
}

/// A checked suite.
#[derive(Clone, Debug)]
pub(crate) struct Suite {
    /// The file, as it was named.
    pub path: String,
    /// What it calls itself.
    pub title: String,
    /// What is measured.
    pub measure: Measure,
    /// Explicit fibres, or what stands in their place.
    pub reference: Method,
    /// What is compared with it.
    pub tested: Method,
    /// Further ways, of which only pictures are compared.
    pub others: Vec<OtherWay>,
    /// Equal quality: this relMSE.
    pub target: f64,
    /// Timed runs of each kind.
    pub repeats: u32,
    /// Converged pictures have at most the target over this as their estimated relMSE.
    pub converged: f64,
    /// Timed runs that take less are made more often, until they take this long together.
    pub min_seconds: f64,
    /// Most samples per pixel of any run.
    pub max_spp: u32,
    /// Size of all pictures; `None` leaves it to the scenes.
    pub size: Option<[u32; 2]>,
    /// How many packings of fibres a picture is the mean of where a row does not say; see [`Case::packings`].
    pub packings: u32,
    /// Scenes under lights, in order.
    pub cases: Vec<Case>,
    /// Rows that need files which are not there.
    pub missing: Vec<(String, String)>,
    /// The cases whose error is shown against time, and how.
    pub converge: Option<ConvergePlan>,
}

/// A further way to render a case.
#[derive(Clone, Debug)]
pub(crate) struct OtherWay {
    /// What it is called.
    pub name: String,
    /// Mode and model.
    pub method: Method,
    /// `KEY=VALUE` over the scene.
    pub set: Vec<String>,
}

/// A scene under a light.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    /// Row and light.
    pub name: String,
    /// The scene file.
    pub scene: PathBuf,
    /// In place of the first fabric's curves.
    pub curves: Option<PathBuf>,
    /// `KEY=VALUE` over the scene, those of the light last.
    pub set: Vec<String>,
    /// The paper's figures.
    pub paper: Option<Paper>,
    /// Whether the row was kept out of development.
    pub held_out: bool,
    /// How far the light's means may be off, as a share.
    pub within: f64,
    /// How many packings of fibres its pictures are means of, by seeds of the first fabric; with 1 the scene's own.
    pub packings: u32,
}

/// Which cases are measured against time.
#[derive(Clone, Debug)]
pub(crate) struct ConvergePlan {
    /// Names of cases.
    pub cases: Vec<String>,
    /// Renders behind every point.
    pub seeds: u32,
    /// Most samples per pixel of the tested method; the reference has its own.
    pub spp: u32,
    /// Longest render of a curve, in seconds.
    pub seconds: f64,
    /// Samples per pixel of each half of a converged picture.
    pub converged_spp: u32,
}

impl ConvergePlan {
    /// The plan for the cases there are. A quick suite may have left one out, and a row may be missing; the name of a case
    /// that no suite has is a mistake.
    fn of_cases(mut self, cases: &[Case], missing: &[(String, String)], root: &Reader<'_>, quick: bool) -> Self {
        self.cases.retain(|name| {
            let known = cases.iter().any(|case| case.name == *name);
            if !known && !quick && !missing.iter().any(|(row, _)| name.starts_with(row.as_str())) {
                let (message, hint) =
                    unknown_name("row and lighting", name, cases.iter().map(|case| case.name.as_str()));
                root.error_at("converge", message, Some(&hint));
            }
            known
        });
        self
    }
}

impl Case {
    /// The options with which the case's scene is loaded for a method; `more` stands over all others.
    pub(crate) fn options(&self, suite: &Suite, method: Method, more: &[String]) -> LoadOptions {
        let mut assignments = self.set.clone();
        assignments.extend_from_slice(more);
        assignments.push(format!("render.mode=\"{}\"", method.mode.name()));
        assignments.extend(method.model.map(|model| format!("render.model=\"{}\"", model.name())));
        if let Some([width, height]) = suite.size {
            assignments.extend([format!("render.width={width}"), format!("render.height={height}")]);
        }
        LoadOptions { assignments, curves: self.curves.clone(), ..LoadOptions::default() }
    }
}

const METHOD_HINT: &str = "a mode, or a mode and a model, as in \"fiber\" or \"yarn:aggregated\"";

impl Suite {
    /// Reads a suite; with `quick`, what its table `[quick]` says takes the place of the rest.
    ///
    /// # Errors
    /// Everything that is wrong with it, as text for the user.
    pub(crate) fn load(path: &Path, quick: bool) -> Result<Self, LoadError> {
        let mut sources = Sources::new();
        let diagnostics = Diagnostics::new();
        let name = path.display().to_string();
        let text = read_text(path).map_err(|problem| LoadError(format!("{name}: error: {problem}\n")))?;
        let document = Document::parse(&name, &text, &mut sources, &diagnostics);
        let suite = document.and_then(|document| read(&name, path, Reader::new(&document, &diagnostics), quick));
        match suite {
            Some(suite) if !diagnostics.has_errors() => Ok(suite),
            _ => Err(LoadError(diagnostics.render(&sources))),
        }
    }

    /// The case of a name.
    pub(crate) fn case(&self, name: &str) -> Option<&Case> {
        self.cases.iter().find(|case| case.name == name)
    }
}

/// A row before it meets the lights.
struct Row {
    name: String,
    scene: PathBuf,
    curves: Option<PathBuf>,
    set: Vec<String>,
    lights: Vec<String>,
    paper: Option<Paper>,
    held_out: bool,
    packings: Option<u32>,
    missing: Option<String>,
}

fn read(name: &str, path: &Path, root: Reader<'_>, quick: bool) -> Option<Suite> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let title = root.string_or("title", "Explicit fibres and aggregated yarns at equal quality").to_owned();
    let measure = root.one_of_or("measure", Measure::Cost, &[("cost", Measure::Cost), ("fidelity", Measure::Fidelity)]);
    let reference = method(&root, "reference", "fiber");
    let tested = method(&root, "tested", "yarn:aggregated");
    let quality = Quality::read(&root);
    let others = root.tables("other").into_iter().filter_map(other_way).collect();
    let lights = Lightings::read(&root);
    let rows = rows(&root, folder, &lights);
    let converge = root.table("converge").map(converge_plan);
    let mut parts = Parts { quality, others, rows, converge };
    if let Some(table) = root.table("quick") {
        let shorter = Quick::read(table, &parts, &lights);
        if quick {
            shorter.shorten(&mut parts);
        }
    } else if quick {
        root.error("`--quick` needs a table [quick], which says what is measured", Some("[quick]\ntarget = 0.05"));
    }
    let Parts { quality, others, rows, converge } = parts;
    let (cases, missing) = lights.cases(rows, quality.packings);
    let converge = converge.map(|plan| plan.of_cases(&cases, &missing, &root, quick));
    root.finish();
    Some(Suite {
        path: name.to_owned(),
        title,
        measure,
        reference: reference?,
        tested: tested?,
        others,
        target: quality.target,
        repeats: quality.repeats,
        converged: quality.converged,
        min_seconds: quality.min_seconds,
        max_spp: quality.max_spp,
        size: quality.size,
        packings: quality.packings,
        cases,
        missing,
        converge,
    })
}

/// One `[[other]]`; `None` if its method is wrong.
fn other_way(table: Reader<'_>) -> Option<OtherWay> {
    let name = table.required_string("name").unwrap_or_default().to_owned();
    let method =
        if table.has("method") { method(&table, "method", "") } else { table.required_string("method").and(None) };
    let set = strings(&table, "set");
    table.finish();
    method.map(|method| OtherWay { name, method, set })
}

/// Every `[[row]]`, with its mistakes told.
fn rows(root: &Reader<'_>, folder: &Path, lights: &Lightings) -> Vec<Row> {
    let rows: Vec<Row> = root.tables("row").into_iter().map(|table| row(table, folder, lights)).collect();
    if rows.is_empty() {
        root.error("a suite needs at least one [[row]]", Some("[[row]] with `name` and `scene`"));
    }
    for (i, row) in rows.iter().enumerate() {
        if rows[..i].iter().any(|other| other.name == row.name) {
            root.error(format!("two rows are called \"{}\"", row.name), None);
        }
    }
    rows
}

/// How far the light's means may be off where a suite does not say.
const WITHIN: f64 = 0.05;

/// The tables `[lighting.NAME]`: what each sets over a row's scene.
struct Lightings(Vec<(String, Vec<String>, f64)>);

impl Lightings {
    fn read(root: &Reader<'_>) -> Self {
        let lighting = |(name, table): (&str, Reader<'_>)| {
            let set = strings(&table, "set");
            let within = table.f64_or("within", WITHIN, Range::between(0.0, 1.0));
            table.finish();
            (name.to_owned(), set, within)
        };
        Self(root.named_tables("lighting").into_iter().map(lighting).collect())
    }

    /// The names under a key; one that is not known is told.
    fn names(&self, table: &Reader<'_>, key: &str) -> Vec<String> {
        let names: Vec<String> = strings(table, key);
        for name in &names {
            if !self.0.iter().any(|(known, ..)| known == name) {
                let (message, hint) = unknown_name("lighting", name, self.0.iter().map(|(known, ..)| known.as_str()));
                table.error_at(key, message, Some(&hint));
            }
        }
        names
    }

    /// Each row under each of its lightings, of so many packings unless it says otherwise; then the rows that are missing, with the reason.
    fn cases(&self, rows: Vec<Row>, packings: u32) -> (Vec<Case>, Vec<(String, String)>) {
        let (mut cases, mut missing) = (Vec::new(), Vec::new());
        for row in rows {
            if let Some(reason) = row.missing {
                missing.push((row.name, reason));
                continue;
            }
            let case = |name: String, light: &[String], within: f64| Case {
                name,
                scene: row.scene.clone(),
                curves: row.curves.clone(),
                set: row.set.iter().chain(light).cloned().collect(),
                paper: row.paper,
                held_out: row.held_out,
                within,
                packings: row.packings.unwrap_or(packings),
            };
            if self.0.is_empty() {
                cases.push(case(row.name.clone(), &[], WITHIN));
            }
            for (light, set, within) in self.0.iter().filter(|(light, ..)| row.lights.contains(light)) {
                cases.push(case(format!("{}, {light}", row.name), set, *within));
            }
        }
        (cases, missing)
    }
}

/// What `[quick]` may change of a suite.
struct Parts {
    quality: Quality,
    others: Vec<OtherWay>,
    rows: Vec<Row>,
    converge: Option<ConvergePlan>,
}

/// The table `[quick]`: a shorter suite. Rows and lightings are kept all if none are named.
struct Quick {
    quality: Quality,
    rows: Option<Vec<String>>,
    lights: Option<Vec<String>>,
    others: bool,
    converge: bool,
}

impl Quick {
    fn read(table: Reader<'_>, whole: &Parts, lights: &Lightings) -> Self {
        let quick = Self {
            quality: whole.quality.over(&table),
            rows: if table.has("rows") { Some(strings(&table, "rows")) } else { None },
            lights: if table.has("lights") { Some(lights.names(&table, "lights")) } else { None },
            others: table.bool_or("others", true),
            converge: table.bool_or("converge", true),
        };
        for name in quick.rows.iter().flatten() {
            if !whole.rows.iter().any(|row| row.name == *name) {
                let (message, hint) = unknown_name("row", name, whole.rows.iter().map(|row| row.name.as_str()));
                table.error_at("rows", message, Some(&hint));
            }
        }
        table.finish();
        quick
    }

    fn shorten(self, parts: &mut Parts) {
        parts.quality = self.quality;
        parts.rows.retain(|row| self.rows.as_ref().is_none_or(|kept| kept.contains(&row.name)));
        for row in &mut parts.rows {
            row.lights.retain(|light| self.lights.as_ref().is_none_or(|kept| kept.contains(light)));
        }
        if !self.others {
            parts.others.clear();
        }
        if !self.converge {
            parts.converge = None;
        }
    }
}

/// What decides how long a suite takes.
#[derive(Clone, Copy)]
struct Quality {
    target: f64,
    repeats: u32,
    converged: f64,
    min_seconds: f64,
    max_spp: u32,
    size: Option<[u32; 2]>,
    packings: u32,
}

impl Quality {
    fn read(table: &Reader<'_>) -> Self {
        let usual = Self {
            target: 0.01,
            repeats: 3,
            converged: 4.0,
            min_seconds: 0.0,
            max_spp: 1 << 16,
            size: None,
            packings: 1,
        };
        usual.over(table)
    }

    /// These, where the table does not say otherwise.
    fn over(self, table: &Reader<'_>) -> Self {
        let size = table.vec2("size", Range::between(8.0, 65_536.0));
        if size.is_some_and(|size| size.iter().any(|v| v.fract() != 0.0)) {
            table.error_at("size", "expected two whole numbers", Some("size = [192, 144]"));
        }
        Self {
            target: table.f64_or("target", self.target, Range::above(0.0)),
            repeats: table.u64_or("repeats", self.repeats.into(), 1..=1000) as u32,
            converged: table.f64_or("converged", self.converged, Range::between(1.0, 1e4)),
            min_seconds: table.f64_or("min_seconds", self.min_seconds, Range::between(0.0, 3600.0)),
            max_spp: table.u64_or("max_spp", self.max_spp.into(), 2..=u64::from(u32::MAX)) as u32,
            size: size.map(|size| size.map(|v| v as u32)).or(self.size),
            packings: packings(table).unwrap_or(self.packings),
        }
    }
}

/// Over how many packings of fibres pictures are averaged, if a table says.
fn packings(table: &Reader<'_>) -> Option<u32> {
    let count = table.u64("packings", 1..=1000)?;
    if count > 1 && count % 2 == 1 {
        table.error_at("packings", "expected 1 or an even number: half of them for each half of a picture", None);
    }
    Some(count as u32)
}

fn method(table: &Reader<'_>, key: &str, default: &str) -> Option<Method> {
    match Method::parse(table.string_or(key, default)) {
        Ok(method) => Some(method),
        Err(message) => {
            table.error_at(key, message, Some(METHOD_HINT));
            None
        }
    }
}

fn strings(table: &Reader<'_>, key: &str) -> Vec<String> {
    table.strings(key).into_iter().map(|(text, _)| text.to_owned()).collect()
}

fn row(table: Reader<'_>, folder: &Path, lights: &Lightings) -> Row {
    let name = table.required_string("name").unwrap_or_default().to_owned();
    let scene = folder.join(table.required_string("scene").unwrap_or_default());
    let curves = table.string("curves").map(|path| folder.join(path));
    let fallback = table.string("fallback").map(|path| folder.join(path));
    let set = strings(&table, "set");
    let lights = lights.names(&table, "lights");
    let held_out = table.bool_or("held_out", false);
    let packings = packings(&table);
    let pair = |table: &Reader<'_>, key: &str| table.vec2(key, Range::POSITIVE);
    let paper = table.table("paper").and_then(|paper| {
        let figures = [pair(&paper, "seconds"), pair(&paper, "megabytes"), pair(&paper, "bounces")];
        if figures.contains(&None) {
            paper.error(
                "expected `seconds`, `megabytes` and `bounces`, two numbers each",
                Some("the reference's, then theirs"),
            );
        }
        paper.finish();
        Some(Paper { seconds: figures[0]?, megabytes: figures[1]?, bounces: figures[2]? })
    });
    table.finish();
    // A curve file that is not there is no mistake: it may be one that must not be passed on.
    let absent = curves.as_ref().filter(|path| !path.exists()).cloned();
    match (absent, fallback) {
        (None, _) => Row { name, scene, curves, set, lights, paper, held_out, packings, missing: None },
        (Some(_), Some(scene)) => {
            Row { name, scene, curves: None, set: Vec::new(), lights, paper, held_out, packings, missing: None }
        }
        (Some(path), None) => {
            let missing = Some(format!("{} is not there", path.display()));
            Row { name, scene, curves, set, lights, paper, held_out, packings, missing }
        }
    }
}

fn converge_plan(table: Reader<'_>) -> ConvergePlan {
    let plan = ConvergePlan {
        cases: strings(&table, "rows"),
        seeds: table.u64_or("seeds", 5, 2..=1000) as u32,
        spp: table.u64_or("spp", 255, 1..=1 << 20) as u32,
        seconds: table.f64_or("seconds", 10.0, Range::above(0.0)),
        converged_spp: table.u64_or("converged_spp", 512, 2..=1 << 20) as u32,
    };
    table.finish();
    plan
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_may_say_over_how_many_packings_its_pictures_are_averaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("suite.toml");
        let rows = "[[row]]\nname=\"a\"\nscene=\"s.toml\"\n[[row]]\nname=\"b\"\nscene=\"s.toml\"\npackings=1\n";
        std::fs::write(&path, format!("measure=\"fidelity\"\npackings=4\n{rows}")).unwrap();
        let suite = Suite::load(&path, false).unwrap();
        assert_eq!(suite.cases.iter().map(|case| case.packings).collect::<Vec<_>>(), [4, 1]);
        std::fs::write(&path, format!("measure=\"fidelity\"\n{}", rows.replace("packings=1", "packings=0"))).unwrap();
        assert!(Suite::load(&path, false).is_err());
        std::fs::write(&path, format!("measure=\"fidelity\"\npackings=3\n{rows}")).unwrap();
        let error = Suite::load(&path, false).unwrap_err().to_string();
        assert!(error.contains("1 or an even number"), "{error}");
    }
}
