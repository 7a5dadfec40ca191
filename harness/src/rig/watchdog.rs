//! A thread that stops the drives when the program shows no sign of life: a terminal that is held, a disk that does not answer, a mistake
//! of ours. It helps against neither `kill -9` nor a computer that stands still.

use crate::port::LastWords;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// How often it looks, at most.
const EVERY: Duration = Duration::from_millis(250);

/// Gets a sentence that says why.
type Act = dyn Fn(&str) + Send + Sync;

/// What is done once the drives have been told to stop.
#[derive(Clone, Default)]
pub struct Alarm(Option<Arc<Act>>);

impl Alarm {
    /// An alarm that does this.
    pub fn new(act: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(act)))
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

/// A watchdog on duty; it leaves when this is dropped.
#[derive(Debug)]
pub(super) struct Watchdog {
    _leash: Sender<()>,
}

impl Watchdog {
    /// Watches a count that goes up while the program lives. Where it stands still for `limit`, every wire gets its last words,
    /// `then` is done, and the alarm sounds.
    pub(super) fn start(
        beats: Arc<AtomicU64>,
        limit: Duration,
        words: Vec<LastWords>,
        then: impl FnOnce() -> Vec<String> + Send + 'static,
        alarm: Alarm,
    ) -> std::io::Result<Self> {
        let (leash, left) = channel();
        std::thread::Builder::new()
            .name("watchdog".to_owned())
            .spawn(move || {
                let mut seen = (beats.load(Ordering::Relaxed), Instant::now());
                while left.recv_timeout(EVERY.min(limit)) == Err(RecvTimeoutError::Timeout) {
                    let now = beats.load(Ordering::Relaxed);
                    if now != seen.0 {
                        seen = (now, Instant::now());
                    } else if seen.1.elapsed() >= limit {
                        let mut why = vec![format!(
                            "the program has shown no sign of life for {} s; the drives were told to stop, and nobody knows whether they \
                             did: use the emergency stop",
                            limit.as_secs_f64()
                        )];
                        for words in &words {
                            why.extend(words.say().err().map(|error| error.to_string()));
                        }
                        why.extend(then());
                        alarm.sound(&why.join("; "));
                        return;
                    }
                }
            })?;
        Ok(Self { _leash: leash })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// It bites only when the count stands still, and not once it has been called off.
    #[test]
    fn it_bites_what_stands_still() {
        let bitten = Arc::new(Mutex::new(Vec::new()));
        let beats = Arc::new(AtomicU64::new(0));
        let start = || {
            let bitten = Arc::clone(&bitten);
            let alarm = Alarm::new(move |why| bitten.lock().expect("sound").push(why.to_owned()));
            let limit = Duration::from_millis(400);
            let then = || vec!["the power is off".to_owned()];
            Watchdog::start(Arc::clone(&beats), limit, Vec::new(), then, alarm).expect("a thread")
        };
        let watchdog = start();
        for _ in 0..40 {
            beats.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(20));
        }
        drop(watchdog);
        std::thread::sleep(Duration::from_millis(600));
        assert!(bitten.lock().expect("sound").is_empty());
        let _watchdog = start();
        let end = Instant::now() + Duration::from_secs(20);
        while bitten.lock().expect("sound").is_empty() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(20));
        }
        let bitten = bitten.lock().expect("sound");
        assert_eq!(bitten.len(), 1);
        assert!(bitten[0].contains("no sign of life") && bitten[0].ends_with("the power is off"));
    }
}
