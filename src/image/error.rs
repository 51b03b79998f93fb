//! The one error of this room.

use std::{fmt, io, path::Path, path::PathBuf};

use crate::input::system::in_words;

/// What went wrong with a picture or an output file. Displayed as one line that names the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ImageError {
    /// The file cannot be opened, or its content is damaged.
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The picture may be fine, but nothing here can read it.
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is not supported, and how to get it where there is a way.
        reason: String,
    },
    /// The picture has more than [`SAMPLE_LIMIT`](super::SAMPLE_LIMIT) samples.
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Pixels in a row.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Number of channels.
        channels: usize,
    },
    /// The output cannot be written; nothing has been left behind.
    Write {
        /// The file that was asked for.
        path: PathBuf,
        /// What prevents it.
        reason: String,
    },
}

impl ImageError {
    /// The file cannot be opened or read.
    pub(crate) fn unreadable(path: &Path, error: &io::Error) -> Self {
        Self::Read { path: path.into(), reason: in_words(error) }
    }

    /// The output cannot be written.
    pub(super) fn unwritable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Write { path: path.into(), reason: reason.into() }
    }

    /// The message without the name of the file.
    pub fn reason(&self) -> String {
        match self {
            Self::Read { reason, .. } | Self::Unsupported { reason, .. } | Self::Write { reason, .. } => reason.clone(),
            Self::TooLarge { width, height, channels, .. } => format!(
                "{width} x {height} pixels of {channels} channels are too many; the limit is {} million samples",
                super::SAMPLE_LIMIT >> 20
            ),
        }
    }

    /// The file that the error is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::Read { path, .. }
            | Self::Unsupported { path, .. }
            | Self::TooLarge { path, .. }
            | Self::Write { path, .. } => path,
        }
    }
}

impl fmt::Display for ImageError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verb = if matches!(self, Self::Write { .. }) { "write" } else { "read" };
        write!(formatter, "cannot {verb} {}: {}", self.path().display(), self.reason())
    }
}

impl std::error::Error for ImageError {}
