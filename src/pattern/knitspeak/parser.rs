//! The words of a row, taken one after the other.

use super::{Result, error, lines::number};

/// A place in the words of a row.
pub(super) struct Parser<'a> {
    pub(super) tokens: &'a [String],
    pub(super) at: usize,
    pub(super) line: usize,
    pub(super) row: usize,
}

impl Parser<'_> {
    pub(super) fn peek(&self, ahead: usize) -> Option<&str> {
        self.tokens.get(self.at + ahead).map(String::as_str)
    }

    pub(super) fn wrong<T>(&self, problem: &str, hint: impl Into<String>) -> Result<T> {
        error(self.line, format!("row {}: {problem}", self.row), hint)
    }

    pub(super) fn skip(&mut self, words: usize) {
        self.at += words;
    }

    /// Takes the next words if they are these.
    pub(super) fn take(&mut self, words: &[&str]) -> bool {
        let found = words.iter().enumerate().all(|(i, word)| self.peek(i) == Some(word));
        if found {
            self.at += words.len();
        }
        found
    }

    pub(super) fn take_any(&mut self, all: &[&[&str]]) -> bool {
        all.iter().any(|words| self.take(words))
    }

    pub(super) fn stitches(&mut self) -> bool {
        self.take_any(&[&["sts"], &["st"], &["stitches"], &["stitch"]])
    }

    pub(super) fn number(&self, ahead: usize) -> Option<u32> {
        self.peek(ahead).and_then(number)
    }
}
