//! A trace as a value change dump (IEEE 1364) for logic analysers' programs: sigrok, PulseView, GTKWave.
//!
//! For each link one wire with its line as the receiver heard it, start bit, eight data bits, parity bit and stop bit
//! of 8O1; the byte read last, what its receiver noticed (`status`), and what its sender was doing (`state`).
//! The time scale is 100 ns: a bit at 38400 bit/s is 260.4 of them.
//!
//! | `status` | | `state` | |
//! |---|---|---|---|
//! | 0 | good | 0 | SYNCO or PAUSE |
//! | 1 | parity error | 1 | forwarding a telegram |
//! | 2 | framing error | 2 | addressed: the drive's answer |
//! | 3 | break | 3 | zero of the error mode |
//! | 4 | overrun | 4 | received + 1 |
//! | 5 | nothing arrived | 5 | check sequence |
//! | | | 6 | lost, or no telegram |
//!
//! A parity error is drawn as a wrong parity bit, a framing error as a low first three quarters of a stop bit, a break
//! as a line that is low for eleven and a half bits (how long it really was, a trace does not say), an overrun as the good
//! byte that the line carried. A byte that did not arrive is not on the line. Bytes that come closer than a byte time are
//! drawn one behind the other.
//!
//! A line that all stations share has for each station one wire with what this station sends, 8E1, and no `state`. The time scale is 10 ns: a bit
//! at 1.5 Mbit/s is 66.7 of them.

use crate::report::walk::{Reader, SenderState};
use harness_bench::report::pcapng::name;
use harness_proto::line::{LineError, Rate};
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Trace};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::io::Write;

/// How lines are drawn.
#[derive(Clone, Copy)]
struct Drawing {
    /// Thirds of a nanosecond in a bit, and in a tick.
    bit: u64,
    tick: u64,
    /// The time scale, as the file says it.
    scale: &'static str,
    /// Whether parity is odd.
    odd: bool,
    signals: Signals,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signals {
    /// The lines, and beside them bytes, status and states as vectors.
    All,
    /// The lines alone: sigrok up to 0.5.2 stops at the first vector.
    Lines,
}

/// Writes one or two rings of a run.
///
/// # Errors
/// What the writer says.
pub fn write(
    traces: &[Trace],
    rate: Rate,
    signals: Signals,
    mut out: impl Write,
) -> std::io::Result<()> {
    let drawing = Drawing {
        bit: rate.bit_time().units(),
        tick: 300,
        scale: "100 ns",
        odd: true,
        signals,
    };
    let mut links = Vec::new();
    for (ring, trace) in traces.iter().enumerate() {
        for (link, reader) in trace.channels.iter().zip(Reader::all(trace)) {
            // `98->97` as a word that every program takes for a name.
            let name = name(ring, link)
                .replace("->", "_to_")
                .replace("2:", "ring2_");
            let place = match link.from {
                None => 250,
                Some(drive) => usize::from(drive),
            };
            let place = ring * 256 + place;
            links.push(Drawn::new(name, place, link, (Some(reader), drawing)));
        }
    }
    draw(&mut links, drawing, &mut out)
}

/// Writes what the stations of a shared line sent, 8E1, at a number of bits a second.
///
/// # Errors
/// What the writer says.
pub fn write_shared(
    traces: &[Trace],
    bits_per_second: u32,
    signals: Signals,
    mut out: impl Write,
) -> std::io::Result<()> {
    let drawing = Drawing {
        bit: 3_000_000_000 / u64::from(bits_per_second.max(1)),
        tick: 30,
        scale: "10 ns",
        odd: false,
        signals,
    };
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    let named = channels.enumerate().map(|(place, channel)| {
        let name = match channel.from {
            None => "master".to_owned(),
            Some(drive) => format!("drive_{drive}"),
        };
        Drawn::new(name, place, channel, (None, drawing))
    });
    draw(&mut named.collect::<Vec<_>>(), drawing, &mut out)
}

fn draw(links: &mut [Drawn<'_>], drawing: Drawing, out: &mut impl Write) -> std::io::Result<()> {
    head(links, drawing, out)?;
    let mut heap: BinaryHeap<Reverse<(u64, usize)>> = BinaryHeap::new();
    for (place, link) in links.iter_mut().enumerate() {
        heap.extend(link.next_tick().map(|tick| Reverse((tick, place))));
    }
    let mut now = 0;
    let mut text = String::new();
    while let Some(mut top) = heap.peek_mut() {
        let Reverse((tick, place)) = *top;
        if tick > now {
            now = tick;
            text.push('#');
            push_number(&mut text, tick);
            text.push('\n');
        }
        let link = &mut links[place];
        link.write_change(&mut text);
        match link.next_tick() {
            Some(next) => *top = Reverse((next, place)),
            None => drop(std::collections::binary_heap::PeekMut::pop(top)),
        }
        if text.len() > 32_768 {
            out.write_all(text.as_bytes())?;
            text.clear();
        }
    }
    out.write_all(text.as_bytes())?;
    let ends = links.iter().map(|link| link.free / drawing.tick);
    let end = ends.max().unwrap_or(0);
    // A quiet byte time behind the last one, so that a decoder sees its stop bit.
    writeln!(out, "#{}", end.max(now) + 11 * drawing.bit / drawing.tick)?;
    out.flush()
}

fn head(links: &[Drawn<'_>], drawing: Drawing, out: &mut impl Write) -> std::io::Result<()> {
    let vectors = drawing.signals == Signals::All;
    let scale = drawing.scale;
    writeln!(out, "$version drivebench $end\n$timescale {scale} $end")?;
    for link in links {
        let [line, byte, status, state] = &link.codes;
        let name = &link.name;
        writeln!(out, "$scope module {name} $end")?;
        writeln!(out, "$var wire 1 {line} {name}_line $end")?;
        if vectors {
            writeln!(out, "$var wire 8 {byte} {name}_byte $end")?;
            writeln!(out, "$var wire 3 {status} {name}_status $end")?;
        }
        if vectors && link.reader.is_some() {
            writeln!(out, "$var wire 3 {state} {name}_state $end")?;
        }
        writeln!(out, "$upscope $end")?;
    }
    writeln!(out, "$enddefinitions $end\n#0\n$dumpvars")?;
    for link in links {
        let [line, byte, status, state] = &link.codes;
        writeln!(out, "1{line}")?;
        if vectors {
            writeln!(out, "bxxxxxxxx {byte}\nbxxx {status}")?;
        }
        if vectors && link.reader.is_some() {
            writeln!(out, "bxxx {state}")?;
        }
    }
    writeln!(out, "$end")
}

/// A change that waits for its time.
#[derive(Clone, Copy)]
enum Change {
    Line(bool),
    Read {
        byte: Option<u8>,
        status: u8,
        state: u8,
    },
}

/// One link on its way through its bytes.
struct Drawn<'t> {
    name: String,
    codes: [String; 4],
    bytes: std::slice::Iter<'t, LineByte>,
    /// Tells what the sender was doing; `None` where `state` is not shown.
    reader: Option<Reader<'t>>,
    drawing: Drawing,
    /// Until when the line is drawn, in thirds of a nanosecond.
    free: u64,
    changes: VecDeque<(u64, Change)>,
    /// What `byte`, `status` and `state` are.
    shown: (Option<u8>, u8, u8),
}

impl<'t> Drawn<'t> {
    fn new(
        name: String,
        place: usize,
        channel: &'t Channel,
        (reader, drawing): (Option<Reader<'t>>, Drawing),
    ) -> Self {
        let code = |kind| code(place * 4 + kind);
        Self {
            name,
            codes: [code(0), code(1), code(2), code(3)],
            bytes: channel.octets().iter(),
            reader,
            drawing,
            free: 0,
            changes: VecDeque::new(),
            shown: (None, 7, 7),
        }
    }

    fn next_tick(&mut self) -> Option<u64> {
        while self.changes.is_empty() {
            let byte = self.bytes.next()?;
            self.draw(byte);
        }
        // A decoder wants to see the line idle before the first start bit, which may be at the very start.
        let tick = self.drawing.tick;
        self.changes.front().map(|(at, _)| (at / tick).max(1))
    }

    /// The changes of the line for one byte, from its start bit on.
    fn draw(&mut self, byte: &LineByte) {
        let seen = self.reader.as_mut().map(|reader| reader.see(byte).state);
        let Drawing { bit, odd, .. } = self.drawing;
        let at = byte.at.since_start().units();
        let start = at.saturating_sub(11 * bit).max(self.free);
        let status = match (byte.received, byte.error) {
            (None, _) => 5,
            (_, None) => 0,
            (_, Some(LineError::Parity)) => 1,
            (_, Some(LineError::Framing)) => 2,
            (_, Some(LineError::Break)) => 3,
            (_, Some(LineError::Overrun)) => 4,
        };
        let state = seen.and_then(|seen| SenderState::ALL.iter().position(|own| *own == seen));
        let read = Change::Read {
            byte: byte.received,
            status,
            state: state.and_then(|s| u8::try_from(s).ok()).unwrap_or(7),
        };
        let Some(received) = byte.received else {
            // The line stays as it is; what was read before it comes before it.
            self.changes.push_back((at.max(self.free), read));
            return;
        };
        if byte.error == Some(LineError::Break) {
            self.changes.push_back((start, Change::Line(false)));
            self.changes.push_back((start + 11 * bit, read));
            let end = start + 11 * bit + bit / 2;
            self.changes.push_back((end, Change::Line(true)));
            self.free = start + 12 * bit;
            return;
        }
        let wrong = byte.error == Some(LineError::Parity);
        let parity = (received.count_ones().is_multiple_of(2) == odd) != wrong;
        // Start bit 0, data bits with the lowest first, parity bit: bit 0 goes first.
        let bits = u16::from(received) << 1 | u16::from(parity) << 9;
        let mut level = true;
        for place in 0..10 {
            let next = bits >> place & 1 == 1;
            if next != level {
                let at = start + place * bit;
                self.changes.push_back((at, Change::Line(next)));
                level = next;
            }
        }
        let stop = start + 10 * bit;
        if byte.error == Some(LineError::Framing) {
            if level {
                self.changes.push_back((stop, Change::Line(false)));
            }
            let end = stop + bit * 3 / 4;
            self.changes.push_back((end, Change::Line(true)));
        } else if !level {
            self.changes.push_back((stop, Change::Line(true)));
        }
        self.free = start + 11 * bit;
        self.changes.push_back((self.free, read));
    }

    fn write_change(&mut self, text: &mut String) {
        let Some((_, change)) = self.changes.pop_front() else {
            return;
        };
        let [line, byte_code, status_code, state_code] = &self.codes;
        match change {
            Change::Line(level) => {
                text.push(if level { '1' } else { '0' });
                text.push_str(line);
                text.push('\n');
            }
            Change::Read { .. } if self.drawing.signals == Signals::Lines => {}
            Change::Read {
                byte,
                status,
                state,
            } => {
                if self.shown.0 != byte {
                    vector(text, 8, byte, byte_code);
                }
                if self.shown.1 != status {
                    vector(text, 3, Some(status), status_code);
                }
                if self.reader.is_some() && self.shown.2 != state {
                    vector(text, 3, Some(state), state_code);
                }
                self.shown = (byte, status, state);
            }
        }
    }
}

fn vector(text: &mut String, width: u8, value: Option<u8>, code: &str) {
    text.push('b');
    for place in (0..width).rev() {
        text.push(match value {
            None => 'x',
            Some(value) if value >> place & 1 == 1 => '1',
            Some(_) => '0',
        });
    }
    text.push(' ');
    text.push_str(code);
    text.push('\n');
}

fn push_number(text: &mut String, number: u64) {
    let mut digits = [b'0'; 20];
    let mut left = number;
    let mut place = digits.len();
    loop {
        place -= 1;
        digits[place] = b'0' + u8::try_from(left % 10).unwrap_or(0);
        left /= 10;
        if left == 0 {
            break;
        }
    }
    text.extend(digits[place..].iter().map(|digit| char::from(*digit)));
}

/// The short name of a variable: printable characters without a space.
fn code(number: usize) -> String {
    const FIRST: u8 = b'!';
    const COUNT: usize = 94;
    let mut left = number;
    let mut text = String::new();
    loop {
        let digit = u8::try_from(left % COUNT).unwrap_or(0);
        text.push(char::from(FIRST + digit));
        left /= COUNT;
        if left == 0 {
            return text;
        }
    }
}
