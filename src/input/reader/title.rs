//! What a table is called in messages.

use super::super::diagnostic::shortened;

/// How messages call a table.
#[derive(Clone, Debug)]
pub(super) struct Title {
    /// The names from the outside to here, with dots: `yarn.silk1`.
    pub(super) path: String,
    /// The whole name: `[yarn.silk1]`, `[[light]] 2`; empty for the outermost table.
    pub(super) text: String,
    /// What tables inside have to say after their own name: ` of [[light]] 2`.
    pub(super) suffix: String,
}

impl Title {
    pub(super) fn join(&self, key: &str) -> String {
        let bare = |character: char| character.is_ascii_alphanumeric() || matches!(character, '_' | '-');
        let key =
            if !key.is_empty() && key.chars().all(bare) { key.to_owned() } else { format!("\"{}\"", shortened(key)) };
        if self.path.is_empty() { key } else { format!("{}.{key}", self.path) }
    }

    pub(super) fn table(&self, key: &str) -> Title {
        let path = self.join(key);
        Title { text: format!("[{path}]{}", self.suffix), suffix: self.suffix.clone(), path }
    }

    /// Counts from 1, as one would count in the file.
    pub(super) fn element(&self, key: &str, number: usize) -> Title {
        let path = self.join(key);
        let text = format!("[[{path}]] {number}{}", self.suffix);
        Title { suffix: format!(" of {text}"), text, path }
    }

    /// The name without the numbers of tables: `[[light]]`.
    pub(super) fn kind(&self) -> &str {
        self.text.split(' ').next().unwrap_or_default()
    }

    /// ` in [yarn.silk1]`, or nothing for the outermost table.
    pub(super) fn inside(&self) -> String {
        if self.text.is_empty() { String::new() } else { format!(" in {}", self.text) }
    }
}
