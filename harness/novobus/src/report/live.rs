//! The bytes of a link as lines of text while they arrive: a line a telegram, its bytes and what they say.

use super::meaning::{ByteRole, Meaning, Observer};
use crate::locate::{FALSE, Location, locate};
use harness_bench::capture::Piece;
use harness_bench::capture::live::{LiveLine, LiveText};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::MAX_DRIVES;
use std::fmt::Write as _;

/// The most bytes of a line that is no telegram.
const MOST: usize = 16;
/// A silence that ends a telegram that is not complete, in nanoseconds.
const PATIENCE: u64 = 50_000_000;
/// A silence in which the master sends no check sequence any more, in nanoseconds.
const SILENT: u64 = 100_000_000;
/// Bytes that a location is read from at most: more than zeros and numbers of one fault.
const HEARD: usize = 1_024;

/// What the bytes of a line are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum ByteKind {
    #[default]
    Telegram,
    Idle,
    ErrorMode,
    CheckSequence,
    /// It belongs to whatever the line is of.
    Any,
}

impl ByteKind {
    const fn of(role: ByteRole) -> Self {
        match role {
            ByteRole::Synco | ByteRole::Pause => Self::Idle,
            ByteRole::ErrorZero | ByteRole::ErrorAddress => Self::ErrorMode,
            ByteRole::CheckSequence => Self::CheckSequence,
            ByteRole::Foreign | ByteRole::Lost => Self::Any,
            _ => Self::Telegram,
        }
    }
}

/// A line that is being made.
#[derive(Clone, Debug, Default)]
struct OpenLine {
    kind: ByteKind,
    bytes: usize,
    text: String,
    phrases: Vec<String>,
    first: u64,
}

/// Text of the bytes of one link.
pub(crate) struct LinkText {
    observer: Observer,
    to: Option<u8>,
    /// The number of drives, where it is known.
    drives: Option<u8>,
    /// A pause that ends a line, in nanoseconds.
    pause: u64,
    begun: OpenLine,
    /// When the last byte came, in nanoseconds.
    last: u64,
    /// What the master has received since the last check sequence.
    heard: Vec<Received>,
    /// The drive that was named since then.
    named: Option<u8>,
}

impl LinkText {
    /// Text of the link between two ends, of a ring with this number of drives where it is known.
    pub(crate) fn new(from: Option<u8>, to: Option<u8>, rate: Rate, drives: Option<u8>) -> Self {
        Self {
            observer: Observer::new(from, to),
            to,
            drives,
            pause: rate.byte_time().as_nanos() * 2,
            begun: OpenLine::default(),
            last: 0,
            heard: Vec::new(),
            named: None,
        }
    }

    fn byte(&mut self, nanos: u64, received: Received) -> Vec<LiveLine> {
        let mut lines = Vec::from_iter(self.idle(nanos));
        let meaning = self.observer.see(Some(received.byte), received.error);
        let kind = ByteKind::of(meaning.role);
        let begins = meaning.role == ByteRole::Sync
            || (kind != ByteKind::Any && kind != self.begun.kind)
            || (self.begun.bytes >= MOST && kind != ByteKind::Telegram);
        if begins {
            lines.extend(self.end());
        }
        let line = &mut self.begun;
        if line.bytes == 0 {
            line.first = nanos;
            line.kind = kind;
        } else {
            line.text.push(' ');
        }
        // Writing to a String cannot fail.
        let _infallible = write!(line.text, "{:02X}", received.byte);
        if let Some(error) = received.error {
            let _infallible = write!(line.text, " ({error})");
        }
        line.bytes += 1;
        self.last = nanos;
        if let Some((phrase, goes_on)) = phrase(&meaning, received.byte) {
            if goes_on
                && line
                    .phrases
                    .last()
                    .is_some_and(|last| is_part(last, &phrase))
            {
                line.phrases.pop();
            }
            if line.phrases.last() != Some(&phrase) {
                line.phrases.push(phrase);
            }
        }
        if let Some(words) = self.located(meaning.role, received) {
            lines.extend(self.end());
            lines.push((nanos, words));
        }
        lines
    }

    fn end(&mut self) -> Option<LiveLine> {
        let line = std::mem::take(&mut self.begun);
        let words = line.phrases.join("; ");
        let text = match words.is_empty() {
            true => line.text,
            false => format!("{}  {words}", line.text),
        };
        (line.bytes > 0).then_some((line.first, text))
    }

    /// The fault that the ring spells out, when it is known for sure, and at the latest when a check sequence begins.
    fn located(&mut self, role: ByteRole, received: Received) -> Option<String> {
        if self.to.is_some() {
            return None;
        }
        if role == ByteRole::CheckSequence {
            let before = self.heard.len().saturating_sub(FALSE);
            let found = self.spelled(before).map(|location| location.drive);
            let said = found.and_then(|drive| self.name(drive));
            self.heard.clear();
            self.named = None;
            return said;
        }
        if self.heard.len() >= HEARD {
            self.heard.drain(..HEARD / 2);
        }
        self.heard.push(received);
        let in_error = matches!(role, ByteRole::ErrorZero | ByteRole::ErrorAddress);
        let found = in_error.then(|| self.spelled(self.heard.len())).flatten()?;
        found.sure.then(|| self.name(found.drive)).flatten()
    }

    /// The drive that the first of the bytes since the last check sequence spell out.
    fn spelled(&self, bytes: usize) -> Option<Location> {
        let drives = self.drives.unwrap_or(MAX_DRIVES as u8);
        locate(&self.heard[..bytes], drives)
    }

    /// Names a drive, unless it is named already.
    fn name(&mut self, drive: u8) -> Option<String> {
        let again = self.named.replace(drive) == Some(drive);
        let cable = in_front(drive, self.drives);
        (!again).then(|| format!("located: drive {drive} saw a fault first: {cable}"))
    }

    /// What a ring spelled out that is silent now, unless the zeros of a check sequence may have changed it.
    fn located_in_silence(&mut self, now: u64) -> Option<LiveLine> {
        let found = self.spelled(self.heard.len())?;
        let before = self.spelled(self.heard.len().saturating_sub(FALSE));
        let changed = before.is_some_and(|location| location.drive != found.drive);
        if changed && !found.sure {
            return None;
        }
        self.name(found.drive).map(|words| (now, words))
    }
}

impl LiveText for LinkText {
    fn piece(&mut self, piece: &Piece) -> Vec<LiveLine> {
        match piece {
            Piece::Octet(byte) => byte.arrival().map_or(Vec::new(), |received| {
                self.byte(byte.at.since_start().as_nanos(), received)
            }),
            _ => Vec::new(),
        }
    }

    fn idle(&mut self, now: u64) -> Option<LiveLine> {
        let pause = match self.observer.in_telegram() {
            // A port gives bytes in portions.
            true => PATIENCE,
            false => self.pause,
        };
        let silence = now.saturating_sub(self.last);
        if self.begun.bytes > 0 {
            return (silence > pause).then(|| self.end()).flatten();
        }
        (silence > SILENT)
            .then(|| self.located_in_silence(now))
            .flatten()
    }
}

/// The cable in front of a drive, in words; `drives` is the size of the ring where it is known.
pub(crate) fn in_front(drive: u8, drives: Option<u8>) -> String {
    let before = match drives {
        Some(drives) if drive + 1 == drives => "the master".to_owned(),
        _ => format!("drive {}", u16::from(drive) + 1),
    };
    format!("the fault is on the cable between {before} and drive {drive}, or in the sender there")
}

/// What a byte adds to a line, and whether it replaces what the byte before it of the same command has added.
fn phrase(meaning: &Meaning, byte: u8) -> Option<(String, bool)> {
    let words = || meaning.words(Some(byte));
    match meaning.role {
        ByteRole::Sync | ByteRole::Address => None,
        ByteRole::Parameter | ByteRole::Data => {
            let words = words();
            let (words, _) = words.rsplit_once(": ")?;
            Some((words.to_owned(), true))
        }
        ByteRole::Check if meaning.fits != Some(false) => None,
        _ => Some((words(), false)),
    }
}

/// Whether a phrase says the same of a command as another one, but not of which cell.
fn is_part(shorter: &str, longer: &str) -> bool {
    let command = |words: &str| words.split(" for drive").next().map(str::to_owned);
    match (command(shorter), command(longer)) {
        (Some(shorter), Some(longer)) => longer.starts_with(&shorter),
        _ => false,
    }
}
