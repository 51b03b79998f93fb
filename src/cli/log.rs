//! What the program says while it works: `tracing` events as plain lines, or as lines of JSON for machines.
//!
//! A plain line is an event's message alone; its fields are for machines, which get all of it. Everything goes to
//! standard error, past the progress bar where there is one; what cannot be written there is dropped.

use std::{
    fmt,
    io::{self, Write},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use clap::Args;
use indicatif::ProgressBar;
use tracing::{Event, Level, Subscriber, field::Field, level_filters::LevelFilter};
use tracing_subscriber::{
    fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter, format::Writer},
    registry::LookupSpan,
};

use super::terminal;

/// Options of commands that take their time.
#[derive(Args, Debug, Clone, Default)]
pub(super) struct LogArgs {
    /// No progress and no summary: errors only.
    #[arg(long, short)]
    pub(super) quiet: bool,
    /// More about the scene and the run, checkpoints among it; -vv for every step of 1 to 32 samples a pixel.
    #[arg(long, short, action = clap::ArgAction::Count)]
    pub(super) verbose: u8,
    /// Say everything as lines of JSON on standard error, with the times of all phases.
    #[arg(long)]
    pub(super) log_json: bool,
}

/// Whether events are heard: else errors are printed as they are.
static STARTED: AtomicBool = AtomicBool::new(false);
static BAR: Mutex<Option<ProgressBar>> = Mutex::new(None);

impl LogArgs {
    /// Starts to listen; the process has one listener.
    pub(super) fn start(&self) {
        let level = match (self.quiet, self.verbose, self.log_json) {
            (true, ..) => LevelFilter::ERROR,
            (_, 0, false) => LevelFilter::INFO,
            (_, 0 | 1, _) => LevelFilter::DEBUG,
            _ => LevelFilter::TRACE,
        };
        let builder = tracing_subscriber::fmt().with_max_level(level).with_writer(PastTheBar);
        let started = if self.log_json {
            let json = builder.json().flatten_event(true).with_target(false);
            tracing::subscriber::set_global_default(json.with_current_span(false).with_span_list(false).finish())
        } else {
            tracing::subscriber::set_global_default(builder.event_format(Plain).finish())
        };
        STARTED.store(started.is_ok(), Ordering::Relaxed);
    }
}

/// Says what went wrong, as the last thing.
pub(super) fn error(message: &str) {
    if STARTED.load(Ordering::Relaxed) {
        tracing::error!("{message}");
    } else {
        terminal::say(message);
    }
}

/// Says a line that is neither result nor error.
pub(super) fn say(message: &str) {
    if STARTED.load(Ordering::Relaxed) {
        tracing::info!("{message}");
    } else {
        terminal::say(message);
    }
}

/// Tells how long a phase took.
pub(super) fn phase(name: &str, took: Duration) {
    let seconds = took.as_secs_f64();
    tracing::debug!(phase = name, seconds, "{name}: {seconds:.3} s");
}

/// Lets lines go past a progress bar from now on, or `None` at its end.
pub(super) fn past(bar: Option<&ProgressBar>) {
    *BAR.lock().unwrap_or_else(PoisonError::into_inner) = bar.cloned();
}

/// An event's message, with its level where that matters.
struct Plain;

impl<S, N> FormatEvent<S, N> for Plain
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, _: &FmtContext<'_, S, N>, mut writer: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        struct Message(String);
        impl tracing::field::Visit for Message {
            fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
                if field.name() == "message" {
                    self.0 = format!("{value:?}");
                }
            }
        }
        let mut message = Message(String::new());
        event.record(&mut message);
        let level = if *event.metadata().level() == Level::WARN { "warning: " } else { "" };
        writeln!(writer, "{level}{}", message.0)
    }
}

/// Standard error, with the progress bar out of the way.
struct PastTheBar;

impl<'a> MakeWriter<'a> for PastTheBar {
    type Writer = Self;
    fn make_writer(&'a self) -> Self {
        Self
    }
}

impl Write for PastTheBar {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let bar = BAR.lock().unwrap_or_else(PoisonError::into_inner);
        match &*bar {
            Some(bar) => bar.suspend(|| terminal::say_bytes(bytes)),
            None => terminal::say_bytes(bytes),
        }
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
