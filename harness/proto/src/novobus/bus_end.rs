//! A drive's end of the bus (ND21 9.1-9.9): a byte with its line status in, at most one byte out, and
//! deadlines for the time-out.
//!
//! Call [`BusEnd::receive`] with every byte that arrives. After each call ask
//! [`BusEnd::deadline`], and call [`BusEnd::handle_deadline`] when it has come. The
//! line carries one byte at a time; the caller keeps the outgoing bytes in order.

mod relay;
mod view;

use super::address::{ADDRESSED, passed_on};
use super::command::PAGE;
use super::error::BusError;
use super::error_mode::{ErrorMode, Marks, Rules};
use super::memory::Memory;
use super::parameter_channel::ParameterChannel;
use super::properties::{EmptyShortTelegram, Properties, ShortAddress, TimeOutAnswer};
use super::sync::{Addressing, SyncByte, TelegramHeader};
use crate::line::Received;
use crate::nd21;
use crate::time::Instant;

pub use super::parameter_channel::ParameterByte;
pub use relay::{Passing, Relay};
pub use view::{Remaining, Silent};

/// What a drive does about a byte or a deadline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reaction {
    /// The byte that goes out, if one does.
    pub byte: Option<u8>,
    /// What there is to remark.
    pub marks: Marks,
}

impl Reaction {
    /// Nothing goes out.
    pub const SILENCE: Self = Self {
        byte: None,
        marks: Marks::NONE,
    };

    const fn plain(byte: u8) -> Self {
        Self {
            byte: Some(byte),
            marks: Marks::NONE,
        }
    }
}

/// When a bus end must be called without a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deadline {
    /// At this time. A byte that comes first may move it: ask again after each.
    At(Instant),
    /// From this time on, as soon as the line is free and everything received has been answered.
    LineFree(Instant),
}

/// A drive's end of the bus.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct BusEnd {
    state: BusEndState,
    /// When the last byte was received; `None` until the first one arms the monitoring (9.9).
    last_received: Option<Instant>,
    /// Whether an address byte has passed since power-up and since the last check sequence.
    short_address_valid: bool,
    channel: ParameterChannel,
    cause: Option<BusError>,
    properties: Properties,
    rules: Rules,
}

/// What the next byte is.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum BusEndState {
    /// A sync byte.
    Sync,
    /// The address byte of a telegram.
    Address(TelegramHeader),
    /// A net byte of a telegram for another drive; `left` bytes are still to come.
    Passing { left: u8 },
    /// A net byte of a telegram for this drive.
    Addressed { left: u8, next: Net },
    /// Any byte: the drive is in the error mode.
    Error(ErrorMode, LineSilence),
}

/// How long the line has been silent, for a drive in the error mode (9.9).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum LineSilence {
    /// Not too long.
    None,
    /// Too long: a time-out. The drive waits until then before it sends unasked.
    Waiting { until: Instant },
    /// The wait is over: zeros go out unasked.
    Sending { since: Instant },
}

/// Which net byte of a telegram for this drive comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Net {
    /// The high byte of the process data.
    ProcessHigh,
    /// Their low byte: the high byte received, the low byte to send.
    ProcessLow { received: u8, to_send: u8 },
    /// A byte of the parameter channel.
    Parameter,
}

/// The meaning of the next byte to a drive, for observers of a bus end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A sync byte (ND21 9.2).
    Sync,
    /// The address byte of a telegram (9.3).
    Address,
    /// A net byte of a telegram for another drive (9.3).
    Passing,
    /// The high byte of the process data for this drive (9.4).
    ProcessHigh,
    /// Their low byte.
    ProcessLow,
    /// The first byte of a command for this drive (9.5).
    Command,
    /// Another byte of it.
    Parameter(ParameterByte),
    /// Any byte: the drive is in the error mode (9.7).
    ErrorMode,
}

impl BusEnd {
    /// A bus end as it is after power-up: waiting for a sync byte.
    #[must_use]
    #[inline]
    pub fn new(properties: Properties) -> Self {
        Self {
            state: BusEndState::Sync,
            last_received: None,
            short_address_valid: false,
            channel: ParameterChannel::default(),
            cause: None,
            properties,
            rules: Rules::MANUAL,
        }
    }

    /// Whether it will answer every later byte as `other` will, apart from the times of 9.9: both wait for the same
    /// byte, with the same incomplete command.
    #[must_use]
    pub fn waits_as(&self, other: &Self) -> bool {
        self.state == other.state
            && self.short_address_valid == other.short_address_valid
            && self.channel == other.channel
            && self.properties == other.properties
            && self.rules == other.rules
    }

    /// What it does where the manual leaves that open.
    #[must_use]
    pub const fn properties(&self) -> &Properties {
        &self.properties
    }

    /// The same with other properties and rules, now and after every reset; for wrong drives.
    pub fn amend(&mut self, amend: impl FnOnce(&mut Properties, &mut Rules)) {
        amend(&mut self.properties, &mut self.rules);
    }

    fn reset(&self) -> Self {
        Self {
            rules: self.rules,
            ..Self::new(self.properties)
        }
    }

    /// What the next byte is.
    #[must_use]
    #[inline]
    pub fn place(&self) -> Place {
        match &self.state {
            BusEndState::Sync => Place::Sync,
            BusEndState::Address(_) => Place::Address,
            BusEndState::Passing { .. } => Place::Passing,
            BusEndState::Error(..) => Place::ErrorMode,
            BusEndState::Addressed { next, .. } => match next {
                Net::ProcessHigh => Place::ProcessHigh,
                Net::ProcessLow { .. } => Place::ProcessLow,
                Net::Parameter => self.channel.next().map_or(Place::Command, Place::Parameter),
            },
        }
    }

    /// Leaves the error mode as if a check sequence had come (ND21 9.8); for wrong drives.
    pub fn recover(&mut self) {
        self.leave_error_mode();
    }

    /// Forgets a command that has been received in part; for wrong drives.
    pub fn forget_command(&mut self) {
        self.channel = ParameterChannel::default();
    }

    /// Takes over the command that `other` has received in part; for wrong drives.
    pub fn keep_command_of(&mut self, other: &Self) {
        self.channel = other.channel.clone();
    }

    /// Whether the drive is in the error mode.
    #[must_use]
    #[inline]
    pub const fn in_error(&self) -> bool {
        matches!(self.state, BusEndState::Error(..))
    }

    /// Whether it answers the next byte with received + 1 (ND21 9.7).
    #[must_use]
    pub const fn increments(&self) -> bool {
        match &self.state {
            BusEndState::Error(error, ..) => error.increments(),
            _ => false,
        }
    }

    /// The error for which it last went into the error mode, since power-up or reset.
    #[must_use]
    pub const fn cause(&self) -> Option<BusError> {
        self.cause
    }

    /// Takes a received byte.
    #[inline]
    pub fn receive<M: Memory>(
        &mut self,
        now: Instant,
        received: Received,
        memory: &mut M,
    ) -> Reaction {
        self.last_received = Some(now);
        match &mut self.state {
            // Nearly every byte of a large ring: not for this drive, and not looked at (9.3).
            BusEndState::Passing { left } if received.error.is_none() => {
                *left -= 1;
                if *left == 0 {
                    self.state = BusEndState::Sync;
                }
                Reaction::plain(received.byte)
            }
            _ => self.consider(received, memory),
        }
    }

    /// Takes a byte that this drive looks at.
    #[inline]
    fn consider<M: Memory>(&mut self, received: Received, memory: &mut M) -> Reaction {
        if let BusEndState::Error(mode, silence) = &mut self.state {
            let waiting = matches!(silence, LineSilence::Waiting { .. });
            let step = if waiting && self.properties.time_out_answer == TimeOutAnswer::Silent {
                Reaction {
                    byte: None,
                    marks: mode.overhear(received),
                }
            } else {
                let response = mode.receive(received, self.properties.broken_sequence);
                Reaction {
                    byte: Some(response.byte),
                    marks: response.marks,
                }
            };
            if step.marks.contains(Marks::RECOVERED) {
                self.leave_error_mode();
            }
            return step;
        }
        let result = match received.error {
            Some(error) => Err(error.into()),
            None => self.normal(received.byte, memory),
        };
        result.unwrap_or_else(|error| self.detect(error, received, memory))
    }

    /// When this bus end next wants [`Self::handle_deadline`] to be called.
    #[must_use]
    pub fn deadline<M: Memory>(&self, memory: &M) -> Option<Deadline> {
        self.due(|| memory.monitors_time_out())
    }

    /// Like [`Self::deadline`], where `monitored` says whether time-outs are monitored.
    #[inline]
    #[must_use]
    pub fn due(&self, monitored: impl FnOnce() -> bool) -> Option<Deadline> {
        match self.state {
            BusEndState::Error(_, LineSilence::Waiting { until }) => Some(Deadline::At(until)),
            BusEndState::Error(_, LineSilence::Sending { since }) => {
                Some(Deadline::LineFree(since))
            }
            _ if monitored() => Some(Deadline::At(self.last_received? + self.properties.time_out)),
            _ => None,
        }
    }

    /// Handles [`Self::deadline`] (ND21 9.9): first the time-out is detected; then, after
    /// a further wait, zeros go out, one whenever the line is free. A drive that is already in the error mode
    /// also monitors the time, because a breaking cable often causes a damaged byte first.
    pub fn handle_deadline<M: Memory>(&mut self, now: Instant, memory: &mut M) -> Reaction {
        let waiting = LineSilence::Waiting {
            until: now + self.properties.time_out_wait,
        };
        match &mut self.state {
            BusEndState::Error(mode, silence @ LineSilence::None) => {
                mode.time_out();
                *silence = waiting;
                Reaction::default()
            }
            BusEndState::Error(_, silence @ LineSilence::Waiting { .. }) => {
                *silence = LineSilence::Sending { since: now };
                Reaction::default()
            }
            BusEndState::Error(mode, LineSilence::Sending { .. }) => Reaction {
                byte: Some(0),
                marks: mode.send_zero(),
            },
            _ => {
                self.blame(BusError::TimeOut, memory);
                self.state =
                    BusEndState::Error(ErrorMode::enter_after_time_out(self.rules), waiting);
                Reaction {
                    byte: None,
                    marks: Marks::DETECTED,
                }
            }
        }
    }

    /// A byte in normal mode, without a line error.
    #[inline(never)]
    fn normal<M: Memory>(&mut self, byte: u8, memory: &mut M) -> Result<Reaction, BusError> {
        match &mut self.state {
            BusEndState::Sync => self.sync_byte(byte, memory),
            BusEndState::Address(header) => {
                let header = *header;
                let sum = passed_on(byte);
                memory.write(nd21::ram::BUS_ADDR, sum);
                self.short_address_valid = true;
                self.begin_net_bytes(header, sum == ADDRESSED);
                Ok(Reaction::plain(sum))
            }
            BusEndState::Addressed { left, next } => {
                let step = match *next {
                    Net::ProcessHigh => {
                        let [high, low] = process_data_out(memory);
                        *next = Net::ProcessLow {
                            received: byte,
                            to_send: low,
                        };
                        Reaction::plain(high)
                    }
                    Net::ProcessLow { received, to_send } => {
                        process_data_in(memory, [received, byte]);
                        *next = Net::Parameter;
                        Reaction::plain(to_send)
                    }
                    Net::Parameter => {
                        let answer =
                            self.channel
                                .receive(byte, self.properties.read_long, memory)?;
                        if answer.reset {
                            *self = self.reset();
                            return Ok(Reaction {
                                byte: Some(answer.byte),
                                marks: answer.marks,
                            });
                        }
                        Reaction {
                            byte: Some(answer.byte),
                            marks: answer.marks,
                        }
                    }
                };
                *left -= 1;
                if *left == 0 {
                    self.state = BusEndState::Sync;
                }
                Ok(step)
            }
            BusEndState::Passing { .. } | BusEndState::Error(..) => Ok(Reaction::plain(byte)),
        }
    }

    /// ND21 9.2.
    fn sync_byte<M: Memory>(&mut self, byte: u8, memory: &mut M) -> Result<Reaction, BusError> {
        let header = match SyncByte::decode(byte).map_err(|_| BusError::Sync)? {
            SyncByte::Synco => return Ok(Reaction::plain(byte)),
            SyncByte::Pause => return Ok(Reaction::default()),
            SyncByte::Telegram(header) => header,
        };
        if header.net_length() == 0
            && self.properties.empty_short_telegram == EmptyShortTelegram::Error
        {
            return Err(BusError::Sync);
        }
        if header.addressing() == Addressing::AddressFollows {
            self.state = BusEndState::Address(header);
            return Ok(Reaction::plain(byte));
        }
        let valid =
            self.short_address_valid || self.properties.short_address == ShortAddress::KeptSum;
        let mut sum = memory.read(nd21::ram::BUS_ADDR);
        if header.addressing() == Addressing::NextDrive {
            sum = passed_on(sum);
            memory.write(nd21::ram::BUS_ADDR, sum);
        }
        self.begin_net_bytes(header, valid && sum == ADDRESSED);
        Ok(Reaction::plain(byte))
    }

    fn begin_net_bytes(&mut self, header: TelegramHeader, addressed: bool) {
        let left = header.net_length();
        self.state = match (left, addressed) {
            (0, _) => BusEndState::Sync,
            (_, false) => BusEndState::Passing { left },
            (_, true) => BusEndState::Addressed {
                left,
                next: if header.process_data() {
                    Net::ProcessHigh
                } else {
                    Net::Parameter
                },
            },
        };
    }

    #[inline]
    fn detect<M: Memory>(
        &mut self,
        error: BusError,
        offending: Received,
        memory: &mut M,
    ) -> Reaction {
        self.blame(error, memory);
        self.state = BusEndState::Error(ErrorMode::enter(offending, self.rules), LineSilence::None);
        Reaction {
            byte: Some(0),
            marks: Marks::DETECTED,
        }
    }

    #[inline]
    fn blame<M: Memory>(&mut self, error: BusError, memory: &mut M) {
        self.cause = Some(error);
        memory.bus_error(error);
    }

    /// After the 41 of a check sequence: normal mode, half-received commands forgotten, no short
    /// address valid.
    #[inline]
    fn leave_error_mode(&mut self) {
        self.state = BusEndState::Sync;
        self.channel = ParameterChannel::default();
        self.short_address_valid = false;
    }
}

/// Latches the process data that go out: the word at FF00|DataOut, high byte first (ND21 9.4, 14.10.3).
fn process_data_out<M: Memory>(memory: &mut M) -> [u8; 2] {
    let address = PAGE | u16::from(memory.read(nd21::ram::DATA_OUT));
    [memory.read(address), memory.read(address.wrapping_add(1))]
}

/// Writes the process data that came in to FF00|DataIn, high byte first (ND21 9.4, 14.10.3).
fn process_data_in<M: Memory>(memory: &mut M, data: [u8; 2]) {
    let address = PAGE | u16::from(memory.read(nd21::ram::DATA_IN));
    memory.write(address, data[0]);
    memory.write(address.wrapping_add(1), data[1]);
}
