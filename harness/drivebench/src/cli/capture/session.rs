//! A capture that goes on.

use super::place::{TapAt, TapPort};
use super::tap::Tap;
use super::{CaptureArguments, judge};
use crate::capture::files::{Files, Rotation};
use crate::capture::live::{LiveLine, seconds};
use crate::capture::{NamedLink, Piece, RecordedPlace, ends};
use crate::command::exit::Exit;
use crate::command::output::Output;
use rustix::event::{Timespec, poll};
use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant, SystemTime};

/// How often signals are looked at.
const TICK: Duration = Duration::from_millis(200);
/// What arrives within this time is read at once.
const PORTION: Duration = Duration::from_millis(2);
/// Silence in front of the first byte, without which a conversation may have begun before the capture and is not judged, in nanoseconds.
const SILENCE: u64 = 50_000_000;
/// Bytes, telegrams or frames that are kept while the trigger is waited for.
const BEFORE_TRIGGER: usize = 20_000;

/// A capture that goes on.
pub(super) struct Session<'a> {
    arguments: &'a CaptureArguments,
    taps: Vec<Tap>,
    files: Files,
    /// What came before the trigger, with the numbers of the taps; `None` behind it.
    waiting: Option<VecDeque<(usize, Piece)>>,
    began: (Instant, u64),
    /// When the first byte of a ring was heard.
    first: Option<u64>,
    /// A line that ends the capture was seen.
    found: bool,
}

impl<'a> Session<'a> {
    pub(super) fn begin(
        arguments: &'a CaptureArguments,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, (Exit, String)> {
        let names = arguments.tap.iter().map(|tap| &tap.name);
        let twice = names
            .clone()
            .enumerate()
            .find(|(place, name)| names.clone().take(*place).any(|other| other == *name));
        if let Some((_, name)) = twice {
            let what = format!("two taps are named {name}; a name for each is expected");
            return Err((Exit::RigError, what));
        }
        let mut taps = Vec::new();
        for at in opened_first(&arguments.tap) {
            let drives = drives(&arguments.tap, &at.name);
            let tap = Tap::open(at, arguments, drives, stop);
            taps.push(tap.map_err(|error| (error.exit(), format!("{}: {error}", at.name)))?);
        }
        let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let wall = wall.unwrap_or_default().as_nanos();
        let wall = u64::try_from(wall).unwrap_or(0);
        let places: Vec<RecordedPlace> = taps.iter().map(|tap| tap.place.clone()).collect();
        let nanos = |duration: Duration| u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        let rotation = Rotation {
            size: arguments.size,
            every: arguments.every.map(nanos),
            files: arguments.files.and_then(|most| most.try_into().ok()),
        };
        let path = &arguments.output;
        let files = Files::begin(path, &places, rotation, wall).map_err(|error| {
            let what = format!("failed to write {}: {error}", path.display());
            (Exit::RigError, what)
        })?;
        Ok(Self {
            arguments,
            taps,
            files,
            waiting: arguments.trigger.is_some().then(VecDeque::new),
            began: (Instant::now(), wall),
            first: None,
            found: false,
        })
    }

    /// Nanoseconds since 1970, by a clock that never jumps.
    fn now(&self) -> u64 {
        let since = u64::try_from(self.began.0.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.began.1.saturating_add(since)
    }

    pub(super) fn is_over(&self) -> bool {
        let all = self.arguments.duration;
        self.found || all.is_some_and(|all| self.began.0.elapsed() >= all)
    }

    /// Waits until something arrives, for a while.
    fn wait(&self) -> io::Result<()> {
        let all = self.arguments.duration;
        let left = all.map(|all| all.saturating_sub(self.began.0.elapsed()));
        let wait = left.unwrap_or(TICK).min(TICK);
        let ports = self.taps.iter().filter_map(Tap::poll_fd);
        let mut ports: Vec<_> = ports.collect();
        let timeout = Timespec::try_from(wait).ok();
        match poll(&mut ports, timeout.as_ref()) {
            Ok(0) | Err(rustix::io::Errno::INTR) => Ok(()),
            // Reading each byte by itself would cost a computer as much as all else.
            Ok(_) => {
                std::thread::sleep(PORTION.min(wait));
                Ok(())
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Waits for bytes, keeps them, and gives the lines of text that they completed.
    pub(super) fn step(&mut self, new_file: bool) -> io::Result<Vec<String>> {
        if new_file {
            self.files.rotate(self.now())?;
        }
        self.wait()?;
        let mut lines = Vec::new();
        for place in 0..self.taps.len() {
            let now = self.now();
            for piece in self.taps[place].hear(now)? {
                self.take(place, piece, &mut lines)?;
            }
            let idle = self.taps[place].text.idle(now);
            self.say(place, idle, &mut lines)?;
        }
        self.files.flush(self.now())?;
        Ok(lines)
    }

    /// Keeps what was heard, and gives its lines of text.
    fn take(&mut self, place: usize, piece: Piece, lines: &mut Vec<String>) -> io::Result<()> {
        let tap = &mut self.taps[place];
        let said = match &piece {
            Piece::Event(nanos, words) => vec![(*nanos, words.clone())],
            heard => tap.text.piece(heard),
        };
        if let Piece::Octet(byte) = &piece {
            self.first = self.first.or(Some(byte.at.since_start().as_nanos()));
        }
        match &mut self.waiting {
            Some(waiting) if !matches!(piece, Piece::Event(..)) => {
                waiting.push_back((place, piece));
                if waiting.len() > BEFORE_TRIGGER {
                    waiting.pop_front();
                }
            }
            _ => self.files.recorder().piece(place, &piece)?,
        }
        self.say(place, said, lines)
    }

    /// Gives lines their time and their tap; looks for what ends the capture and what it begins at.
    fn say(
        &mut self,
        place: usize,
        said: impl IntoIterator<Item = LiveLine>,
        lines: &mut Vec<String>,
    ) -> io::Result<()> {
        for (nanos, words) in said {
            let since = seconds(nanos.saturating_sub(self.began.1));
            let text = format!("{} {words}", self.taps[place].at.name);
            // The time is left out: its figures are nothing that was heard.
            let has = |word: &Option<String>| word.as_ref().is_some_and(|word| text.contains(word));
            self.found |= has(&self.arguments.until);
            if self.waiting.is_some() && has(&self.arguments.trigger) {
                self.files.begins(nanos);
                for (place, piece) in self.waiting.take().into_iter().flatten() {
                    self.files.recorder().piece(place, &piece)?;
                }
            }
            lines.push(format!("{since} {text}"));
        }
        Ok(())
    }

    /// Says what was heard, whether the kernel sent anything, and judges the capture.
    pub(super) fn end(mut self, output: &mut Output) -> io::Result<Exit> {
        self.files.end(self.now())?;
        let mut spoke = false;
        for tap in &self.taps {
            let (text, sent) = tap.summary();
            spoke |= sent;
            output.say(&text);
        }
        if spoke {
            output.complain("the kernel sent bytes at a tap although the program sent none: another program uses the port");
            return Ok(Exit::RigError);
        }
        let paths: Vec<PathBuf> = self.files.paths().map(PathBuf::from).collect();
        let names = paths.iter().map(|path| path.display().to_string());
        let names: Vec<_> = names.collect();
        // Older parts were removed.
        let removed = self
            .files
            .removed()
            .then_some("its first files were removed");
        let mut exits = Vec::new();
        for part in self.parts() {
            let of_ring = || (part.channel.is_none()).then(|| self.unjudged()).flatten();
            let why = self.unheard(&part).or_else(of_ring).or(removed);
            match why {
                None => exits.push(judge(&paths, self.arguments, part, output)?),
                Some(why) => {
                    output.say(&format!(
                        "  {} not judged: {}; `drivebench import` reads {}\n",
                        part.channel.as_deref().unwrap_or("ring"),
                        why,
                        names.join(" ")
                    ));
                    exits.push(Exit::Incomplete);
                }
            }
        }
        let worst = exits.into_iter().max_by_key(|exit| match exit {
            Exit::Passed => 0,
            Exit::Incomplete => 1,
            Exit::Failed => 2,
            _ => 3,
        });
        Ok(worst.unwrap_or(Exit::Incomplete))
    }

    /// What is judged by itself: the ring, and each bus.
    fn parts(&self) -> Vec<NamedLink> {
        let part = |tap: &Tap| match tap.at.port {
            TapPort::Link(_) => "ring".to_owned(),
            TapPort::Line(..) | TapPort::Frames(..) => format!("bus={}", tap.at.name),
        };
        let mut names: Vec<String> = self.taps.iter().map(part).collect();
        names.dedup();
        names.sort();
        names.dedup();
        names.iter().filter_map(|name| name.parse().ok()).collect()
    }

    /// Why a part cannot be judged where nothing of it was heard.
    fn unheard(&self, part: &NamedLink) -> Option<&'static str> {
        let of_part = |tap: &&Tap| match &part.channel {
            Some(name) => tap.at.name == *name,
            None => matches!(tap.at.port, TapPort::Link(_)),
        };
        let heard = self.taps.iter().filter(of_part).any(|tap| tap.pieces > 0);
        (!heard).then_some("nothing was heard")
    }

    /// Why the ring cannot be judged, where it cannot.
    fn unjudged(&self) -> Option<&'static str> {
        let first = self.first?;
        if self.arguments.trigger.is_some() {
            return Some("it begins at the trigger, in the middle of a conversation");
        }
        let sends = |tap: &Tap| ends(&tap.at.name).is_some_and(|(_, from, _)| from.is_none());
        if !self.taps.iter().any(sends) {
            return Some("no tap is on the master's outgoing link, so what was sent is not known");
        }
        let early = first.saturating_sub(self.began.1) < SILENCE;
        early.then_some("the conversation had begun before the capture")
    }
}

/// CAN adapters first: they take a while, and what serial ports receive meanwhile would wait.
fn opened_first(taps: &[TapAt]) -> impl Iterator<Item = &TapAt> {
    let adapter = |tap: &&TapAt| matches!(tap.port, TapPort::Frames(..));
    let serial = move |tap: &&TapAt| !adapter(tap);
    taps.iter()
        .filter(adapter)
        .chain(taps.iter().filter(serial))
}

/// The number of drives of the ring of a link, which the tap at the master's outgoing link says.
fn drives(taps: &[TapAt], link: &str) -> Option<u8> {
    let (ring, ..) = ends(link)?;
    let mut all = taps.iter().filter_map(|tap| ends(&tap.name));
    let first = all.find(|(known, from, _)| *known == ring && from.is_none());
    first.and_then(|(_, _, to)| to).map(|drive| drive + 1)
}
