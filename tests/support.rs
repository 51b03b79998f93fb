//! What the tests share.

use std::{
    ffi::OsStr,
    io::Write as _,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use serde_json::Value;
use yarnray::image::{self, Image};

/// A fibre of which hardly any light is lost, as TOML.
pub(crate) const WHITE_FIBER: &str = "[fiber.white]\nr = [0.3, 0.3, 0.3]\ntt = [0.5, 0.5, 0.5]\nd = [0.2, 0.2, 0.2]\n\
    beta_r = 8\nbeta_tt = 8\nbeta_n = 40\n";

/// How a run of the program ended.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) status: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Run {
    /// The run, if it went well.
    #[track_caller]
    pub(crate) fn good(self) -> Self {
        assert_eq!(self.status, Some(0), "{}", self.stderr);
        self
    }
}

/// The program, to be run in a directory.
pub(crate) fn program(directory: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarnray"));
    command.current_dir(directory).stdin(Stdio::null());
    command
}

/// Runs the program in a directory.
pub(crate) fn yarnray<S: AsRef<OsStr>>(directory: &Path, args: &[S]) -> Run {
    let output = program(directory).args(args).output().expect("the program starts");
    Run {
        status: output.status.code(),
        stdout: String::from_utf8(output.stdout).expect("UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("UTF-8"),
    }
}

/// An empty directory that is removed at the end.
pub(crate) fn directory() -> tempfile::TempDir {
    tempfile::Builder::new().prefix("yarnray-test-").tempdir().expect("a temporary directory")
}

/// Writes a file of a test and gives its path.
pub(crate) fn write(directory: &Path, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = directory.join(name);
    std::fs::write(&path, content).expect("a test can write its files");
    path
}

/// Names of what lies in a directory, sorted.
pub(crate) fn listing(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).expect("a directory");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A picture and the statistics of its render.
pub(crate) struct Picture {
    pub(crate) image: Image,
    pub(crate) stats: Value,
}

impl Picture {
    /// One channel.
    #[track_caller]
    pub(crate) fn channel(&self, name: &str) -> &[f32] {
        self.image.channel(name).unwrap_or_else(|| panic!("no channel {name}"))
    }

    /// The colours, pixel by pixel.
    pub(crate) fn colors(&self) -> Vec<[f64; 3]> {
        let [r, g, b] = self.image.rgb().expect("colours");
        (0..r.len()).map(|i| [r[i], g[i], b[i]].map(f64::from)).collect()
    }

    /// The mean colour of all pixels.
    pub(crate) fn mean(&self) -> [f64; 3] {
        mean(&self.colors())
    }
}

/// The mean of colours.
pub(crate) fn mean(colors: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|k| colors.iter().map(|c| c[k]).sum::<f64>() / colors.len() as f64)
}

/// Root of the mean square difference of two pictures, over their mean.
pub(crate) fn difference(a: &Picture, b: &Picture) -> f64 {
    let (a, b) = (a.colors(), b.colors());
    assert_eq!(a.len(), b.len());
    let flat = |c: &[[f64; 3]]| c.as_flattened().to_vec();
    let (a, b) = (flat(&a), flat(&b));
    let square = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64;
    square.sqrt() / (a.iter().sum::<f64>() / a.len() as f64)
}

/// Renders a scene's text and reads back picture and statistics.
#[track_caller]
pub(crate) fn render(scene: &str, args: &[&str]) -> Picture {
    let directory = directory();
    let path = write(directory.path(), "scene.toml", scene);
    render_file(&path, args)
}

/// Renders a scene file and reads back picture and statistics.
#[track_caller]
pub(crate) fn render_file(scene: &Path, args: &[&str]) -> Picture {
    let directory = directory();
    let (out, stats) = (directory.path().join("out.exr"), directory.path().join("stats.json"));
    let mut all = vec![OsStr::new("render"), scene.as_os_str(), OsStr::new("-q"), OsStr::new("-o"), out.as_os_str()];
    all.extend([OsStr::new("--stats"), stats.as_os_str()]);
    all.extend(args.iter().map(OsStr::new));
    let run = yarnray(directory.path(), &all).good();
    assert_eq!(run.stderr, "", "a quiet run says nothing");
    Picture { image: image::read(&out).expect("a picture"), stats: read_json(&stats) }
}

/// A JSON file.
#[track_caller]
pub(crate) fn read_json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("a file")).expect("JSON")
}

/// A file of the project.
pub(crate) fn project(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Says what is not tested, past the harness, which would show it for failed tests only.
pub(crate) fn skipped(what: &str) {
    let _ = writeln!(std::io::stderr(), "skipped: {what}");
}

/// A file of the shared data; `None`, with a word on standard error, where it is absent.
pub(crate) fn shared(name: &str) -> Option<PathBuf> {
    let base = std::env::var_os("YARNRAY_SHARED").map_or_else(|| project("../shared"), PathBuf::from);
    let path = base.join(name);
    if path.exists() {
        return Some(path);
    }
    skipped(&format!("{name} is not beside the project"));
    None
}

/// All scene files below a folder, in order.
pub(crate) fn scenes(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path());
    let mut entries: Vec<PathBuf> = entries.collect();
    entries.sort();
    let below = |path: PathBuf| if path.is_dir() { scenes(&path) } else { vec![path] };
    let mut all: Vec<PathBuf> = entries.into_iter().flat_map(below).collect();
    all.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    all
}

/// A BCC file of Catmull-Rom curves: closed or not, and the points.
pub(crate) fn bcc(curves: &[(bool, Vec<[f32; 3]>)]) -> Vec<u8> {
    let mut bytes = b"BCC\x44C0\x03\x01".to_vec();
    bytes.extend((curves.len() as u64).to_le_bytes());
    bytes.extend((curves.iter().map(|(_, p)| p.len()).sum::<usize>() as u64).to_le_bytes());
    bytes.resize(64, 0);
    for (closed, points) in curves {
        let count = points.len() as i32;
        bytes.extend((if *closed { -count } else { count }).to_le_bytes());
        bytes.extend(points.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
    }
    bytes
}

/// A plain weave as a text curve file: `count` yarns each way, radius 1, just touching, in the plane z = 0.
pub(crate) fn weave_text(count: i32) -> String {
    let mut text = String::new();
    let spacing = 3.6;
    let half = f64::from(count) * spacing / 2.0;
    for across in [false, true] {
        for yarn in 0..count {
            let place = (f64::from(yarn) + 0.5) * spacing - half;
            let steps = 6 * count;
            for step in 0..=steps {
                let along = f64::from(step) / 6.0 * spacing - half;
                let phase = std::f64::consts::PI * (along + half) / spacing;
                let up = if (yarn % 2 == 0) == across { 1.0 } else { -1.0 };
                let z = 1.02 * up * phase.sin();
                let (x, y) = if across { (place, along) } else { (along, place) };
                text += &format!("{x:.6} {y:.6} {z:.6}\n");
            }
            text += "\n";
        }
    }
    text
}

/// A small swatch under a sky and a sharp light.
pub(crate) const SWATCH: &str = r#"
[render]
width = 48
height = 36
spp = 8
max_bounces = 64

[camera]
direction = [0.25, -0.35, 1.0]
fov = 25

[fiber.wool]
r = 0.12
tt = [0.45, 0.43, 0.38]
d = [0.40, 0.39, 0.36]
beta_r = 9.0
beta_tt = 9.0
beta_n = 25.0

[yarn.wool3]
radius = 1.0
plies = 3
ply_twist = 18
fiber = "wool"
fibers = 60
density = 0.4
fiber_twist = -22

[[fabric]]
yarn = "wool3"
source = { type = "stockinette", stitches = 4, rows = 6 }

[[light]]
type = "environment"
radiance = [0.35, 0.4, 0.5]

[[light]]
type = "distant"
towards = [-0.6, 0.7, 0.7]
irradiance = [3.2, 2.9, 2.5]
angular_radius = 1
"#;
