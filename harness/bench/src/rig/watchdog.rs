//! A thread that stops the drives when the program shows no sign of life: a terminal that is held, a disk that does not answer, a bug. It
//! does not help against `kill -9` or a computer that hangs.

use super::Rig;
use super::around::power_off;
use super::file::SafeStep;
use super::left::NotPutBack;
use super::session_error::SessionError;
use crate::medium::Pieces;
use crate::port::LastWords;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// How often it looks, at most.
const EVERY: Duration = Duration::from_millis(250);

/// Called with the reason, in a sentence.
type AlarmHook = dyn Fn(&str) + Send + Sync;

/// Called once the drives have been stopped.
#[derive(Clone, Default)]
pub struct Alarm(Option<Arc<AlarmHook>>);

impl Alarm {
    /// An alarm that does this.
    pub fn new(act: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(act)))
    }

    /// The same, which also says what is left changed in the drives.
    pub fn telling(self, left: NotPutBack) -> Self {
        Self::new(move |why| {
            let mut all = vec![why.to_owned()];
            all.extend(left.all());
            self.sound(&all.join("\n"));
        })
    }

    fn sound(&self, why: &str) {
        if let Some(act) = &self.0 {
            act(why);
        }
    }
}

impl fmt::Debug for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() {
            "Alarm"
        } else {
            "no alarm"
        })
    }
}

/// The count at the last look at which it had gone up, and when that was.
struct LastBeat {
    count: u64,
    seen: Instant,
}

impl LastBeat {
    /// For how long the count has stood still.
    fn age(&mut self, count: u64, now: Instant) -> Duration {
        if count != self.count {
            *self = Self { count, seen: now };
        }
        now.saturating_duration_since(self.seen)
    }
}

/// A watchdog on duty; it leaves when this is dropped.
#[derive(Debug)]
pub(super) struct Watchdog {
    _leash: Sender<()>,
}

impl Watchdog {
    /// Watches a count that goes up while the program lives. Where it stands still for `limit`, `stop` is done, which returns what has
    /// failed, and the alarm sounds.
    pub(super) fn start(
        beats: Arc<AtomicU64>,
        limit: Duration,
        stop: impl FnOnce() -> Vec<String> + Send + 'static,
        alarm: Alarm,
    ) -> std::io::Result<Self> {
        let (leash, left) = channel();
        std::thread::Builder::new()
            .name("watchdog".to_owned())
            .spawn(move || {
                let mut last = LastBeat {
                    count: beats.load(Ordering::Relaxed),
                    seen: Instant::now(),
                };
                while left.recv_timeout(EVERY.min(limit)) == Err(RecvTimeoutError::Timeout) {
                    if last.age(beats.load(Ordering::Relaxed), Instant::now()) >= limit {
                        let mut why = vec![format!(
                            "the program has shown no sign of life for {} s; the drives were told to stop, and it is not known whether they \
                             did: use the emergency stop",
                            limit.as_secs_f64()
                        )];
                        why.extend(stop());
                        alarm.sound(&why.join("; "));
                        return;
                    }
                }
            })?;
        Ok(Self { _leash: leash })
    }
}

/// Watches over a rig as its file says: where the count of `beats` stands still for too long, each port gets the words that are its own then,
/// and power that belongs to the safe state is switched off.
pub(super) fn watch_over(
    rig: &Rig,
    beats: Arc<AtomicU64>,
    (ports, words): (
        Vec<LastWords>,
        impl Fn(usize) -> Vec<Pieces> + Send + 'static,
    ),
    alarm: Alarm,
) -> Result<Watchdog, SessionError> {
    let safe_state = &rig.file.safe_state;
    let limit = safe_state.watchdog.0;
    let cut = safe_state.order.contains(&SafeStep::PowerOff);
    let rig = rig.clone();
    let stop = move || {
        let said = ports.iter().enumerate().flat_map(|(port, last_words)| {
            let said = words(port).into_iter().map(|words| last_words.say(&words));
            said.filter_map(|sent| Some(sent.err()?.to_string()))
                .collect::<Vec<_>>()
        });
        let mut failed: Vec<_> = said.collect();
        if cut {
            failed.extend(power_off(&rig));
        }
        failed
    };
    let started = Watchdog::start(beats, limit, stop, alarm);
    started.map_err(SessionError::Watchdog)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_count_that_stands_still_grows_old() {
        let seen = Instant::now();
        let at = |seconds| seen + Duration::from_secs(seconds);
        let mut last = LastBeat { count: 7, seen };
        for (count, second, age) in [(7, 3, 3), (8, 4, 0), (8, 9, 5), (9, 10, 0), (9, 10, 0)] {
            assert_eq!(last.age(count, at(second)), Duration::from_secs(age));
        }
    }

    /// Starts a watchdog over a count that stands still. What it says arrives at the receiver, which ends with the watchdog's thread.
    fn start(limit: Duration) -> (Watchdog, std::sync::mpsc::Receiver<String>) {
        let (bite, bitten) = channel();
        let alarm = Alarm::new(move |why| bite.send(why.to_owned()).expect("the test waits"));
        let stop = || vec!["the power is off".to_owned()];
        let dog = Watchdog::start(Arc::default(), limit, stop, alarm);
        (dog.expect("a thread"), bitten)
    }

    #[test]
    fn it_bites_a_program_that_stands_still() {
        let (_dog, bitten) = start(Duration::from_millis(50));
        let said = bitten.recv().expect("it bites");
        assert!(said.contains("no sign of life") && said.ends_with("the power is off"));
        assert!(bitten.recv().is_err(), "it bites once");
    }

    /// What was not put back is said with it, also behind the begin of the watch.
    #[test]
    fn it_says_what_is_left_changed() {
        let left = NotPutBack::default();
        let (bite, bitten) = channel();
        let alarm = Alarm::new(move |why| bite.send(why.to_owned()).expect("the test waits"));
        let alarm = alarm.telling(left.clone());
        left.foretell(vec!["slave 8: `drivebench write 8`".to_owned()], None);
        alarm.sound("it hangs");
        assert_eq!(
            bitten.recv().expect("it bites"),
            "it hangs\nslave 8: `drivebench write 8`"
        );
    }

    #[test]
    fn it_leaves_when_it_is_called_off() {
        let (dog, bitten) = start(Duration::from_secs(3_600));
        drop(dog);
        assert!(bitten.recv().is_err(), "its thread ends without a word");
    }
}
