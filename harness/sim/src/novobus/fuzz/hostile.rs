//! The master on a ring that sends arbitrary answers.

use super::words;
use crate::fuzz::LONGEST;
use crate::fuzz::Notebook;
use crate::novobus::reference;
use harness_proto::line::{LineError, Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::{Command, Kind};
use harness_proto::novobus::master::{CyclePace, Event, Job, JobId, Master, MasterOptions, Phase};
use harness_proto::novobus::output::OutputChange;
use harness_proto::time::Instant;

/// Silence after the input, in byte times, in which everything comes to its end.
const SILENCE: usize = 250_000;

/// The first byte is the size of the ring; of the others each is one byte time: FE and FF are silence, FD a
/// byte with wrong parity, FC a job, F9 the cyclic exchange with all drives, FB the byte that was sent a ring's length ago, FA what sound drives would have answered
/// to it, anything else comes as it is. FC and F9 take no time. Jobs are of each command in turn, for each drive in turn; every
/// second nine must not be repeated.
///
/// # Panics
/// A job ends twice or never, or the master holds more jobs than it may.
pub fn master(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and notes the master's phases and events.
///
/// # Panics
/// As [`master`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let Some((&drives, data)) = data.split_first() else {
        return;
    };
    let Ok(size) = RingSize::new(u64::from(drives % 8) + 1) else {
        return;
    };
    let mut play = HostilePlay::new(size);
    let steps = data.iter().take(LONGEST).copied();
    for byte in steps.chain(std::iter::repeat_n(0xFF, SILENCE)) {
        play.step(byte, notes);
        if play.open.is_empty() && byte == 0xFF && play.master.jobs() == 0 {
            break;
        }
    }
    let open = play.open.len();
    assert!(open == 0, "{open} jobs never ended");
}

struct HostilePlay {
    size: RingSize,
    master: Master,
    now: Instant,
    sent: Vec<u8>,
    sound: Sound,
    steps: words::Steps,
    given: usize,
    /// The jobs that have not ended, with their commands and what the master was doing when it got them.
    open: Vec<(JobId, Kind, Phase)>,
}

impl HostilePlay {
    fn new(size: RingSize) -> Self {
        Self {
            size,
            master: Master::new(size, Rate::Baud38400, MasterOptions::default()),
            now: Instant::START,
            sent: Vec::new(),
            sound: Sound::new(size),
            steps: words::Steps::default(),
            given: 0,
            open: Vec::new(),
        }
    }

    /// One byte time.
    fn step(&mut self, byte: u8, notes: &mut Notebook<'_>) {
        let before = self.master.phase();
        // A request to the master takes no time on the line.
        match byte {
            0xFC => return self.give(notes),
            0xF9 => {
                let all: Vec<u8> = (0..self.size.drives()).collect();
                let _all_of_the_ring = self.master.set_exchange(&all, CyclePace::Continuous);
                return;
            }
            _ => {}
        }
        let received = match byte {
            0xFB => self
                .due()
                .and_then(|place| self.sent.get(place))
                .copied()
                .map(Received::good),
            0xFA => self.answer().map(Received::good),
            0xFD => Some(Received::bad(0xFD, LineError::Parity)),
            0xFE | 0xFF => None,
            byte => Some(Received::good(byte)),
        };
        let due = if notes.wanted() { self.answer() } else { None };
        if let Some(received) = received {
            self.master.handle_byte(self.now, received);
        }
        if self
            .master
            .poll_timeout()
            .is_some_and(|due| due <= self.now)
        {
            self.master.handle_timeout(self.now);
        }
        while let Some(event) = self.master.poll_event() {
            self.hear(&event, notes);
        }
        self.sent.extend(self.master.poll_transmit(self.now));
        let under_way = self.master.under_way();
        assert!(under_way <= 1_024, "{under_way} under way");
        let heard = words::heard(received, due);
        self.steps.note(notes, before, heard, self.master.phase());
        self.now += Rate::Baud38400.byte_time();
    }

    /// Which of the bytes that were sent is to come back now.
    fn due(&self) -> Option<usize> {
        self.sent
            .len()
            .checked_sub(usize::from(self.size.drives()) + 1)
    }

    /// What sound drives would send now.
    fn answer(&mut self) -> Option<u8> {
        let place = self.due()?;
        self.sound.answer(&self.sent, place)
    }

    fn give(&mut self, notes: &mut Notebook<'_>) {
        let command = command(self.given);
        let drive = u8::try_from(self.given % usize::from(self.size.drives())).unwrap_or(0);
        let job = Job::new(drive, command);
        let once = self.given / COMMANDS % 2 == 1;
        self.given += 1;
        match self.master.submit(if once { job.once() } else { job }) {
            Ok(id) => self.open.push((id, command.kind(), self.master.phase())),
            Err(refused) => words::refused(notes, &refused),
        }
    }

    fn hear(&mut self, event: &Event, notes: &mut Notebook<'_>) {
        let mut job = None;
        if let Event::Ended { id, .. } = event {
            let place = self.open.iter().position(|(open, ..)| open == id);
            assert!(place.is_some(), "a job ended that was not open");
            job = place.map(|place| self.open.remove(place));
        }
        words::told(notes, event, job.map(|(_, kind, given)| (kind, given)));
    }
}

/// How many commands there are.
const COMMANDS: usize = 9;

/// The commands of ND21 10 in turn.
fn command(number: usize) -> Command {
    let address = 0xFE13;
    match number % COMMANDS {
        0 => Command::WriteByte { address, data: 1 },
        1 => Command::ReadByte { address },
        2 => Command::ReadWord { address },
        3 => Command::ReadLong { address },
        4 => Command::WriteWord {
            address,
            data: 0x0203,
        },
        5 => Command::And {
            address_low: 0x40,
            data: 0x7F,
        },
        6 => Command::Or {
            address_low: 0x40,
            data: 1,
        },
        7 => OutputChange::from_code(1).map_or(Command::ResetH8, Command::WriteIo),
        _ => Command::ResetH8,
    }
}

/// Drives that answer as the manual says, computed only on request.
struct Sound {
    /// In ring order.
    drives: Vec<reference::Drive>,
    answers: Vec<Option<u8>>,
}

impl Sound {
    fn new(size: RingSize) -> Self {
        Self {
            drives: vec![reference::Drive::new(); usize::from(size.drives())],
            answers: Vec::new(),
        }
    }

    /// The answer to a byte of those that were sent; `None` for PAUSE.
    fn answer(&mut self, sent: &[u8], place: usize) -> Option<u8> {
        for &byte in sent.iter().take(place + 1).skip(self.answers.len()) {
            let through = self.drives.iter_mut().try_fold(byte, |byte, drive| {
                drive.receive(reference::Cell { byte, error: false })
            });
            self.answers.push(through);
        }
        self.answers.get(place).copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fuzz::features;

    /// ND21 10: every command ends well on a ring that answers as sound drives do, so FA is what they answer.
    #[test]
    fn a_sound_ring_does_every_job() {
        for drives in [0, 2, 7] {
            let input = [&[drives, 0xF9][..], &[0xFC; COMMANDS], &[0xFA; 400]].concat();
            let said = features(noted, &input);
            let said: Vec<_> = said.iter().map(ToString::to_string).collect();
            for kind in ["ReadByte", "ReadWord", "ReadLong"] {
                assert!(said.contains(&format!("{kind}: read")), "{said:?}");
            }
            for kind in ["WriteByte", "WriteWord", "And", "Or", "WriteIO", "ResetH8"] {
                assert!(said.contains(&format!("{kind}: done")), "{said:?}");
            }
            let disturbed = said.iter().find(|said| said.starts_with("disturbed"));
            assert_eq!(disturbed, None);
        }
    }
}
