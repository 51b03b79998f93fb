//! SIGINT, SIGTERM and SIGHUP (the terminal closed): the first one is told to whoever works, a second one ends the process at once.

use std::sync::{
    Arc, LazyLock, OnceLock,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// The number of the signal that came.
static WHICH: LazyLock<Arc<AtomicUsize>> = LazyLock::new(|| Arc::new(AtomicUsize::new(SIGINT as usize)));

/// Raised by the first signal, once the program asked to be told.
static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Raised by the first signal: from the first call on signals are caught, and all callers have the same flag.
pub(super) fn interrupt_flag() -> Arc<AtomicBool> {
    Arc::clone(FLAG.get_or_init(registered))
}

/// Whether a signal came since the program first asked to be told.
pub(super) fn interrupted() -> bool {
    FLAG.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

fn registered() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| signal != SIGHUP || !ignored(signal)) {
        // Registration fails only for signals that cannot be caught.
        let _ = signal_hook::flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&flag));
        let _ = signal_hook::flag::register_usize(signal, Arc::clone(&WHICH), signal as usize);
        let _ = signal_hook::flag::register(signal, Arc::clone(&flag));
    }
    flag
}

/// The exit status of an interrupted command, as shells give it: 130 for SIGINT, 143 for SIGTERM, 129 for SIGHUP.
pub(super) fn exit_status() -> u8 {
    128 + WHICH.load(Ordering::Relaxed) as u8
}

/// Whether whoever started this process had the signal ignored, as `nohup` does: then it stays so.
fn ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
