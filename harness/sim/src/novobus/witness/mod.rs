//! A witness judges a complete ND21 by the rules that need no second model of the drive.
//!
//! It receives the same bytes as the drive and predicts each answer with the [reference model](crate::novobus::reference) of the bus
//! (ND21 9, 10), which shares no code with the drive's own end of the bus. Before each byte it copies the cells that the drive changes by
//! itself from the drive's memory into the reference. No other cell may change between two bytes, and a byte may change only the cells
//! that it addresses, as far as the tables let them be written (14.2.1). It checks silence against the times of 9.9, the EEPROM
//! controller against the EEPROM's contents when the controller reports that it is done, and the invariants of the drive after
//! every cycle. It does not judge how a motor moves within these rules.

mod cells;
mod eeprom;

use crate::novobus::device::Device;
use crate::novobus::drive::Drive;
use crate::novobus::reference::{self, Bytes, Cell};
use cells::{Image, image};
use harness_proto::line::{LineError, Received};
use harness_proto::nd21::bits::flags2;
use harness_proto::nd21::ram;
use harness_proto::novobus::bus_end::{Deadline, Reaction};
use harness_proto::novobus::error::BusError;
use harness_proto::time::{Instant, Span};

/// Silence behind which a drive may, and behind which it must, detect a time-out (9.9).
const TIME_OUT: (Span, Span) = (Span::from_millis(10), Span::from_millis(20));

/// How long it waits from there before it sends zeros unasked (9.9).
const WAIT: Span = Span::from_millis(10);

/// The code of a time-out (14.11.14).
const TIME_OUT_CODE: u16 = 0x0508;

/// A difference from the manual.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Complaint {
    /// How many bytes the drive had heard.
    pub heard: u64,
    /// When.
    pub at: Instant,
    /// The section with the rule.
    pub section: &'static str,
    /// The rule in a few words.
    pub rule: &'static str,
    /// What was seen.
    pub about: String,
}

/// A drive with a witness.
#[derive(Clone, Debug)]
pub struct Witness {
    drive: Drive,
    bus: reference::Drive,
    /// What the cells held when the drive had last been asked something.
    last: Image,
    heard: u64,
    /// When the last byte came, since power-up and reset.
    last_byte: Option<Instant>,
    /// When a time-out was detected.
    time_out: Option<Instant>,
    /// When it last sent something.
    last_sent: Instant,
    /// The order that the EEPROM controller was given.
    job: Option<eeprom::Job>,
    byte_time: Span,
    complaint: Option<Complaint>,
}

impl Witness {
    /// Creates a witness for a drive that has not received a byte yet, on a line with this byte time. A plain drive needs none: the
    /// reference model replaces it.
    #[must_use]
    pub fn new(mut drive: Drive, byte_time: Span) -> Self {
        drive.watch_invariants();
        let mut witness = Self {
            last: image(&drive),
            bus: reference::Drive::new(),
            drive,
            heard: 0,
            last_byte: None,
            time_out: None,
            last_sent: Instant::START,
            job: None,
            byte_time,
            complaint: None,
        };
        witness.teach();
        witness
    }

    /// The drive.
    #[must_use]
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The drive.
    pub fn drive_mut(&mut self) -> &mut Drive {
        &mut self.drive
    }

    /// The first difference.
    #[must_use]
    pub fn complaint(&self) -> Option<&Complaint> {
        self.complaint.as_ref()
    }

    /// The conversation has ended: everything that was due up to now must have happened.
    pub fn end(&mut self, now: Instant) {
        self.before(now);
    }

    fn complain(&mut self, now: Instant, rule: (&'static str, &'static str), about: String) {
        let (section, rule) = rule;
        self.complaint.get_or_insert(Complaint {
            heard: self.heard,
            at: now,
            section,
            rule,
            about,
        });
    }

    /// The reference knows what the drive's cells hold.
    fn teach(&mut self) {
        let now = image(&self.drive);
        for (address, (byte, known)) in (0xFD80..=0xFFFF).zip(now.iter().zip(self.known())) {
            if *byte != known {
                self.bus.poke(address, *byte);
            }
        }
        self.last = now;
    }

    fn known(&self) -> Image {
        *self.bus.ram_and_registers()
    }

    /// Before a byte or a deadline: what the drive has done by itself since the last one.
    fn before(&mut self, now: Instant) {
        if let Some(sentence) = self.drive.broken_invariant() {
            self.complain(now, ("11.8", "invariant"), sentence.to_owned());
        }
        if let Some((address, was, is)) = cells::changed_by_itself(&self.last, &image(&self.drive))
        {
            let about = format!("cell {address:04X} went from {was:02X} to {is:02X} by itself");
            self.complain(now, ("14.2.1", "contents of a cell"), about);
        }
        let job = self
            .job
            .map(|job| eeprom::done(job, &image(&self.drive), self.drive.cells()));
        if let Some(Some(done)) = job {
            self.job = None;
            if let Err(about) = done {
                self.complain(now, ("14.10.5", "EEPROM controller"), about);
            }
        }
        let silent = self.last_byte.map(|at| now.since(at));
        let monitored = self.monitored();
        if monitored && self.time_out.is_none() && silent.is_some_and(|time| time > TIME_OUT.1) {
            let about = "20 ms of silence, and no time-out was detected".to_owned();
            self.complain(now, ("9.9", "time-out"), about);
        }
        // With something to answer no zero goes out unasked.
        if let Some(at) = self.time_out
            && now > self.last_sent.max(at + WAIT) + self.byte_time * 2
        {
            let about = "a time-out and 10 ms more, and no zeros are sent".to_owned();
            self.complain(now, ("9.9", "zeros"), about);
        }
        self.teach();
    }

    fn monitored(&self) -> bool {
        self.drive.cells().peek(ram::FLAGS2) & flags2::MONITORING != 0
    }

    /// What a byte has done to the cells, and to the error mode.
    fn after(&mut self, now: Instant, was_in_error: bool, executed: &[Bytes], code: Option<u16>) {
        let found = cells::executed(executed, &self.last, &self.known(), &self.drive, code);
        if let Some((section, about)) = found {
            self.complain(now, (section, "contents of a cell"), about);
        }
        self.job = eeprom::order(self.job, executed, &self.last);
        if self.drive.in_error() != self.bus.in_error() {
            let about = match self.bus.in_error() {
                true if was_in_error => "it has left the error mode",
                true => "it is not in the error mode",
                false if was_in_error => "it has not left the error mode",
                false => "it is in the error mode",
            };
            self.complain(now, ("9.7", "error mode"), about.to_owned());
        }
        self.teach();
    }
}

/// The code for a bad byte; that of the reference for all others (14.11.14).
fn code_of(error: Option<LineError>, reference: u16) -> u16 {
    match error {
        None => reference,
        Some(LineError::Parity) => 0x0502,
        Some(LineError::Framing | LineError::Break) => 0x0503,
        Some(LineError::Overrun) => 0x0501,
    }
}

fn shown(byte: Option<u8>) -> String {
    byte.map_or_else(|| "nothing".to_owned(), |byte| format!("{byte:02X}"))
}

impl Device for Witness {
    fn receive(&mut self, now: Instant, received: Received) -> Reaction {
        self.before(now);
        self.heard += 1;
        self.last_byte = Some(now);
        let was_in_error = self.bus.in_error();
        let expected = self.bus.receive(Cell {
            byte: received.byte,
            error: received.error.is_some(),
        });
        let executed = self.bus.take_executed();
        let detects = !was_in_error && self.bus.in_error();
        let code = detects.then(|| {
            let code = [
                self.bus.peek(ram::ERRORCODE),
                self.bus.peek(ram::ERRORCODE + 1),
            ];
            code_of(received.error, u16::from_be_bytes(code))
        });
        let step = self.drive.receive(now, received);
        self.last_sent = now;
        if step.byte != expected {
            let rule = match was_in_error || detects {
                true => ("9.7", "error mode"),
                false => ("9.1", "answer"),
            };
            let (said, expected) = (shown(step.byte), shown(expected));
            let about = format!(
                "for {} it sent {said}, the reference model says {expected}",
                shown(Some(received.byte))
            );
            self.complain(now, rule, about);
        }
        self.after(now, was_in_error, &executed, code);
        if cells::is_reset(&executed) {
            self.last_byte = None;
            self.job = None;
        }
        if !self.bus.in_error() {
            self.time_out = None;
        }
        step
    }

    fn deadline(&self) -> Option<Deadline> {
        self.drive.deadline()
    }

    fn handle_deadline(&mut self, now: Instant) -> Reaction {
        // Whether a time-out is due is asked of the clock, not of the drive.
        let silent = self.last_byte.map(|at| now.since(at));
        let due = self.monitored()
            && self.time_out.is_none()
            && silent.is_some_and(|time| (TIME_OUT.0..=TIME_OUT.1).contains(&time));
        self.before(now);
        let was_in_error = self.bus.in_error();
        let step = self.drive.handle_deadline(now);
        if let Some(byte) = step.byte {
            let may = self.time_out.is_some_and(|at| now >= at + WAIT);
            if byte != 0 || !may {
                let about = format!("it sent {byte:02X} unasked");
                self.complain(now, ("9.9", "zeros"), about);
            }
            self.last_sent = now;
            return step;
        }
        let mut code = None;
        if due {
            self.bus.time_out();
            self.time_out = Some(now);
            code = (!was_in_error).then_some(TIME_OUT_CODE);
        }
        self.after(now, was_in_error, &[], code);
        step
    }

    fn advance(&mut self, now: Instant) {
        self.drive.advance(now);
    }

    fn power_on(&mut self, now: Instant) {
        self.drive.power_on(now);
        self.bus = reference::Drive::new();
        if let Some(about) = cells::at_start(&self.drive) {
            self.complain(now, ("14.2", "cells after power-up"), about);
        }
        self.last_byte = None;
        self.time_out = None;
        self.job = None;
        self.teach();
    }

    fn in_error(&self) -> bool {
        self.drive.in_error()
    }

    fn cause(&self) -> Option<BusError> {
        self.drive.cause()
    }

    fn head_start(&self) -> Span {
        self.drive.head_start()
    }
}
