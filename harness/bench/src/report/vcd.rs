//! Lines as a value change dump (IEEE 1364) for logic analysers' programs: sigrok, PulseView, GTKWave.
//!
//! For each sender one wire with its line as the receiver heard it: start bit, eight data bits, parity bit and stop bit; the byte read last and
//! what its receiver noticed (`status`). A bus can add what the sender was doing (`state`).
//!
//! | `status` | |
//! |---|---|
//! | 0 | good |
//! | 1 | parity error |
//! | 2 | framing error |
//! | 3 | break |
//! | 4 | overrun |
//! | 5 | nothing arrived |
//!
//! A parity error is drawn as a wrong parity bit, a framing error as a low first three quarters of a stop bit, a break
//! as a line that is low for eleven and a half bits (how long it really was, a trace does not say), an overrun as the good
//! byte that the line carried. A byte that did not arrive is not on the line. Bytes that come closer than a byte time are
//! drawn one after the other.

use harness_proto::line::LineError;
use harness_sim::record::{Channel, LineByte};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::io::Write;

/// What a value change dump holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signals {
    /// The lines, and beside them bytes, status and states as vectors.
    All,
    /// The lines alone: sigrok up to 0.5.2 stops at the first vector.
    Lines,
}

/// How lines are drawn.
#[derive(Clone, Copy, Debug)]
pub struct Drawing {
    /// Thirds of a nanosecond in a bit.
    pub bit: u64,
    /// Thirds of a nanosecond in a tick of the time scale.
    pub tick: u64,
    /// The time scale, as the file says it.
    pub scale: &'static str,
    /// Whether parity is odd.
    pub odd: bool,
    /// What is written.
    pub signals: Signals,
}

/// The state of a sender at each of its bytes, 0 to 7.
pub type States<'t> = Box<dyn FnMut(&LineByte) -> u8 + 't>;

/// The line of one sender.
pub struct DrawnLine<'t> {
    /// Letters, digits and `_`.
    pub name: String,
    /// A number of its own, for the short names of its variables.
    pub place: usize,
    pub channel: &'t Channel,
    /// What its sender was doing; `None` where this is not shown.
    pub states: Option<States<'t>>,
}

/// Writes lines.
///
/// # Errors
/// Writing fails.
pub fn write<'t>(
    wires: impl IntoIterator<Item = DrawnLine<'t>>,
    drawing: Drawing,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let drawn = wires.into_iter().map(|wire| Waveform::new(wire, drawing));
    draw(&mut drawn.collect::<Vec<_>>(), drawing, out)
}

fn draw(links: &mut [Waveform<'_>], drawing: Drawing, out: &mut dyn Write) -> std::io::Result<()> {
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
    // A quiet byte time after the last one, so that a decoder sees its stop bit.
    writeln!(out, "#{}", end.max(now) + 11 * drawing.bit / drawing.tick)?;
    out.flush()
}

fn head(links: &[Waveform<'_>], drawing: Drawing, out: &mut dyn Write) -> std::io::Result<()> {
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
        if vectors && link.states.is_some() {
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
        if vectors && link.states.is_some() {
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
struct Waveform<'t> {
    name: String,
    codes: [String; 4],
    bytes: std::slice::Iter<'t, LineByte>,
    states: Option<States<'t>>,
    drawing: Drawing,
    /// Until when the line is drawn, in thirds of a nanosecond.
    free: u64,
    changes: VecDeque<(u64, Change)>,
    /// What `byte`, `status` and `state` are.
    shown: (Option<u8>, u8, u8),
}

impl<'t> Waveform<'t> {
    fn new(wire: DrawnLine<'t>, drawing: Drawing) -> Self {
        let code = |kind| code(wire.place * 4 + kind);
        Self {
            name: wire.name,
            codes: [code(0), code(1), code(2), code(3)],
            bytes: wire.channel.octets().iter(),
            states: wire.states,
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
        let state = self.states.as_mut().map_or(7, |states| states(byte));
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
        let read = Change::Read {
            byte: byte.received,
            status,
            state,
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
                if self.states.is_some() && self.shown.2 != state {
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
