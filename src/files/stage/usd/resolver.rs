//! Opens what a stage refers to: every layer is looked over before the reader sees it, not only the first, and text is
//! written as the reader takes it.

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::Mutex,
};

use openusd::ar::{Asset, DefaultResolver, ResolvedPath, Resolver};

use super::{check, text::with_even_samples};

/// The default resolver, with a look at each file.
pub(super) struct LookingResolver {
    files: DefaultResolver,
    /// The first layer, which is read and looked over already, until it is asked for.
    first: Mutex<Option<(PathBuf, Vec<u8>)>>,
}

impl LookingResolver {
    /// For a stage whose first layer, of these bytes, was looked over.
    pub(super) fn new(path: &Path, bytes: Vec<u8>) -> Self {
        let first = fs::canonicalize(path).ok().map(|path| (path, bytes));
        Self { files: DefaultResolver::default(), first: Mutex::new(first) }
    }

    fn take_first(&self, path: &Path) -> Option<Vec<u8>> {
        let mut first = self.first.lock().ok()?;
        let same = first.as_ref().is_some_and(|(own, _)| fs::canonicalize(path).is_ok_and(|path| path == *own));
        if same { first.take().map(|(_, bytes)| bytes) } else { None }
    }
}

impl Resolver for LookingResolver {
    fn create_identifier(&self, asset_path: &str, anchor: Option<&ResolvedPath>) -> String {
        self.files.create_identifier(asset_path, anchor)
    }

    fn resolve(&self, asset_path: &str) -> Option<ResolvedPath> {
        self.files.resolve(asset_path)
    }

    fn resolve_for_new_asset(&self, asset_path: &str) -> Option<ResolvedPath> {
        self.files.resolve_for_new_asset(asset_path)
    }

    fn open_asset(&self, resolved_path: &ResolvedPath) -> io::Result<Box<dyn Asset>> {
        if let Some(bytes) = self.take_first(resolved_path) {
            return Ok(Box::new(io::Cursor::new(with_even_samples(bytes))));
        }
        let bytes = self.files.open_asset(resolved_path)?.read_all()?;
        check::look_over(&bytes).map_err(|p| io::Error::other(p.text))?;
        Ok(Box::new(io::Cursor::new(with_even_samples(bytes))))
    }

    fn identity(&self) -> String {
        self.files.identity()
    }
}
