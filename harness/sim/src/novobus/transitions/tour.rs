//! A tour through every reachable cell: for each state the shortest known way to it, and for each event the stimulus that
//! causes it there. The inputs of the target `bus_end` in `corpora/fuzz` are this tour, one file for each state.

use super::{Event, State, Transition};
use crate::fuzz::slug;
use harness_proto::line::{LineError, Received};
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE};

/// What happens to a bus end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TourStep {
    /// A byte arrives.
    Byte(Received),
    /// Nothing arrives until something is due.
    Silence,
}

impl TourStep {
    const fn good(byte: u8) -> Self {
        Self::Byte(Received::good(byte))
    }

    /// Its bytes in an input of the target `bus_end`: a byte is itself, FF is FF FF; FF 00 x is x with wrong parity,
    /// FF 01 x a framing error, FF 02 a break, FF 03 x an overrun, FF 04 silence.
    pub fn encode(self, out: &mut Vec<u8>) {
        match self {
            Self::Silence => out.extend([0xFF, 4]),
            Self::Byte(Received { byte, error }) => match error {
                None if byte == 0xFF => out.extend([0xFF, 0xFF]),
                None => out.push(byte),
                Some(LineError::Parity) => out.extend([0xFF, 0, byte]),
                Some(LineError::Framing) => out.extend([0xFF, 1, byte]),
                Some(LineError::Break) => out.extend([0xFF, 2]),
                Some(LineError::Overrun) => out.extend([0xFF, 3, byte]),
            },
        }
    }

    /// Takes the first from an input; `None` at its end, or where it ends within one. FF and any other byte is silence.
    pub fn decode(input: &mut &[u8]) -> Option<Self> {
        let (stimulus, used) = match **input {
            [] | [0xFF] | [0xFF, 0 | 1 | 3] => return None,
            [0xFF, 0xFF, ..] => (Self::good(0xFF), 2),
            [0xFF, 0, byte, ..] => (Self::Byte(Received::bad(byte, LineError::Parity)), 3),
            [0xFF, 1, byte, ..] => (Self::Byte(Received::bad(byte, LineError::Framing)), 3),
            [0xFF, 2, ..] => (Self::Byte(Received::bad(0, LineError::Break)), 2),
            [0xFF, 3, byte, ..] => (Self::Byte(Received::bad(byte, LineError::Overrun)), 3),
            [0xFF, _, ..] => (Self::Silence, 2),
            [byte, ..] => (Self::good(byte), 1),
        };
        *input = &input[used..];
        Some(stimulus)
    }
}

/// The way to a state for a drive that waits for a sync byte and has seen no address byte, with time-outs monitored.
#[must_use]
pub fn way(state: State) -> Vec<TourStep> {
    let bytes = |bytes: &[u8]| bytes.iter().copied().map(TourStep::good).collect();
    if let Some(way) = telegram(state) {
        return bytes(way);
    }
    // The error mode: silence in front, bytes that are no sync byte, zeros, bytes of the check sequence.
    let (silences, others, zeros, sequence) = match state {
        State::ErrorSeven => (0, 1, 7, 0),
        State::ErrorLong => (0, 17, 0, 0),
        State::ErrorLongSeven => (0, 17, 7, 0),
        State::Upstream => (0, 0, 8, 0),
        State::UpstreamSixteen => (0, 0, 16, 0),
        State::Increments => (0, 0, 17, 0),
        State::Sequence1 => (0, 0, 8, 1),
        State::Sequence2 => (0, 0, 8, 2),
        State::Sequence3 => (0, 0, 8, 3),
        State::Sequence4 => (0, 0, 8, 4),
        State::IncrementsSequence1 => (0, 0, 17, 1),
        State::IncrementsSequence2 => (0, 0, 17, 2),
        State::IncrementsSequence3 => (0, 0, 17, 3),
        State::IncrementsSequence4 => (0, 0, 17, 4),
        State::Waiting => (1, 0, 0, 0),
        State::WaitingSeven => (1, 0, 7, 0),
        State::WaitingIncrements => (1, 0, 8, 0),
        State::WaitingSequence1 => (1, 0, 8, 1),
        State::WaitingSequence2 => (1, 0, 8, 2),
        State::WaitingSequence3 => (1, 0, 8, 3),
        State::WaitingSequence4 => (1, 0, 8, 4),
        State::Sending => (2, 0, 0, 0),
        State::SendingSeven => (2, 0, 7, 0),
        State::SendingIncrements => (2, 0, 8, 0),
        State::SendingSequence1 => (2, 0, 8, 1),
        State::SendingSequence2 => (2, 0, 8, 2),
        State::SendingSequence3 => (2, 0, 8, 3),
        State::SendingSequence4 => (2, 0, 8, 4),
        _ => (0, 1, 0, 0),
    };
    // The first byte received arms the monitoring (9.9).
    let arms = if silences > 0 { &[0x80][..] } else { &[] };
    let mut way: Vec<TourStep> = bytes(arms);
    way.extend(std::iter::repeat_n(TourStep::Silence, silences));
    way.extend(std::iter::repeat_n(TourStep::good(1), others));
    way.extend(std::iter::repeat_n(TourStep::good(0), zeros));
    way.extend(SEQUENCE[..sequence].iter().copied().map(TourStep::good));
    way
}

/// The way to a state of normal mode: FF is the drive's own address byte, FB another drive's.
const fn telegram(state: State) -> Option<&'static [u8]> {
    Some(match state {
        State::SyncNoAddress => &[0x80],
        State::SyncOther => &[0x82, 0xFB, 0x55],
        State::SyncOtherBegun => &[0x82, 0xFF, 0xC0, 0x82, 0xFB, 0x55],
        State::SyncOwn => &[0x85, 0xFF, 0x12, 0x34],
        State::SyncOwnBegun => &[0x82, 0xFF, 0xC0],
        State::Address => &[0x82],
        State::AddressProcess => &[0x85],
        State::Passing => &[0x88, 0xFB],
        State::PassingLast => &[0x82, 0xFB],
        State::ProcessHigh => &[0x85, 0xFF],
        State::ProcessLow => &[0x85, 0xFF, 0x12],
        State::Command => &[0x88, 0xFF],
        State::AddrL => &[0x88, 0xFF, 0xC0],
        State::AddrH => &[0x88, 0xFF, 0xC0, 0x13],
        State::AddrInPage => &[0x88, 0xFF, 0xA5, 0x01],
        State::Data => &[0x88, 0xFF, 0x82],
        State::Code => &[0x88, 0xFF, 0xC8],
        State::Fixed => &[0x8A, 0xFF, 0xC1, 0x13, 0xFE],
        State::Check => &[0x88, 0xFF, 0xC0, 0x13, 0xFE],
        State::CheckReset => &[0x88, 0xFF, 0xDD, 0x21],
        _ => return None,
    })
}

/// The stimulus that causes the event of a cell in its state; `None` for an unreachable cell.
#[must_use]
pub fn stimulus(cell: Transition) -> Option<TourStep> {
    super::why_unreachable(cell).is_none().then(|| {
        let bad = |error| TourStep::Byte(Received::bad(0x55, error));
        match cell.event {
            Event::Parity => bad(LineError::Parity),
            Event::Framing => bad(LineError::Framing),
            Event::Break => TourStep::Byte(Received::bad(0, LineError::Break)),
            Event::Overrun => bad(LineError::Overrun),
            Event::Silence => TourStep::Silence,
            _ => TourStep::good(byte(cell)),
        }
    })
}

const fn byte(cell: Transition) -> u8 {
    match cell.event {
        Event::Synco => 0x80,
        Event::Pause => 0x81,
        Event::AddressFollows => 0x82,
        Event::SameDrive => 0xA2,
        Event::NextDrive => 0xE2,
        Event::EmptyShort => 0xA0,
        Event::NoSyncByte | Event::UnknownCommand => 0x01,
        Event::OwnAddress | Event::SequenceStart => 0xFF,
        Event::OtherAddress => 0xFB,
        Event::ReadByte => 0xC0,
        Event::ReadWord => 0xC1,
        Event::ReadLong => 0xC7,
        Event::WriteByte => 0x82,
        Event::WriteWord => 0x63,
        Event::And => 0xA4,
        Event::Or => 0xA5,
        Event::WriteIo => 0xC8,
        Event::ResetH8 => 0xDD,
        Event::Accepted => match cell.state {
            State::AddrH => 0xFE,
            State::Code => 0x01,
            State::Fixed => b'?',
            _ => 0x13,
        },
        Event::Refused => match cell.state {
            State::AddrInPage => 0x80,
            _ => 0x12,
        },
        Event::RightCheck => match cell.state {
            State::CheckReset => 0xFE,
            _ => 0xD1,
        },
        Event::WrongCheck => 0x12,
        Event::SequenceNext => match cell.state {
            State::Sequence1
            | State::IncrementsSequence1
            | State::WaitingSequence1
            | State::SendingSequence1 => SEQUENCE[1],
            State::Sequence2
            | State::IncrementsSequence2
            | State::WaitingSequence2
            | State::SendingSequence2 => SEQUENCE[2],
            State::Sequence3
            | State::IncrementsSequence3
            | State::WaitingSequence3
            | State::SendingSequence3 => SEQUENCE[3],
            _ => SEQUENCE[4],
        },
        Event::Zero => 0,
        _ => 0x55,
    }
}

/// The file of a state: its name without ending, and its text. Each line is the way to the state, one event, and the check
/// sequence (9.8), after which the drive is where it began.
#[must_use]
pub fn file(state: State) -> (String, String) {
    let mut text = format!(
        "# ND21 {}: {}; the way there, one event, 17 zeros and the check sequence\n01 # time-outs are monitored\n",
        state.section(),
        state.name()
    );
    for event in Event::ALL.iter().copied() {
        let Some(last) = stimulus(Transition { state, event }) else {
            continue;
        };
        let hex = |stimuli: Vec<TourStep>| {
            let mut bytes = Vec::new();
            stimuli.iter().for_each(|one| one.encode(&mut bytes));
            let digits: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
            digits.join(" ")
        };
        let back = CHECK_SEQUENCE.map(TourStep::good).to_vec();
        let parts = [hex(way(state)), hex(vec![last]), hex(back)];
        text.push_str(&format!("{} # {}\n", parts.join("  "), event.name()));
    }
    (format!("{}-{}", state.section(), slug(state.name())), text)
}
