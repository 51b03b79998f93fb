//! Stages that a scene reads: each is opened once, whatever is read of it and at however many times.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    path::{Path, PathBuf},
    rc::Rc,
};

use crate::files::stage::{Stage, StageError};

/// Those that are open.
#[derive(Default)]
pub(super) struct Stages(RefCell<BTreeMap<PathBuf, Rc<Stage>>>);

impl Stages {
    /// The stage of a file.
    pub(super) fn open(&self, path: &Path) -> Result<Rc<Stage>, StageError> {
        if let Some(stage) = self.0.borrow().get(path) {
            return Ok(stage.clone());
        }
        let stage = Rc::new(Stage::open(path)?);
        self.0.borrow_mut().insert(path.to_owned(), stage.clone());
        Ok(stage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_opened_once() {
        let stages = Stages::default();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/stages/scene.usda");
        let first = stages.open(&path).unwrap();
        assert!(Rc::ptr_eq(&first, &stages.open(&path).unwrap()));
        assert!(stages.open(Path::new("none.usda")).is_err());
    }
}
