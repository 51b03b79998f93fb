//! SIGINT and SIGTERM: the first one is told to whoever works, a second one ends the process at once.

use std::sync::{
    Arc, LazyLock,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use signal_hook::consts::{SIGINT, SIGTERM};

/// The number of the signal that came.
static WHICH: LazyLock<Arc<AtomicUsize>> = LazyLock::new(|| Arc::new(AtomicUsize::new(SIGINT as usize)));

/// Raised by the first signal.
pub(super) fn interrupt_flag() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // Registration fails only for signals that cannot be caught.
        let _ = signal_hook::flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&flag));
        let _ = signal_hook::flag::register_usize(signal, Arc::clone(&WHICH), signal as usize);
        let _ = signal_hook::flag::register(signal, Arc::clone(&flag));
    }
    flag
}

/// The exit status of an interrupted command, as shells give it: 130 for SIGINT, 143 for SIGTERM.
pub(super) fn exit_status() -> u8 {
    128 + WHICH.load(Ordering::Relaxed) as u8
}
