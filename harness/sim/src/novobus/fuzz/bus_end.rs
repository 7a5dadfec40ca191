//! One drive's end of the bus with everything that a line can do to it: bytes, line errors, silence.

use crate::fuzz::LONGEST;
use crate::novobus::device::Device as _;
use crate::novobus::plain::PlainDrive;
use crate::novobus::reference;
use crate::novobus::transitions::tour::TourStep;
use crate::novobus::transitions::{Event, Notes, Reached, State, Watched};
use harness_proto::line::Received;
use harness_proto::nd21;
use harness_proto::novobus::bus_end::{Deadline, Reaction};
use harness_proto::novobus::properties::Properties;
use harness_proto::time::{Instant, Span};

/// Bit 0 of the first byte: time-outs are monitored from the start (ND21 14.10.2). The rest goes over the wire as it
/// is, but for FF: FF FF is a good FF, FF 00 x is x with wrong parity, FF 01 x a framing error, FF 02 a break, FF 03 x
/// an overrun, and FF with anything else silence until something is due.
///
/// # Panics
/// A rule of ND21 9.1 to 9.9 is broken; or the reference model, where no time-out is monitored, gives another answer.
pub fn bus_end(data: &[u8]) {
    let _transitions: Reached = bus_end_watched(data);
}

/// The same, with the transitions that the drive went through.
///
/// # Panics
/// As [`bus_end`], or a transition is called unreachable.
#[must_use]
pub fn bus_end_watched<N: Notes>(data: &[u8]) -> N {
    let Some((&options, wire)) = data.split_first() else {
        return N::default();
    };
    let mut eeprom = [0; 256];
    if options & 1 != 0 {
        eeprom[usize::from(nd21::ee::SELFTEST)] = nd21::bits::selftest::MONITORING;
    }
    let mut drive = Watched::<N>::new(PlainDrive::new(Properties::default(), eeprom));
    // Time-outs are no part of the reference model.
    let mut model = (options & 1 == 0).then(reference::Drive::new);
    let mut now = Instant::START;
    let mut wire = &wire[..wire.len().min(LONGEST)];
    while let Some(stimulus) = TourStep::decode(&mut wire) {
        now += Span::from_micros(287);
        match stimulus {
            TourStep::Silence => silence(&mut drive, &mut now),
            TourStep::Byte(received) => byte(&mut drive, now, received, &mut model),
        }
        // Nor is what a case that switches them on does from there.
        model = model.filter(|_| drive.deadline().is_none());
    }
    drive.reached().assert_possible();
    drive.into_reached()
}

/// ND21 9.9: nothing goes out until the silence has lasted twice as long; then zeros, one a byte time.
fn silence<N: Notes>(drive: &mut Watched<N>, now: &mut Instant) {
    let Some(deadline) = drive.deadline() else {
        return;
    };
    let (Deadline::At(due) | Deadline::LineFree(due)) = deadline;
    *now = due.max(*now);
    let step = drive.handle_deadline(*now);
    let expected = matches!(deadline, Deadline::LineFree(_)).then_some(0);
    assert_eq!(step.byte, expected, "unasked, {deadline:?}");
    assert!(drive.in_error(), "a time-out is an error");
}

fn byte<N: Notes>(
    drive: &mut Watched<N>,
    now: Instant,
    received: Received,
    model: &mut Option<reference::Drive>,
) {
    let cell = drive.transition(received);
    let was_in_error = drive.in_error();
    let Reaction { byte, .. } = drive.receive(now, received);
    // 9.2: PAUSE alone gets no answer.
    assert_eq!(byte.is_none(), cell.event == Event::Pause, "{cell}");
    if was_in_error {
        let echo = [0, received.byte, received.byte.wrapping_add(1)];
        assert!(
            byte.is_some_and(|byte| echo.contains(&byte)),
            "{cell}: {byte:02X?}"
        );
        // 9.8: the sequence ends the error mode, and nothing else does.
        let complete = cell.event == Event::SequenceNext
            && matches!(
                cell.state,
                State::Sequence4
                    | State::IncrementsSequence4
                    | State::WaitingSequence4
                    | State::SendingSequence4
            );
        assert_eq!(drive.in_error(), !complete, "{cell}");
    } else if drive.in_error() {
        assert_eq!(byte, Some(0), "9.7: {cell}");
    }
    let Some(model) = model else { return };
    let expected = model.receive(reference::Cell {
        byte: received.byte,
        error: received.error.is_some(),
    });
    assert_eq!(byte, expected, "{cell}");
    assert_eq!(drive.in_error(), model.in_error(), "{cell}");
    if drive.in_error() && !was_in_error {
        // The reference model knows one error code only.
        for address in [0xFD82, 0xFD83] {
            model.poke(address, drive.drive().memory().peek(address));
        }
    }
}
