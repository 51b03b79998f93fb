//! A line on a terminal while something takes its time: what is done, and for how long.

use std::{borrow::Cow, io::IsTerminal as _, time::Duration};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::log;

/// Shown on standard error where that is a terminal, until it is dropped.
pub(super) struct Working(ProgressBar);

impl Working {
    /// Shows what is done, as in "loading scenes/beanie.toml", unless `quiet`.
    pub(super) fn on(what: impl Into<Cow<'static, str>>, quiet: bool) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Self(ProgressBar::hidden());
        }
        let line = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr()).with_message(what);
        line.set_style(
            ProgressStyle::with_template("{spinner} {msg}  {elapsed}").expect("the template is well formed"),
        );
        line.enable_steady_tick(Duration::from_millis(200));
        log::past(Some(&line));
        Self(line)
    }
}

impl Drop for Working {
    fn drop(&mut self) {
        if !self.0.is_hidden() {
            log::past(None);
        }
        self.0.finish_and_clear();
    }
}
