//! Scenarios that are broken off, in the words of each bus.

use crate::command::play::play_entry_until;
use crate::library::Entry;
use crate::scenario::run::AtMismatch;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use std::sync::atomic::AtomicBool;

/// A request of a session is broken off on drives of the scenario's own too.
#[test]
fn an_interrupted_scenario_is_aborted() {
    for text in [
        "ring 3\nwait 1s\n? sent 0 bytes\n",
        "bus unitek\ndrive 1\nwait 1s\n? quiet\n",
        "bus nordac\nslave 8\nwait 1s\n? quiet\n",
    ] {
        let source = Source::from_bytes("waits".to_owned(), text.as_bytes().to_vec());
        let entry = Entry::fitting(source.expect("text"), None).expect("a scenario");
        let play = |interrupt| {
            let flag = AtomicBool::new(interrupt);
            play_entry_until(&entry, AtMismatch::Stop, &flag).outcome
        };
        assert_eq!(play(false).verdict, Verdict::Passed, "{text}");
        assert_eq!(play(true).verdict, Verdict::Aborted, "{text}");
    }
}
