//! Value change dumps (IEEE 1364) of any writer: the wires of one bit are levels of lines.
//!
//! Tokens are separated by white space, and lines mean nothing. Values may stand at `#0` without `$dumpvars`, times may have places, two
//! names may share an identifier, and a file may end in the middle of a token where a program was stopped.

use super::super::CaptureError;
use super::levels::{Levels, LineLevel, sample_time};
use super::links::{ChannelRead, Signal};
use super::numbers::{SignedTime, units};
use super::sigrok::frequency;
use std::collections::HashMap;

/// The time scales: their names, and their length in femtoseconds.
const UNITS: [(&str, i128); 6] = [
    ("s", 1_000_000_000_000_000),
    ("ms", 1_000_000_000_000),
    ("us", 1_000_000_000),
    ("ns", 1_000_000),
    ("ps", 1_000),
    ("fs", 1),
];

/// Scopes around a wire that its name may have.
const DEEPEST: usize = 32;

/// Whether a file is a value change dump: its first token is a keyword of a header.
pub(super) fn recognised(bytes: &[u8]) -> bool {
    const FIRST: [&[u8]; 8] = [
        b"$date",
        b"$version",
        b"$timescale",
        b"$comment",
        b"$scope",
        b"$var",
        b"$enddefinitions",
        b"$attrbegin",
    ];
    let first = tokens(&bytes[said(bytes)..]).next();
    first.is_some_and(|(_, token)| FIRST.contains(&token))
}

/// The length of the line that sigrok-cli 0.7 prints before what it converts: `META samplerate: 10000000`.
fn said(bytes: &[u8]) -> usize {
    let line = bytes.iter().position(|byte| *byte == b'\n');
    line.filter(|_| bytes.starts_with(b"META ")).unwrap_or(0)
}

/// The tokens with their places.
fn tokens(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let rest = &bytes[at..];
        let start = at + rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let rest = &bytes[start..];
        let length = rest.iter().position(u8::is_ascii_whitespace);
        at = start + length.unwrap_or(rest.len());
        Some((start, &bytes[start..at]))
    })
}

fn wrong(offset: usize, what: impl Into<String>) -> CaptureError {
    CaptureError::At {
        offset,
        what: what.into(),
    }
}

fn shown(token: &[u8]) -> String {
    String::from_utf8_lossy(token).chars().take(40).collect()
}

/// A wire that is being read.
#[derive(Default)]
struct VcdWire {
    names: Vec<String>,
    levels: Levels,
}

#[derive(Default)]
struct VcdReader<'b> {
    wires: Vec<VcdWire>,
    /// The time between samples, which sigrok writes into a comment.
    sample: Option<SignedTime>,
    by_identifier: HashMap<&'b [u8], usize>,
    scopes: Vec<&'b [u8]>,
    /// Femtoseconds of a tick.
    tick: Option<i128>,
    now: SignedTime,
    /// Whether a value has changed since the last time.
    changed: bool,
    /// Bits of a vector, of which the identifier follows.
    bits: Option<&'b [u8]>,
    /// A value of another kind, of which the identifier follows.
    passed_over: bool,
}

/// The wires of a file, and what is to be told about it.
///
/// # Errors
/// A token that cannot be, with its place.
pub(super) fn read(bytes: &[u8]) -> Result<(Vec<ChannelRead>, Vec<String>), CaptureError> {
    let mut notes = Vec::new();
    // A token at the very end may be half of one.
    let whole = match bytes.last() {
        Some(last) if !last.is_ascii_whitespace() => {
            let end = bytes.iter().rposition(u8::is_ascii_whitespace).unwrap_or(0);
            let cut = &bytes[end..];
            if cut.trim_ascii() != b"$end" {
                notes.push(format!(
                    "the file ends in the middle of `{}`, which was not read",
                    shown(cut.trim_ascii())
                ));
                &bytes[..end]
            } else {
                bytes
            }
        }
        _ => bytes,
    };
    let mut reader = VcdReader::default();
    let skipped = said(whole);
    let mut tokens = tokens(whole).skip_while(|(at, _)| *at < skipped);
    if !reader.header(&mut tokens)? {
        return Err(wrong(
            whole.len(),
            "the file ends in its header: `$enddefinitions` is expected",
        ));
    }
    while let Some((at, token)) = tokens.next() {
        if token == b"$comment" {
            tokens.by_ref().find(|(_, token)| *token == b"$end");
        } else {
            reader.token(at, token)?;
        }
    }
    let (now, ended, sample) = (reader.now, !reader.changed, reader.sample);
    let wires = reader.wires.into_iter();
    let channels = wires.map(|mut wire| {
        wire.levels.end = ended.then_some(now);
        wire.levels.sample = sample;
        ChannelRead {
            names: wire.names,
            signal: Signal::Levels(wire.levels),
        }
    });
    Ok((channels.collect(), notes))
}

impl<'b> VcdReader<'b> {
    /// Reads declarations; `false` where the file ends in them.
    fn header(
        &mut self,
        tokens: &mut dyn Iterator<Item = (usize, &'b [u8])>,
    ) -> Result<bool, CaptureError> {
        let mut words: Vec<&'b [u8]> = Vec::new();
        while let Some((at, keyword)) = tokens.next() {
            if !keyword.starts_with(b"$") {
                let shown = shown(keyword);
                return Err(wrong(at, format!("`{shown}`: a declaration is expected")));
            }
            words.clear();
            loop {
                match tokens.next() {
                    None => return Ok(false),
                    Some((_, b"$end")) => break,
                    // Of a long comment only the beginning is kept.
                    Some((_, word)) if words.len() < 16 => words.push(word),
                    Some(_) => {}
                }
            }
            match (keyword, words.as_slice()) {
                (b"$enddefinitions", _) => return Ok(true),
                (b"$timescale", words) => self.tick = Some(tick(&words.concat(), at)?),
                (b"$comment", [.., b"at", number, unit]) => {
                    let rate =
                        String::from_utf8_lossy(&[*number, b" ", *unit].concat()).into_owned();
                    self.sample = frequency(&rate).and_then(sample_time);
                }
                (b"$scope", [_, name, ..]) => self.scopes.push(name),
                (b"$upscope", _) => drop(self.scopes.pop()),
                (b"$var", [_, b"1", identifier, name, ..]) => self.declare(identifier, name),
                (b"$var", [_, _, _, _, ..]) => {}
                (b"$var", _) => {
                    return Err(wrong(
                        at,
                        "a `$var` has a kind, a width, an identifier and a name",
                    ));
                }
                _ => {}
            }
        }
        Ok(false)
    }

    fn declare(&mut self, identifier: &'b [u8], name: &'b [u8]) {
        let place = *self
            .by_identifier
            .entry(identifier)
            .or_insert(self.wires.len());
        if place == self.wires.len() {
            self.wires.push(VcdWire::default());
        }
        let name = String::from_utf8_lossy(name).into_owned();
        // By its name, with its scope, and with all scopes around it.
        let depth = self.scopes.len();
        let shown = [0, depth.min(1), depth.min(DEEPEST)];
        let mut names = shown.map(|count| {
            let scopes = self.scopes[depth - count..].iter();
            let scopes = scopes.map(|scope| String::from_utf8_lossy(scope));
            scopes
                .chain([name.as_str().into()])
                .collect::<Vec<_>>()
                .join(".")
        });
        names.sort_by_key(String::len);
        let known = &mut self.wires[place].names;
        for name in names {
            if !known.contains(&name) {
                known.push(name);
            }
        }
    }

    /// A token after the header.
    fn token(&mut self, at: usize, token: &'b [u8]) -> Result<(), CaptureError> {
        if std::mem::take(&mut self.passed_over) {
            return Ok(());
        }
        if let Some(bits) = self.bits.take() {
            return self.value(at, token, bits.last().copied().unwrap_or(b'x'));
        }
        match token.split_first() {
            Some((b'#', digits)) => self.time(at, digits),
            // $dumpvars, $dumpall, $dumpon, $dumpoff and their $end.
            Some((b'$', _)) => Ok(()),
            Some((b'b' | b'B', bits)) => {
                self.bits = Some(bits);
                Ok(())
            }
            Some((b'r' | b'R' | b's' | b'S', _)) => {
                self.passed_over = true;
                Ok(())
            }
            Some((level, identifier)) => self.value(at, identifier, *level),
            None => Ok(()),
        }
    }

    fn time(&mut self, at: usize, digits: &[u8]) -> Result<(), CaptureError> {
        let now = std::str::from_utf8(digits)
            .ok()
            .and_then(|text| self.at(text));
        let Some(now) = now else {
            let shown = shown(digits);
            return Err(wrong(at, format!("`#{shown}` is no time")));
        };
        if now < self.now {
            return Err(wrong(at, "this time is before the one in front of it"));
        }
        self.changed = false;
        self.now = now;
        Ok(())
    }

    /// A time in ticks, with places where a writer has them.
    fn at(&self, text: &str) -> Option<SignedTime> {
        let tick = self.tick.unwrap_or(1_000_000);
        let (whole, places) = text.split_once('.').unwrap_or((text, ""));
        let places = &places[..places.len().min(9)];
        let digits = |text: &str| text.bytes().all(|digit| digit.is_ascii_digit());
        if whole.is_empty() || whole.len() > 20 || !digits(whole) || !digits(places) {
            return None;
        }
        let ticks: i128 = whole.parse().ok()?;
        let part: i128 = match places {
            "" => 0,
            places => places.parse::<i128>().ok()? * tick / 10_i128.pow(places.len() as u32),
        };
        let femtoseconds = ticks.checked_mul(tick)?.checked_add(part)?;
        match femtoseconds % 1_000 {
            0 => units(femtoseconds / 1_000),
            _ => SignedTime::try_from((femtoseconds.checked_mul(3)? + 500_000) / 1_000_000).ok(),
        }
    }

    fn value(&mut self, at: usize, identifier: &[u8], level: u8) -> Result<(), CaptureError> {
        let Some(level) = LineLevel::of(level) else {
            let shown = char::from(level).escape_default();
            return Err(wrong(at, format!("`{shown}` is no level: 0, 1, x or z")));
        };
        self.changed = true;
        if let Some(place) = self.by_identifier.get(identifier) {
            // Times have been compared already.
            self.wires[*place].levels.push(self.now, level);
        }
        Ok(())
    }
}

/// A time scale, `100ns`, in femtoseconds.
fn tick(text: &[u8], at: usize) -> Result<i128, CaptureError> {
    let text = std::str::from_utf8(text).unwrap_or_default();
    let digits = text.find(|character: char| !character.is_ascii_digit());
    let (number, unit) = text.split_at(digits.unwrap_or(text.len()));
    let unit = UNITS.iter().find(|(name, _)| *name == unit);
    match (number, unit) {
        ("1" | "10" | "100", Some((_, length))) => Ok(number.parse::<i128>().unwrap_or(1) * length),
        _ => Err(wrong(
            at,
            format!(
                "a time scale of `{}` is not possible: 1, 10 or 100 of s, ms, us, ns, ps or fs",
                shown(text.as_bytes())
            ),
        )),
    }
}
