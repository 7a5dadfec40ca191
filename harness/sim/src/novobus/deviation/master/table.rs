//! The table of wrong masters (ND21 8, 9, 10, 11).

use super::how::{Due, How, MasterDeviation, MasterInjection, MasterNotes, Sending};
use super::speech::{SentByte, What};
use harness_proto::line::Received;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Command, Field, Reply};
use harness_proto::novobus::master::{
    Event, Fault, Job, JobId, LinkEnd, MasterOptions, Outcome, Phase, ReadData, Repeat, RingLink,
};
use harness_proto::novobus::sync::{Addressing, SYNCO};

/// Bits 6 and 5 of a sync byte: the next drive, the short address (ND21 9.2).
const NEXT: u8 = 1 << 6;
const SHORT: u8 = 1 << 5;

pub(super) static DEVIATIONS: &[MasterDeviation] = &[
    wrong(
        "numbers-from-the-front",
        "8.5",
        "it counts the drives from its own transmitter on, so that the first one is number 0",
        How::Submits(|ring, job| Job {
            drive: ring.first().saturating_sub(job.drive),
            ..job
        }),
    ),
    wrong(
        "gap-in-place-of-synco",
        "9.1",
        "with nothing to do it sends nothing, and no SYNCO keeps the line",
        How::Sends(|s| match (s.what, s.phase) {
            (What::Idle, Phase::Running) => Sending::Silence,
            _ => Sending::Byte(s.byte),
        }),
    ),
    wrong(
        "next-sent-as-same",
        "9.2",
        "it leaves bit 6 of the sync byte out and means the next drive all the same",
        How::Mistakes(
            |s| match s.what {
                What::Sync(Addressing::NextDrive) => Sending::Byte(s.byte & !NEXT),
                _ => Sending::Byte(s.byte),
            },
            |h| match (h.spoken.what, h.received.error) {
                (What::Sync(Addressing::NextDrive), None) => Received::good(h.received.byte | NEXT),
                _ => h.received,
            },
        ),
    ),
    wrong(
        "short-address-after-sequence",
        "9.2",
        "behind a check sequence it goes on with the short address of the drive before it",
        How::Mistakes(
            |s| match s.what {
                What::Sync(Addressing::AddressFollows) if goes_on(s) => {
                    Sending::Byte(s.byte | SHORT)
                }
                What::Address if goes_on(s) => Sending::LeftOut,
                _ => Sending::Byte(s.byte),
            },
            |h| match (h.spoken.what, h.received.error) {
                (What::Sync(Addressing::AddressFollows), None) if goes_on(&h.spoken) => {
                    Received::good(h.received.byte & !SHORT)
                }
                _ => h.received,
            },
        ),
    ),
    wrong(
        "address-not-counted-up",
        "9.3",
        "it sends a drive's own number as the address byte, and forgets that every drive adds 1",
        How::Sends(|s| match (s.what, s.drive) {
            (What::Address, Some(drive)) => Sending::Byte(drive),
            _ => Sending::Byte(s.byte),
        }),
    ),
    wrong(
        "address-not-compared",
        "9.3",
        "it does not look at the number that the address byte comes back as",
        How::Hears(|h| match h.spoken.what {
            What::Address => h.believed(),
            _ => h.received,
        }),
    ),
    wrong(
        "nominal-value-low-byte-first",
        "9.4",
        "it sends the low byte of the process data first",
        How::Nominal(u16::swap_bytes),
    ),
    wrong(
        "actual-value-of-the-next-drive",
        "9.4",
        "it takes the process data of a drive for those of the one before it",
        How::Actual(
            |ring, drive| {
                if drive == ring.first() { 0 } else { drive + 1 }
            },
        ),
    ),
    wrong(
        "echo-not-compared",
        "9.5",
        "it does not compare the bytes of a command that come back with those that it sent",
        How::Hears(|h| match h.spoken.what {
            What::Code | What::Field(_, Reply::Echo) => h.believed(),
            _ => h.received,
        }),
    ),
    wrong(
        "check-byte-off-by-one",
        "9.6",
        "the checking byte of its commands is one too high",
        How::Sends(|s| match s.what {
            What::Field(Field::Check, _) => Sending::Byte(s.byte.wrapping_add(1)),
            _ => Sending::Byte(s.byte),
        }),
    ),
    wrong(
        "check-byte-zero",
        "9.6",
        "it sends 00 as the checking byte where 01 must stand",
        How::Sends(|s| match s.what {
            What::Field(Field::Check, _) if s.sum.with(0) == Checksum::EMPTY => Sending::Byte(0),
            _ => Sending::Byte(s.byte),
        }),
    ),
    wrong(
        "answer-not-checked",
        "9.6",
        "it does not look at the -checksum of an answer",
        How::Hears(|h| match h.spoken.what {
            What::Field(_, Reply::Check) => h.believed(),
            _ => h.received,
        }),
    ),
    wrong(
        "parity-not-looked-at",
        "8.3",
        "it takes bytes with a line error for good ones",
        How::Hears(|h| Received::good(h.received.byte)),
    ),
    wrong(
        "zeros-taken-for-answers",
        "9.7",
        "it does not notice the zeros of a drive in the error mode, and believes in its answers",
        How::Hears(|h| {
            if h.received.is(0) {
                h.believed()
            } else {
                h.received
            }
        }),
    ),
    wrong(
        "telegram-broken-off",
        "9.7",
        "when something is wrong it does not end the telegram that it has begun",
        How::Sends(|s| match s.phase {
            Phase::Locating => Sending::Byte(SYNCO),
            _ => Sending::Byte(s.byte),
        }),
    ),
    wrong(
        "names-the-link-behind",
        "9.7",
        "it names the link behind the drive that the ring spells out, and not the one in front of it",
        How::Tells(|notes, event| {
            Some(renamed(event, |drive| match drive.checked_sub(1) {
                Some(next) => RingLink::into(notes.ring, next),
                None => RingLink::last(),
            }))
        }),
    ),
    wrong(
        "names-the-link-before",
        "9.7",
        "it names the link that ends at the drive before the one that the ring spells out",
        How::Tells(|notes, event| {
            Some(renamed(event, |drive| {
                RingLink::into(notes.ring, notes.ring.first().min(drive + 1))
            }))
        }),
    ),
    wrong(
        "names-drive-0",
        "9.7",
        "it takes the zeros in front of an address for the address of drive 0",
        How::Tells(|notes, event| Some(renamed(event, |_| RingLink::into(notes.ring, 0)))),
    ),
    wrong(
        "damaged-told-as-broken",
        "9.9",
        "it tells of a broken link where a byte was damaged",
        How::Tells(|_, event| {
            Some(match event {
                Event::Disturbed {
                    fault: Fault::Damaged(link),
                    attempt,
                } => Event::Disturbed {
                    fault: Fault::Broken(link),
                    attempt,
                },
                event => event,
            })
        }),
    ),
    wrong(
        "no-check-sequence",
        "9.8",
        "it goes on behind an error without a check sequence",
        How::NoSequence,
    ),
    wrong(
        "check-sequence-of-16-zeros",
        "9.8",
        "its check sequence begins with 16 zeros in place of 17",
        How::Sends(|s| match s.what {
            What::Sequence(0) => Sending::LeftOut,
            _ => Sending::Byte(s.byte),
        }),
    ),
    wrong(
        "check-sequence-without-its-end",
        "9.8",
        "it sends SYNCO in place of the last byte of the check sequence",
        How::Sends(|s| match s.what {
            What::Sequence(21) => Sending::Byte(SYNCO),
            _ => Sending::Byte(s.byte),
        }),
    ),
    wrong(
        "misses-bytes-too-early",
        "8.2",
        "it does not wait for as long as a byte needs to go round",
        How::Waits(|(phase, due, slack, byte_time): Due| {
            let early = due - (slack + byte_time);
            Some(if phase == Phase::Running { early } else { due })
        }),
    ),
    wrong(
        "waits-for-ever",
        "9.9",
        "it waits for a byte that does not come, and for nothing else",
        How::Waits(|(phase, due, ..)| (phase != Phase::Running).then_some(due)),
    ),
    wrong(
        "word-low-byte-first",
        "10.2",
        "it writes the two bytes of a word in the wrong order",
        How::Submits(|_, job| match job.command {
            Command::WriteWord { address, data } => Job {
                command: Command::WriteWord {
                    address,
                    data: data.swap_bytes(),
                },
                ..job
            },
            _ => job,
        }),
    ),
    wrong(
        "writes-twice",
        "10.2",
        "it sends every write a second time",
        How::Doubles(|job| {
            matches!(
                job.command,
                Command::WriteByte { .. } | Command::WriteWord { .. }
            )
        }),
    ),
    wrong(
        "and-sent-as-or",
        "10.3",
        "it takes the command bytes of And and Or for each other",
        How::Submits(|_, job| match job.command {
            Command::And { address_low, data } => Job {
                command: Command::Or { address_low, data },
                ..job
            },
            _ => job,
        }),
    ),
    wrong(
        "done-when-taken",
        "11.6",
        "it tells that a write is done as soon as it has taken the order",
        How::Takes(|notes, id, job| {
            if !job.command.kind().reads() {
                notes.told.push(id);
                notes.queue.push_back(done(id));
            }
        }),
    ),
    wrong(
        "done-at-the-error",
        "11.5",
        "it tells that the writes under way are done when an error stops them",
        How::Tells(|notes, event| {
            if let Event::Disturbed { .. } = event {
                for (id, job) in std::mem::take(&mut notes.open) {
                    if !job.command.kind().reads() {
                        notes.told.push(id);
                        notes.queue.push_back(done(id));
                    }
                }
            }
            Some(event)
        }),
    ),
    wrong(
        "unknown-told-as-done",
        "11.5",
        "it reports a job as done that may not have run",
        How::Tells(|_, event| {
            Some(match event {
                Event::Ended {
                    id,
                    outcome: Outcome::Unknown(_),
                } => done(id),
                event => event,
            })
        }),
    ),
    wrong(
        "failed-told-as-read",
        "11.5",
        "it gives 0 as the result of a read that never came back",
        How::Tells(failed_as_read),
    ),
    wrong(
        "repeats-what-must-not-be",
        "11.5",
        "it repeats a job behind an error whatever it is",
        How::Submits(|_, job| Job {
            repeat: Repeat::Always,
            ..job
        }),
    ),
    wrong(
        "repetition-not-told",
        "11.5",
        "it does not tell that a write may have run twice",
        How::Tells(|_, event| {
            Some(match event {
                Event::Ended {
                    id,
                    outcome: Outcome::Done { .. },
                } => done(id),
                event => event,
            })
        }),
    ),
    wrong(
        "error-not-told",
        "11.5",
        "it corrects an error and does not report it",
        How::Tells(|_, event| match event {
            Event::Disturbed { .. } | Event::Recovered { .. } => None,
            event => Some(event),
        }),
    ),
    wrong(
        "gives-up-at-once",
        "11.5",
        "it stops the bus at the first error",
        How::Options(|options| MasterOptions {
            attempts: 0,
            ..options
        }),
    ),
    wrong(
        "never-gives-up",
        "11.5",
        "it tries to correct an error 255 times before it stops the bus",
        How::Options(|options| MasterOptions {
            attempts: u8::MAX,
            ..options
        }),
    ),
    wrong(
        "result-of-the-read-before",
        "11.6",
        "it gives the result of the read before this one, where there was one",
        How::Tells(|notes, event| {
            let Event::Ended {
                id,
                outcome: Outcome::Read(data),
            } = event
            else {
                return Some(event);
            };
            let old = notes.last.replace(data).unwrap_or(data);
            Some(Event::Ended {
                id,
                outcome: Outcome::Read(old),
            })
        }),
    ),
    wrong(
        "results-exchanged",
        "11.6",
        "it gives the results of two reads to each other's orders",
        How::Tells(exchange_results),
    ),
];

pub(super) const fn wrong(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    how: How,
) -> MasterDeviation {
    MasterDeviation::new(name, section, about, MasterInjection(how))
}

/// Whether a telegram is the first one after a check sequence, and for the drive of the one before it or not known yet.
fn goes_on(spoken: &SentByte) -> bool {
    spoken.after_sequence && spoken.drive_before.is_some()
}

fn done(id: JobId) -> Event {
    Event::Ended {
        id,
        outcome: Outcome::Done {
            perhaps_twice: false,
        },
    }
}

/// The event with another link where one into a drive was damaged or broken.
fn renamed(event: Event, link: impl Fn(u8) -> RingLink) -> Event {
    let Event::Disturbed { fault, attempt } = event else {
        return event;
    };
    let into = |named: RingLink| match named.to {
        LinkEnd::Drive(drive) => link(drive),
        LinkEnd::Master => named,
    };
    let fault = match fault {
        Fault::Damaged(named) => Fault::Damaged(into(named)),
        Fault::Broken(named) => Fault::Broken(into(named)),
        fault => fault,
    };
    Event::Disturbed { fault, attempt }
}

fn failed_as_read(_: &mut MasterNotes, event: Event) -> Option<Event> {
    // A failed write is reported as an empty read, so that a job of either kind has a result.
    let Event::Ended {
        id,
        outcome: Outcome::Failed(_),
    } = event
    else {
        return Some(event);
    };
    let outcome = Outcome::Read(ReadData::default());
    Some(Event::Ended { id, outcome })
}

fn exchange_results(notes: &mut MasterNotes, event: Event) -> Option<Event> {
    let Event::Ended {
        id,
        outcome: Outcome::Read(data),
    } = event
    else {
        return Some(event);
    };
    match notes.held.take() {
        None => {
            notes.held = Some((id, data));
            None
        }
        Some((first, held)) => {
            let outcome = Outcome::Read(held);
            notes.queue.push_back(Event::Ended { id, outcome });
            let outcome = Outcome::Read(data);
            Some(Event::Ended { id: first, outcome })
        }
    }
}
