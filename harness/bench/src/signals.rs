//! Signals that end the program: a rig in use is taken to its safe state first, and a served ring removes what it made.

use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGPROF, SIGQUIT, SIGTERM, SIGTSTP, SIGUSR1, SIGUSR2, SIGVTALRM,
    SIGXCPU, SIGXFSZ,
};
use std::os::raw::c_int;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Signals that end a program by default, except those for faults of the program itself.
const ENDING: [c_int; 10] = [
    SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXCPU, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF,
];

/// The signals that end this program: all that do by default, but not SIGHUP where the parent has it ignored, as `nohup` does.
pub fn ending() -> impl Iterator<Item = c_int> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let hang_up = !ignored(&status, SIGHUP);
    let signals = ENDING.into_iter();
    signals.filter(move |signal| *signal != SIGHUP || hang_up)
}

/// A flag that every ending signal sets from now on, and SIGTSTP (Ctrl-Z) too: a suspended program cannot stop the drives.
pub fn interrupt_flag() -> Arc<AtomicBool> {
    flag(ending().chain([SIGTSTP]))
}

fn flag(signals: impl Iterator<Item = c_int>) -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in signals {
        // Where a signal cannot be caught, its default action stays.
        let _as_before = signal_hook::flag::register(signal, Arc::clone(&flag));
    }
    flag
}

/// Ends the program as Ctrl-C does, where a terminal gives it as a key.
///
/// # Errors
/// The signal cannot be raised.
pub(crate) fn interrupt() -> std::io::Result<()> {
    signal_hook::low_level::raise(SIGINT)
}

/// The same without SIGINT: Ctrl-C ends what is under way, and not the program.
pub fn interrupt_flag_without_ctrl_c() -> Arc<AtomicBool> {
    flag(ending().filter(|signal| *signal != SIGINT).chain([SIGTSTP]))
}

/// Does something at each SIGINT (Ctrl-C) from now on, in a thread of its own.
///
/// # Errors
/// The signal cannot be caught.
pub fn at_ctrl_c(mut act: impl FnMut() + Send + 'static) -> std::io::Result<()> {
    let mut signals = signal_hook::iterator::Signals::new([SIGINT])?;
    std::thread::spawn(move || signals.forever().for_each(|_| act()));
    Ok(())
}

/// Two flags: one that every ending signal sets from now on but SIGHUP, and one that SIGHUP sets.
pub fn stop_and_rotate_flags() -> (Arc<AtomicBool>, Arc<AtomicBool>) {
    let flags = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
    for signal in ENDING {
        let flag = if signal == SIGHUP { &flags.1 } else { &flags.0 };
        // Where a signal cannot be caught, its default action stays.
        let _as_before = signal_hook::flag::register(signal, Arc::clone(flag));
    }
    flags
}

/// Lets a write beyond the limit of file sizes (`ulimit -f`) fail like one to a full disk, instead of ending the program.
pub fn fail_beyond_file_size_limit() {
    let _as_before = signal_hook::flag::register(SIGXFSZ, Arc::default());
}

/// Whether a signal is ignored according to `/proc/self/status` (proc(5), `SigIgn`: a bit for each signal).
fn ignored(status: &str, signal: c_int) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::{SIGHUP, SIGINT, ignored};

    #[test]
    fn ignored_signals_are_bits_of_a_mask() {
        let status = "Name:\tsh\nSigBlk:\t0000000000000002\nSigIgn:\t0000000000001001\n";
        assert!(ignored(status, SIGHUP));
        assert!(!ignored(status, SIGINT));
        assert!(!ignored("", SIGHUP));
    }
}
