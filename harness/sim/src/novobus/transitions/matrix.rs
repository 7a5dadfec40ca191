//! Which cells of the matrix nothing can reach, each with its reason.

use super::classify::SEQUENCES;
use super::{CELLS, Event, State, Transition};

/// Why some events cannot happen in most states.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// The events.
    pub events: &'static [Event],
    /// The states in which they can happen all the same.
    pub only_in: &'static [State],
    /// Why not elsewhere.
    pub reason: &'static str,
    /// The section of the ND21 manual that says so.
    pub section: &'static str,
}

/// Every reason. What no rule speaks of can happen everywhere: a zero, a line error, silence.
pub static RULES: [Rule; 10] = [
    Rule {
        events: &[
            Event::Synco,
            Event::Pause,
            Event::AddressFollows,
            Event::SameDrive,
            Event::NextDrive,
            Event::EmptyShort,
            Event::NoSyncByte,
        ],
        only_in: &[
            State::SyncNoAddress,
            State::SyncOther,
            State::SyncOtherBegun,
            State::SyncOwn,
            State::SyncOwnBegun,
        ],
        reason: "a byte is read as a sync byte between telegrams only",
        section: "9.1",
    },
    Rule {
        events: &[Event::OwnAddress, Event::OtherAddress],
        only_in: &[State::Address, State::AddressProcess],
        reason: "a byte is an address byte only behind a sync byte that announces one",
        section: "9.2",
    },
    Rule {
        events: &[Event::NetByte],
        only_in: &[State::Passing, State::PassingLast],
        reason: "a net byte is passed on unread only while another drive is addressed",
        section: "9.3",
    },
    Rule {
        events: &[Event::ProcessData],
        only_in: &[State::ProcessHigh, State::ProcessLow],
        reason: "process data are the first two net bytes of a telegram with D = 1",
        section: "9.4",
    },
    Rule {
        events: &[
            Event::ReadByte,
            Event::ReadWord,
            Event::ReadLong,
            Event::WriteByte,
            Event::WriteWord,
            Event::And,
            Event::Or,
            Event::WriteIo,
            Event::ResetH8,
            Event::UnknownCommand,
        ],
        only_in: &[State::Command],
        reason: "a byte is a command byte only where no command is begun, for the drive that is addressed",
        section: "9.5",
    },
    Rule {
        events: &[Event::Accepted],
        only_in: &[
            State::AddrL,
            State::AddrH,
            State::AddrInPage,
            State::Data,
            State::Code,
            State::Fixed,
        ],
        reason: "no parameter of a command is due",
        section: "9.5",
    },
    Rule {
        events: &[Event::Refused],
        only_in: &[State::AddrH, State::AddrInPage, State::Code, State::Fixed],
        reason: "nothing is due that could be refused: any data byte and any low byte of an address will do",
        section: "10.1",
    },
    Rule {
        events: &[Event::RightCheck, Event::WrongCheck],
        only_in: &[State::Check, State::CheckReset],
        reason: "no checking byte is due",
        section: "9.6",
    },
    Rule {
        events: &[Event::SequenceStart, Event::OtherByte],
        only_in: ERROR_MODE,
        reason: "the check sequence is looked for in the error mode only",
        section: "9.8",
    },
    Rule {
        events: &[Event::SequenceNext],
        only_in: IN_SEQUENCE,
        reason: "no check sequence has begun",
        section: "9.8",
    },
];

/// The states of the error mode.
const ERROR_MODE: &[State] = State::ALL.split_at(State::ErrorZeros.index()).1;

/// Those with a check sequence half-way.
const IN_SEQUENCE: &[State] = SEQUENCES.as_flattened();

/// In [`NUMBERS`]: a cell that cannot be reached.
pub(super) const UNREACHABLE: u16 = u16::MAX;

/// By [`Transition::index`]: the number that a cell has among those that can be reached. Those [without time-outs](without_time_out) come
/// first, and of these the error mode, through which most cases of a fuzzer go, event by event: the same event takes a case through one
/// state after another, and a fuzzer reads eight counters at a time. A table, since it is asked for with every byte.
pub(super) static NUMBERS: [u16; CELLS] = {
    let mut numbers = [UNREACHABLE; CELLS];
    let (mut group, mut number) = (0, 0);
    while group < 3 {
        let mut turn = 0;
        while turn < CELLS {
            let state = State::ALL[turn % State::ALL.len()];
            let event = Event::ALL[turn / State::ALL.len()];
            let cell_group = match without_time_out(state, event) {
                true if state.index() >= State::ErrorZeros.index() => 0,
                true => 1,
                false => 2,
            };
            if cell_group == group && rule_against(state, event).is_none() {
                numbers[state.index() * Event::ALL.len() + event.index()] = number;
                number += 1;
            }
            turn += 1;
        }
        group += 1;
    }
    numbers
};

/// Whether a drive can reach a cell on which no time-out is monitored and that reads no line error but that of the parity.
pub(super) const fn without_time_out(state: State, event: Event) -> bool {
    state.index() < State::Waiting.index() && event.index() <= Event::Parity.index()
}

/// The rule by which nothing can reach a cell; `None` for one that can be reached.
#[must_use]
pub fn why_unreachable(cell: Transition) -> Option<&'static Rule> {
    rule_against(cell.state, cell.event)
}

// Loops, since a constant expression knows no iterators.
const fn rule_against(state: State, event: Event) -> Option<&'static Rule> {
    let mut at = 0;
    while at < RULES.len() {
        let rule = &RULES[at];
        let (mut named, mut elsewhere) = (false, true);
        let mut place = 0;
        while place < rule.events.len() {
            named |= rule.events[place].index() == event.index();
            place += 1;
        }
        place = 0;
        while place < rule.only_in.len() {
            elsewhere &= rule.only_in[place].index() != state.index();
            place += 1;
        }
        if named && elsewhere {
            return Some(rule);
        }
        at += 1;
    }
    None
}
