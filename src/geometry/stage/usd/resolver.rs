//! Opens what a stage refers to: every layer is looked over before the reader sees it, not only the first.

use std::io;

use openusd::ar::{Asset, DefaultResolver, ResolvedPath, Resolver};

use super::check;

/// The default resolver, with a look at each file.
#[derive(Default)]
pub(super) struct LookingResolver(DefaultResolver);

impl Resolver for LookingResolver {
    fn create_identifier(&self, asset_path: &str, anchor: Option<&ResolvedPath>) -> String {
        self.0.create_identifier(asset_path, anchor)
    }

    fn resolve(&self, asset_path: &str) -> Option<ResolvedPath> {
        self.0.resolve(asset_path)
    }

    fn resolve_for_new_asset(&self, asset_path: &str) -> Option<ResolvedPath> {
        self.0.resolve_for_new_asset(asset_path)
    }

    fn open_asset(&self, resolved_path: &ResolvedPath) -> io::Result<Box<dyn Asset>> {
        let bytes = self.0.open_asset(resolved_path)?.read_all()?;
        check::look_over(&bytes).map_err(|p| io::Error::other(p.text))?;
        Ok(Box::new(io::Cursor::new(bytes)))
    }

    fn identity(&self) -> String {
        self.0.identity()
    }
}
