//! Curve files that commands write.

use std::path::{Path, PathBuf};

use super::{Failure, files::Attempts, log, working::Working};
use crate::{
    files::curve_file,
    geometry::curve::{Basis, CurveSet},
    image::whole_file,
    math::words::counted,
};

/// Refuses names of files whose format is not written.
pub(super) fn refuse_unknown(paths: &[PathBuf]) -> Result<(), Failure> {
    match paths.iter().find(|path| !curve_file::can_write(path)) {
        None => Ok(()),
        Some(path) => {
            let known = curve_file::written_extensions();
            Err(Failure::Input(format!("error: {}: expected a name that ends in {known}", path.display())))
        }
    }
}

/// Whether a file would be read as other curves than B-splines that go into it.
fn leaves_out_splines(path: &Path, set: &CurveSet) -> bool {
    let can = curve_file::abilities(path);
    set.curves.iter().any(|c| c.basis == Basis::BSpline && !can.bases.contains(&c.basis))
}

/// Writes curves to every file that can be written, and says what they hold.
pub(super) fn write_all(paths: &[PathBuf], set: &CurveSet, quiet: bool) -> Result<(), Failure> {
    let mut attempts = Attempts::default();
    for path in paths {
        let _working = Working::on(format!("writing {}", path.display()), quiet);
        if attempts.note(write_curves(path, set)) && !quiet {
            log::say(&format!("wrote {}", path.display()));
            if leaves_out_splines(path, set) {
                let hint = "give `basis = \"b-spline\"` where it is read";
                log::say(&format!(
                    "{}: its points are those of B-splines, which its format does not say: {hint}",
                    path.display()
                ));
            }
        }
    }
    if !quiet {
        set.notes.iter().for_each(|note| log::say(&format!("note: {note}")));
        let points: usize = set.curves.iter().map(|c| c.points.len()).sum();
        let what = if set.plies.is_empty() { "yarn" } else { "curve" };
        log::say(&format!("{}, {}", counted(set.curves.len(), what), counted(points, "control point")));
    }
    attempts.finish()
}

/// Writes curves to a file that appears whole or not at all.
pub(super) fn write_curves(path: &Path, set: &CurveSet) -> Result<(), Failure> {
    Ok(whole_file::write(path, |file| {
        let mut file = std::io::BufWriter::new(file);
        curve_file::write(path, set, &mut file)?;
        std::io::Write::flush(&mut file)
    })?)
}
