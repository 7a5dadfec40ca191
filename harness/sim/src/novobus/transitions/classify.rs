//! From a bus end and what happens to it to a cell of the matrix. Nothing is changed.

use super::{Event, State, Transition};
use crate::novobus::cells::Cells;
use harness_proto::line::{LineError, Received};
use harness_proto::nd21;
use harness_proto::novobus::address::{ADDRESSED, passed_on};
use harness_proto::novobus::bus_end::{BusEnd, ParameterByte, Place, Silent};
use harness_proto::novobus::check_sequence::{SEQUENCE, ZEROS};
use harness_proto::novobus::command::{Field, Kind, PAGE, layout};
use harness_proto::novobus::error_mode::{ErrorMode, UPSTREAM_ZEROS};
use harness_proto::novobus::memory::Memory as _;
use harness_proto::novobus::output::OutputChange;
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{Addressing, SyncByte};

/// The cell that a byte is for a bus end on this memory, before it is received.
#[must_use]
#[inline(always)]
pub fn classify(bus_end: &BusEnd, memory: &Cells, received: Received) -> Transition {
    // Nearly every byte that a fuzzer sends comes to a drive in the error mode.
    if let Some((mode, silent)) = bus_end.error_mode() {
        return Transition {
            state: error_mode(mode, silent),
            event: match received.error {
                Some(error) => line_error(error),
                None => good_in_error_mode(mode, received.byte),
            },
        };
    }
    in_normal_mode(bus_end, memory, received)
}

#[inline(never)]
fn in_normal_mode(bus_end: &BusEnd, memory: &Cells, received: Received) -> Transition {
    let (state, good) = state_and_good(bus_end, memory, received.byte);
    let event = match received.error {
        Some(error) => line_error(error),
        None if received.byte == 0 => Event::Zero,
        None => good,
    };
    Transition { state, event }
}

// Apart, so that a good byte costs one comparison.
#[cold]
fn line_error(error: LineError) -> Event {
    match error {
        LineError::Parity => Event::Parity,
        LineError::Framing => Event::Framing,
        LineError::Break => Event::Break,
        LineError::Overrun => Event::Overrun,
    }
}

/// The state of a bus end on this memory.
#[must_use]
pub fn state(bus_end: &BusEnd, memory: &Cells) -> State {
    // It is the same whatever byte comes.
    state_and_good(bus_end, memory, 0).0
}

/// The state of a bus end on this memory, and what this byte is there if it is good and no 00. Both at once: the processor cannot foretell
/// where the bytes of a fuzzer lead, and so each question after the place costs much.
#[inline(always)]
fn state_and_good(bus_end: &BusEnd, memory: &Cells, byte: u8) -> (State, Event) {
    match bus_end.place() {
        Place::Sync => (between_telegrams(bus_end, memory), sync_byte(byte)),
        Place::Address => {
            let process_data = bus_end.remaining().is_some_and(|left| left.process_data);
            let state = if process_data {
                State::AddressProcess
            } else {
                State::Address
            };
            let addressed = passed_on(byte) == ADDRESSED;
            let event = if addressed {
                Event::OwnAddress
            } else {
                Event::OtherAddress
            };
            (state, event)
        }
        Place::Passing if bus_end.remaining().is_some_and(|left| left.net_bytes == 1) => {
            (State::PassingLast, Event::NetByte)
        }
        Place::Passing => (State::Passing, Event::NetByte),
        Place::ProcessHigh => (State::ProcessHigh, Event::ProcessData),
        Place::ProcessLow => (State::ProcessLow, Event::ProcessData),
        Place::Command => (State::Command, command(byte)),
        Place::Parameter(parameter) => (
            parameter_state(&parameter),
            parameter_byte(&parameter, memory, byte),
        ),
        Place::ErrorMode => bus_end
            .error_mode()
            .map_or((State::ErrorZeros, Event::OtherByte), |(mode, silent)| {
                (error_mode(mode, silent), good_in_error_mode(mode, byte))
            }),
    }
}

fn parameter_state(parameter: &ParameterByte) -> State {
    match parameter.field {
        Field::AddrL => State::AddrL,
        Field::AddrH => State::AddrH,
        Field::AddrInPage => State::AddrInPage,
        Field::Data(_) => State::Data,
        Field::Code => State::Code,
        Field::Fixed(_) => State::Fixed,
        Field::Check if parameter.kind == Kind::ResetH8 => State::CheckReset,
        Field::Check => State::Check,
    }
}

#[inline]
fn between_telegrams(bus_end: &BusEnd, memory: &Cells) -> State {
    if !bus_end.short_address_valid() {
        return State::SyncNoAddress;
    }
    let addressed = memory.peek(nd21::ram::BUS_ADDR) == ADDRESSED;
    match (addressed, bus_end.command_begun()) {
        (false, false) => State::SyncOther,
        (false, true) => State::SyncOtherBegun,
        (true, false) => State::SyncOwn,
        (true, true) => State::SyncOwnBegun,
    }
}

/// The states with an incomplete check sequence: by the drive's other state, then by how many of its bytes have come (ND21 9.8).
pub(super) const SEQUENCES: [[State; 4]; 4] = [
    [
        State::Sequence1,
        State::Sequence2,
        State::Sequence3,
        State::Sequence4,
    ],
    [
        State::IncrementsSequence1,
        State::IncrementsSequence2,
        State::IncrementsSequence3,
        State::IncrementsSequence4,
    ],
    [
        State::WaitingSequence1,
        State::WaitingSequence2,
        State::WaitingSequence3,
        State::WaitingSequence4,
    ],
    [
        State::SendingSequence1,
        State::SendingSequence2,
        State::SendingSequence3,
        State::SendingSequence4,
    ],
];

#[inline]
fn error_mode(mode: &ErrorMode, silent: Silent) -> State {
    if silent == Silent::No && !mode.upstream() {
        return alone(mode);
    }
    let form = match silent {
        Silent::No => usize::from(mode.increments()),
        Silent::Waiting => 2,
        Silent::Sending => 3,
    };
    if let Some(place) = mode.sequence().checked_sub(1) {
        return SEQUENCES[form][usize::from(place)];
    }
    let seven = mode.zeros_received() == UPSTREAM_ZEROS - 1;
    let long = mode.zeros_sent() >= ZEROS;
    match (silent, mode.upstream()) {
        (Silent::No, false) => alone(mode),
        (Silent::No, true) if long => State::Increments,
        (Silent::No, true) if mode.zeros_sent() == ZEROS - 1 => State::UpstreamSixteen,
        (Silent::No, true) => State::Upstream,
        (Silent::Waiting, true) => State::WaitingIncrements,
        (Silent::Waiting, false) if seven => State::WaitingSeven,
        (Silent::Waiting, false) => State::Waiting,
        (Silent::Sending, true) => State::SendingIncrements,
        (Silent::Sending, false) if seven => State::SendingSeven,
        (Silent::Sending, false) => State::Sending,
    }
}

/// The error mode of a drive that knows of no other one in it.
#[inline]
fn alone(mode: &ErrorMode) -> State {
    let seven = mode.zeros_received() == UPSTREAM_ZEROS - 1;
    match (mode.zeros_sent() >= ZEROS, seven) {
        (false, false) => State::ErrorZeros,
        (false, true) => State::ErrorSeven,
        (true, false) => State::ErrorLong,
        (true, true) => State::ErrorLongSeven,
    }
}

/// What a good byte is in the error mode.
#[inline]
fn good_in_error_mode(mode: &ErrorMode, byte: u8) -> Event {
    // A table, since any byte is as likely as another: what is asked by branches costs most.
    static ALONE: [Event; 256] = {
        let mut events = [Event::OtherByte; 256];
        events[0] = Event::Zero;
        events[SEQUENCE[0] as usize] = Event::SequenceStart;
        events
    };
    let due = usize::from(mode.sequence());
    if due > 0 && byte == SEQUENCE[due] {
        return Event::SequenceNext;
    }
    ALONE[usize::from(byte)]
}

/// What a byte is between two telegrams (ND21 9.2).
fn sync_byte(byte: u8) -> Event {
    match SyncByte::decode(byte) {
        Err(_) => Event::NoSyncByte,
        Ok(SyncByte::Synco) => Event::Synco,
        Ok(SyncByte::Pause) => Event::Pause,
        Ok(SyncByte::Telegram(header)) => match header.addressing() {
            Addressing::AddressFollows => Event::AddressFollows,
            _ if header.net_length() == 0 => Event::EmptyShort,
            Addressing::SameDrive => Event::SameDrive,
            Addressing::NextDrive => Event::NextDrive,
        },
    }
}

fn command(byte: u8) -> Event {
    match layout(byte, ReadLongAnswer::default()).map(|layout| layout.kind) {
        None => Event::UnknownCommand,
        Some(Kind::ReadByte) => Event::ReadByte,
        Some(Kind::ReadWord) => Event::ReadWord,
        Some(Kind::ReadLong) => Event::ReadLong,
        Some(Kind::WriteByte) => Event::WriteByte,
        Some(Kind::WriteWord) => Event::WriteWord,
        Some(Kind::And) => Event::And,
        Some(Kind::Or) => Event::Or,
        Some(Kind::WriteIo) => Event::WriteIo,
        Some(Kind::ResetH8) => Event::ResetH8,
    }
}

fn parameter_byte(parameter: &ParameterByte, memory: &Cells, byte: u8) -> Event {
    let accepted = match parameter.field {
        Field::Check if byte == parameter.command_sum.plus() => return Event::RightCheck,
        Field::Check => return Event::WrongCheck,
        Field::AddrL | Field::Data(_) => true,
        Field::AddrH => {
            let address = parameter.address & 0x00FF | u16::from(byte) << 8;
            memory.permits(parameter.kind, address)
        }
        Field::AddrInPage => memory.permits(parameter.kind, PAGE | u16::from(byte)),
        Field::Code => OutputChange::from_code(byte).is_some(),
        Field::Fixed(expected) => byte == expected,
    };
    if accepted {
        Event::Accepted
    } else {
        Event::Refused
    }
}
