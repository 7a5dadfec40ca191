//! The table of wrong masters (ND21 8, 9, 10, 11).

use super::how::{Due, How, MasterDeviation, Notes, Sending};
use super::speech::{Spoken, What};
use harness_proto::line::Received;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Command, Field, Reply};
use harness_proto::novobus::master::{
    Data, Event, Fault, Job, JobId, LinkEnd, MasterOptions, Outcome, Phase, Repeat, RingLink,
};
use harness_proto::novobus::sync::{Addressing, SYNCO};

/// Bits 6 and 5 of a sync byte: the next drive, the short address (ND21 9.2).
const NEXT: u8 = 1 << 6;
const SHORT: u8 = 1 << 5;

/// The table.
pub(super) static DEVIATIONS: &[MasterDeviation] = &[
    MasterDeviation {
        name: "numbers-from-the-front",
        section: "8.5",
        about: "it counts the drives from its own transmitter on, so that the first one is number 0",
        how: How::Submits(|ring, job| Job {
            drive: ring.first().saturating_sub(job.drive),
            ..job
        }),
    },
    MasterDeviation {
        name: "gap-in-place-of-synco",
        section: "9.1",
        about: "with nothing to do it sends nothing, and no SYNCO keeps the line",
        how: How::Sends(|s| match (s.what, s.phase) {
            (What::Idle, Phase::Running) => Sending::Silence,
            _ => Sending::Byte(s.byte),
        }),
    },
    MasterDeviation {
        name: "next-sent-as-same",
        section: "9.2",
        about: "it leaves bit 6 of the sync byte out and means the next drive all the same",
        how: How::Mistakes(
            |s| match s.what {
                What::Sync(Addressing::NextDrive) => Sending::Byte(s.byte & !NEXT),
                _ => Sending::Byte(s.byte),
            },
            |h| match (h.spoken.what, h.received.error) {
                (What::Sync(Addressing::NextDrive), None) => Received::good(h.received.byte | NEXT),
                _ => h.received,
            },
        ),
    },
    MasterDeviation {
        name: "short-address-after-sequence",
        section: "9.2",
        about: "behind a check sequence it goes on with the short address of the drive before it",
        how: How::Mistakes(
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
    },
    MasterDeviation {
        name: "address-not-counted-up",
        section: "9.3",
        about: "it sends a drive's own number as the address byte, and forgets that every drive adds 1",
        how: How::Sends(|s| match (s.what, s.drive) {
            (What::Address, Some(drive)) => Sending::Byte(drive),
            _ => Sending::Byte(s.byte),
        }),
    },
    MasterDeviation {
        name: "address-not-compared",
        section: "9.3",
        about: "it does not look at the number that the address byte comes back as",
        how: How::Hears(|h| match h.spoken.what {
            What::Address => h.believed(),
            _ => h.received,
        }),
    },
    MasterDeviation {
        name: "nominal-value-low-byte-first",
        section: "9.4",
        about: "it sends the low byte of the process data first",
        how: How::Nominal(u16::swap_bytes),
    },
    MasterDeviation {
        name: "actual-value-of-the-next-drive",
        section: "9.4",
        about: "it takes the process data of a drive for those of the one before it",
        how: How::Actual(
            |ring, drive| {
                if drive == ring.first() { 0 } else { drive + 1 }
            },
        ),
    },
    MasterDeviation {
        name: "echo-not-compared",
        section: "9.5",
        about: "it does not compare the bytes of a command that come back with those that it sent",
        how: How::Hears(|h| match h.spoken.what {
            What::Code | What::Field(_, Reply::Echo) => h.believed(),
            _ => h.received,
        }),
    },
    MasterDeviation {
        name: "check-byte-off-by-one",
        section: "9.6",
        about: "the checking byte of its commands is one too high",
        how: How::Sends(|s| match s.what {
            What::Field(Field::Check, _) => Sending::Byte(s.byte.wrapping_add(1)),
            _ => Sending::Byte(s.byte),
        }),
    },
    MasterDeviation {
        name: "check-byte-zero",
        section: "9.6",
        about: "it sends 00 as the checking byte where 01 must stand",
        how: How::Sends(|s| match s.what {
            What::Field(Field::Check, _) if s.sum.with(0) == Checksum::EMPTY => Sending::Byte(0),
            _ => Sending::Byte(s.byte),
        }),
    },
    MasterDeviation {
        name: "answer-not-checked",
        section: "9.6",
        about: "it does not look at the -checksum of an answer",
        how: How::Hears(|h| match h.spoken.what {
            What::Field(_, Reply::Check) => h.believed(),
            _ => h.received,
        }),
    },
    MasterDeviation {
        name: "parity-not-looked-at",
        section: "8.3",
        about: "it takes bytes with a line error for good ones",
        how: How::Hears(|h| Received::good(h.received.byte)),
    },
    MasterDeviation {
        name: "zeros-taken-for-answers",
        section: "9.7",
        about: "it does not notice the zeros of a drive in the error mode, and believes in its answers",
        how: How::Hears(|h| {
            if h.received.is(0) {
                h.believed()
            } else {
                h.received
            }
        }),
    },
    MasterDeviation {
        name: "telegram-broken-off",
        section: "9.7",
        about: "when something is wrong it does not end the telegram that it has begun",
        how: How::Sends(|s| match s.phase {
            Phase::Locating => Sending::Byte(SYNCO),
            _ => Sending::Byte(s.byte),
        }),
    },
    MasterDeviation {
        name: "names-the-link-behind",
        section: "9.7",
        about: "it names the link behind the drive that the ring spells out, and not the one in front of it",
        how: How::Tells(|notes, event| {
            Some(renamed(event, |drive| match drive.checked_sub(1) {
                Some(next) => RingLink::into(notes.ring, next),
                None => RingLink::last(),
            }))
        }),
    },
    MasterDeviation {
        name: "names-the-link-before",
        section: "9.7",
        about: "it names the link that ends at the drive before the one that the ring spells out",
        how: How::Tells(|notes, event| {
            Some(renamed(event, |drive| {
                RingLink::into(notes.ring, notes.ring.first().min(drive + 1))
            }))
        }),
    },
    MasterDeviation {
        name: "names-drive-0",
        section: "9.7",
        about: "it takes the zeros in front of an address for the address of drive 0",
        how: How::Tells(|notes, event| Some(renamed(event, |_| RingLink::into(notes.ring, 0)))),
    },
    MasterDeviation {
        name: "damaged-told-as-broken",
        section: "9.9",
        about: "it tells of a broken link where a byte was damaged",
        how: How::Tells(|_, event| {
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
    },
    MasterDeviation {
        name: "no-check-sequence",
        section: "9.8",
        about: "it goes on behind an error without a check sequence",
        how: How::NoSequence,
    },
    MasterDeviation {
        name: "check-sequence-of-16-zeros",
        section: "9.8",
        about: "its check sequence begins with 16 zeros in place of 17",
        how: How::Sends(|s| match s.what {
            What::Sequence(0) => Sending::LeftOut,
            _ => Sending::Byte(s.byte),
        }),
    },
    MasterDeviation {
        name: "check-sequence-without-its-end",
        section: "9.8",
        about: "it sends SYNCO in place of the last byte of the check sequence",
        how: How::Sends(|s| match s.what {
            What::Sequence(21) => Sending::Byte(SYNCO),
            _ => Sending::Byte(s.byte),
        }),
    },
    MasterDeviation {
        name: "misses-bytes-too-early",
        section: "8.2",
        about: "it does not wait for as long as a byte needs to go round",
        how: How::Waits(|(phase, due, slack, byte_time): Due| {
            let early = due - (slack + byte_time);
            Some(if phase == Phase::Running { early } else { due })
        }),
    },
    MasterDeviation {
        name: "waits-for-ever",
        section: "9.9",
        about: "it waits for a byte that does not come, and for nothing else",
        how: How::Waits(|(phase, due, ..)| (phase != Phase::Running).then_some(due)),
    },
    MasterDeviation {
        name: "word-low-byte-first",
        section: "10.2",
        about: "it writes the two bytes of a word in the wrong order",
        how: How::Submits(|_, job| match job.command {
            Command::WriteWord { address, data } => Job {
                command: Command::WriteWord {
                    address,
                    data: data.swap_bytes(),
                },
                ..job
            },
            _ => job,
        }),
    },
    MasterDeviation {
        name: "writes-twice",
        section: "10.2",
        about: "it sends every write a second time",
        how: How::Doubles(|job| {
            matches!(
                job.command,
                Command::WriteByte { .. } | Command::WriteWord { .. }
            )
        }),
    },
    MasterDeviation {
        name: "and-sent-as-or",
        section: "10.3",
        about: "it takes the command bytes of And and Or for each other",
        how: How::Submits(|_, job| match job.command {
            Command::And { address_low, data } => Job {
                command: Command::Or { address_low, data },
                ..job
            },
            _ => job,
        }),
    },
    MasterDeviation {
        name: "done-when-taken",
        section: "11.6",
        about: "it tells that a write is done as soon as it has taken the order",
        how: How::Takes(|notes, id, job| {
            if !job.command.kind().reads() {
                notes.told.push(id);
                notes.queue.push_back(done(id));
            }
        }),
    },
    MasterDeviation {
        name: "done-at-the-error",
        section: "11.5",
        about: "it tells that the writes under way are done when an error stops them",
        how: How::Tells(|notes, event| {
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
    },
    MasterDeviation {
        name: "unknown-told-as-done",
        section: "11.5",
        about: "it reports a job as done that may not have run",
        how: How::Tells(|_, event| {
            Some(match event {
                Event::Ended {
                    id,
                    outcome: Outcome::Unknown(_),
                } => done(id),
                event => event,
            })
        }),
    },
    MasterDeviation {
        name: "failed-told-as-read",
        section: "11.5",
        about: "it gives 0 as the result of a read that never came back",
        how: How::Tells(failed_as_read),
    },
    MasterDeviation {
        name: "repeats-what-must-not-be",
        section: "11.5",
        about: "it repeats a job behind an error whatever it is",
        how: How::Submits(|_, job| Job {
            repeat: Repeat::Always,
            ..job
        }),
    },
    MasterDeviation {
        name: "repetition-not-told",
        section: "11.5",
        about: "it does not tell that a write may have run twice",
        how: How::Tells(|_, event| {
            Some(match event {
                Event::Ended {
                    id,
                    outcome: Outcome::Done { .. },
                } => done(id),
                event => event,
            })
        }),
    },
    MasterDeviation {
        name: "error-not-told",
        section: "11.5",
        about: "it corrects an error and does not report it",
        how: How::Tells(|_, event| match event {
            Event::Disturbed { .. } | Event::Recovered { .. } => None,
            event => Some(event),
        }),
    },
    MasterDeviation {
        name: "gives-up-at-once",
        section: "11.5",
        about: "it stops the bus at the first error",
        how: How::Options(|options| MasterOptions {
            attempts: 0,
            ..options
        }),
    },
    MasterDeviation {
        name: "never-gives-up",
        section: "11.5",
        about: "it tries to correct an error 255 times before it stops the bus",
        how: How::Options(|options| MasterOptions {
            attempts: u8::MAX,
            ..options
        }),
    },
    MasterDeviation {
        name: "result-of-the-read-before",
        section: "11.6",
        about: "it gives the result of the read before this one, where there was one",
        how: How::Tells(|notes, event| {
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
    },
    MasterDeviation {
        name: "results-exchanged",
        section: "11.6",
        about: "it gives the results of two reads to each other's orders",
        how: How::Tells(exchange_results),
    },
];

/// Whether a telegram is the first one behind a check sequence, and for the drive of the one before it or not known yet.
fn goes_on(spoken: &Spoken) -> bool {
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

fn failed_as_read(_: &mut Notes, event: Event) -> Option<Event> {
    // A failed write is reported as an empty read, so that a job of either kind has a result.
    let Event::Ended {
        id,
        outcome: Outcome::Failed(_),
    } = event
    else {
        return Some(event);
    };
    let outcome = Outcome::Read(Data::default());
    Some(Event::Ended { id, outcome })
}

fn exchange_results(notes: &mut Notes, event: Event) -> Option<Event> {
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
