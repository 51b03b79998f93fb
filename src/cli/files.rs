//! What a command reads and writes: clashes are refused before any work, and a file that cannot be written keeps no other
//! from being written.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{Failure, log};
use crate::image::whole_file;

/// The files of a command, each with the option or argument that names it.
#[derive(Default)]
pub(super) struct Files {
    list: Vec<File>,
}

struct File {
    role: &'static str,
    path: PathBuf,
    written: bool,
}

impl Files {
    /// Adds what is read.
    pub(super) fn reads<'a>(mut self, role: &'static str, paths: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.add(role, paths, false);
        self
    }

    /// Adds what is written.
    pub(super) fn writes<'a>(mut self, role: &'static str, paths: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.add(role, paths, true);
        self
    }

    fn add<'a>(&mut self, role: &'static str, paths: impl IntoIterator<Item = &'a PathBuf>, written: bool) {
        self.list.extend(paths.into_iter().map(|path| File { role, path: path.clone(), written }));
    }

    /// Refuses two names of one file, unless both are only read, and files that cannot be written. Makes nothing: for
    /// before large input is read, which may be wrong itself.
    ///
    /// # Errors
    /// [`Failure::Input`], which names both options.
    pub(super) fn refuse(&self) -> Result<(), Failure> {
        for (i, file) in self.list.iter().enumerate() {
            let clash = |other: &&File| (file.written || other.written) && same_file(&file.path, &other.path);
            if let Some(other) = self.list[..i].iter().find(clash) {
                let [a, b] = [other, file].map(|f| format!("{} {}", f.role, f.path.display()));
                return Err(Failure::hinted(format!("{a} and {b} name the same file"), "give each its own name"));
            }
        }
        self.written().try_for_each(whole_file::check_place).map_err(Failure::from)
    }

    fn written(&self) -> impl Iterator<Item = &Path> {
        self.list.iter().filter(|f| f.written).map(|f| f.path.as_path())
    }

    /// As [`Self::refuse`]; makes missing folders, and says so unless `quiet`.
    ///
    /// # Errors
    /// [`Failure::Input`].
    pub(super) fn check(&self, quiet: bool) -> Result<(), Failure> {
        self.refuse()?;
        for path in self.written() {
            let folder = path.parent().filter(|f| !f.as_os_str().is_empty() && !f.exists());
            whole_file::check_target(path)?;
            if let Some(folder) = folder
                && !quiet
            {
                log::say(&format!("made the folder {}", folder.display()));
            }
        }
        Ok(())
    }
}

/// Whether two names are of one file, there or not yet. Devices and pipes take whatever comes.
fn same_file(a: &Path, b: &Path) -> bool {
    if fs::metadata(a).is_ok_and(|m| !m.is_file()) {
        return false;
    }
    let whole = |path: &Path| {
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = || fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
        fs::canonicalize(path).unwrap_or_else(|_| folder().join(path.file_name().unwrap_or_default()))
    };
    whole(a) == whole(b)
}

/// The files that could not be written, while the others were.
#[derive(Default)]
pub(super) struct Attempts {
    problems: Vec<String>,
}

impl Attempts {
    /// Notes how one file went: whether it was written.
    pub(super) fn note(&mut self, result: Result<(), impl Into<Failure>>) -> bool {
        match result.map_err(Into::into) {
            Ok(()) => return true,
            Err(Failure::Input(problem) | Failure::Check(problem)) => self.problems.push(problem),
            Err(Failure::Interrupted | Failure::Closed) => {}
        }
        false
    }

    /// All that went wrong, as one failure.
    pub(super) fn finish(self) -> Result<(), Failure> {
        if self.problems.is_empty() { Ok(()) } else { Err(Failure::Input(self.problems.join("\n"))) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_one_file_are_seen_through() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.png"), "").unwrap();
        fs::create_dir(at("sub")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("a.png"), at("link.png")).unwrap();
        for (a, b, same) in [
            ("a.png", "a.png", true),
            ("a.png", "sub/../a.png", true),
            ("a.png", "link.png", cfg!(unix)),
            ("new.png", "sub/../new.png", true),
            ("a.png", "new.png", false),
        ] {
            assert_eq!(same_file(&at(a), &at(b)), same, "{a} {b}");
        }
        assert!(!same_file(Path::new("/dev/null"), Path::new("/dev/null")));
        let paths = [at("a.png"), at("sub/../a.png")];
        assert!(Files::default().reads("FILE", &paths).check(true).is_ok(), "reading twice is no clash");
        let clash = Files::default().writes("-o", &paths[..1]).writes("--stats", &paths[1..]).check(true);
        assert!(matches!(clash, Err(Failure::Input(text)) if text.contains("-o ") && text.contains("--stats ")));
    }
}
