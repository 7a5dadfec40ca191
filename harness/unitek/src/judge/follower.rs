//! Follows the frames of a bus, drive by drive.

use super::cycle::{Cycle, Running};
use super::drives::{Breach, JudgedDrives, MOST_BREACHES};
use super::elsewhere::Elsewhere;
use super::held::{Contents, is_live, takes_writes};
use super::supply::Supply;
use super::symptom::FrameSymptom::{self, Length, Missing, Name};
use crate::language::{identifier, written};
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{CYCLES, Reply};
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::sender_of;
use harness_proto::unitek::words::MODE_LOCK;
use harness_proto::unitek::{Access, Data, REGISTERS, Register, Request};
use harness_sim::record::{FrameEnd, LineFrame};
use std::collections::{BTreeMap, VecDeque};

/// How much later than the slowest reply so far a reply may be, and how long a frame may be in flight.
const PATIENCE: Span = Span::from_millis(20);

/// How long a reply is waited for where a busy computer stamps the frames.
const LONG_PATIENCE: Span = Span::from_millis(1_000);

/// Requests of a drive that are kept at most while they wait for their replies.
const MOST_ASKED: usize = 1_000;

/// The longest interval of a cycle, and some more.
pub(super) const LONGEST_CYCLE: Span = Span::from_millis(300);

#[derive(Clone, Debug)]
pub(super) struct PendingRequest {
    pub(super) register: u8,
    pub(super) at: Instant,
    pub(super) frame: usize,
    /// Whether the drive has certainly heard it and answers it.
    pub(super) sure: bool,
    /// Whether a gap of the log followed it, and the drive had certainly heard it.
    pub(super) excused: bool,
    /// What the register could hold since the request: a drive may read it at any time until it replies.
    pub(super) held: Contents,
}

/// Whether homing may run (ex 12).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Homing {
    /// Since before the first frame, or since a gap of the log.
    #[default]
    Perhaps,
    /// A frame asks for it.
    AskedFor,
    /// A lock has ended it.
    Ended,
}

/// What the frames show of one drive.
#[derive(Debug)]
pub(crate) struct Follower {
    pub(super) drive: u8,
    /// On which it may receive and send: after a change the old and the new ones, since it is open when a drive changes.
    pub(super) rx: Vec<u16>,
    pub(super) tx: Vec<u16>,
    /// On which it may receive and send as well (`second-identifiers`).
    pub(super) second: [Vec<u16>; 2],
    /// 73 was written: it may use another bit rate than the bus, at once or from its next start on (`rate-change`).
    pub(super) other_rate: bool,
    pub(super) held: Vec<Contents>,
    pub(super) cycles: [Cycle; 256],
    pub(super) asked: VecDeque<PendingRequest>,
    /// Contents that a reply under way may have, by register: a frame of a cycle or an event came after its request, and may not have been it.
    pub(super) loose: BTreeMap<u8, (Instant, Contents)>,
    /// The latest of all replies, after its request.
    pub(super) slowest: Option<Span>,
    /// Whether replies with 8F are short, once it is known (`map-reply`).
    pub(super) short_map: Option<bool>,
    /// Whether all replies have 6 bytes, where it is known (bit 8 of DC), and when that may have changed.
    pub(super) wide: Option<bool>,
    pub(super) wide_at: Instant,
    /// It has sent with an identifier of its own.
    pub(super) named: bool,
    /// When MODE was last written, or may have been.
    pub(super) mode_at: Instant,
    /// Homing may run, which sets the destination at its end.
    pub(super) homes: Homing,
    /// What hosts have sent on other identifiers.
    pub(super) elsewhere: Elsewhere,
    pub(super) begin: Option<Instant>,
    /// When the first frame after the last gap of the log began.
    pub(super) gap: Option<Instant>,
    /// Registers of which a frame came that nothing here asks for, and when last: their cycles run since before the first frame.
    pub(super) unsolicited: BTreeMap<u8, Instant>,
    /// What was written to registers that cannot be written, and held something else.
    pub(super) refused: BTreeMap<u8, u32>,
    pub(super) others: Vec<u8>,
    /// Whether its identifiers are guessed from what it sends: it may receive on another one, and change both at its next start (`id-change`).
    pub(super) guessed: bool,
    /// Whether the times of frames are those of the bus.
    pub(super) timed: bool,
    /// How late a frame may be.
    pub(super) patience: Span,
    /// How far the time of a frame may be off.
    pub(super) tolerance: Span,
    /// The time that frames have used.
    pub(super) used: Span,
    /// Requests that were not answered and accuse no drive, since a gap of the log followed them.
    pub(super) excused: usize,
    /// Whether the supply may have been switched off and on, and what the frames show if so.
    pub(super) supply: Supply,
    pub(super) judged: JudgedDrives,
}

impl Follower {
    /// A drive of which nothing is known but its identifiers.
    #[must_use]
    pub(crate) fn new(drive: u8, (rx, tx): (u16, u16)) -> Self {
        let mut held = vec![Contents::any(); REGISTERS.len()];
        held[0x68] = Contents::one(rx.into());
        held[0x69] = Contents::one(tx.into());
        Self {
            drive,
            rx: vec![rx],
            tx: vec![tx],
            second: Default::default(),
            other_rate: false,
            held,
            cycles: [Cycle::Unknown; 256],
            asked: VecDeque::new(),
            loose: BTreeMap::new(),
            slowest: None,
            short_map: None,
            wide: None,
            wide_at: Instant::START,
            homes: Homing::default(),
            elsewhere: Elsewhere::default(),
            begin: None,
            gap: None,
            unsolicited: BTreeMap::new(),
            refused: BTreeMap::new(),
            others: Vec::new(),
            named: false,
            mode_at: Instant::START,
            guessed: false,
            timed: true,
            patience: PATIENCE,
            tolerance: Span::ZERO,
            used: Span::ZERO,
            excused: 0,
            supply: Supply::default(),
            judged: JudgedDrives::default(),
        }
    }

    /// A follower of a drive whose identifiers are guessed from its frames.
    #[must_use]
    pub(crate) fn guessed(drive: u8, identifiers: (u16, u16)) -> Self {
        Self {
            guessed: true,
            held: vec![Contents::any(); REGISTERS.len()],
            ..Self::new(drive, identifiers)
        }
    }

    /// A follower of a drive on which no cycle runs, and whose frames a busy computer stamps.
    #[must_use]
    pub(crate) fn settled(drive: u8, identifiers: (u16, u16)) -> Self {
        Self {
            cycles: [Cycle::Off(Instant::START); 256],
            timed: false,
            homes: Homing::Ended,
            supply: Supply::always_on(),
            patience: LONG_PATIENCE,
            ..Self::new(drive, identifiers)
        }
    }

    /// Adds a tolerance for the time of each frame.
    #[must_use]
    pub(crate) fn with_tolerance(self, tolerance: Span) -> Self {
        Self {
            patience: self.patience + tolerance,
            tolerance,
            ..self
        }
    }

    /// On which it may receive and send.
    pub(super) fn identifiers(&self) -> impl Iterator<Item = u16> {
        let second = self.second.iter().flatten();
        self.rx.iter().chain(&self.tx).chain(second).copied()
    }

    /// The clock of the log was set in front of the frame that begins at `at`: how long ago what came before was is not known.
    pub(super) fn clock_set(&mut self, at: Instant) {
        for cycle in &mut self.cycles {
            if let Cycle::On(running) = cycle {
                running.blur(at);
            }
        }
        if let Some(restarted) = &mut self.supply.restarted {
            restarted.clock_set(at);
        }
    }

    /// Whether a request waits for its reply.
    #[must_use]
    pub(crate) fn waits(&self) -> bool {
        self.asked.iter().any(|asked| asked.sure)
    }

    pub(crate) fn hear(&mut self, number: usize, frame: &LineFrame) {
        let sends = self.sent_it(frame) && !matches!(frame.ended, FrameEnd::Error(_));
        if sends && self.supply.may_have_failed(frame.start + self.tolerance) {
            let restarted = self.restarted(frame.start);
            self.supply
                .may_be(restarted, self.judged.breaches.len(), number);
        }
        if let Some(restarted) = &mut self.supply.restarted {
            restarted.hear(number, frame);
        }
        self.hear_one(number, frame);
        self.explain_by_silence(number);
        if sends {
            self.supply.sent = Some(frame.at);
        }
    }

    fn hear_one(&mut self, number: usize, frame: &LineFrame) {
        self.used = self.used + frame.at.since(frame.start);
        self.begin.get_or_insert(frame.start);
        if self.sent_it(frame) {
            // An error frame ends a frame that is repeated.
            if !matches!(frame.ended, FrameEnd::Error(_)) {
                self.missing(number, frame.start);
                self.sends(number, frame);
            }
        } else if among(&self.rx, &frame.frame) || among(&self.second[0], &frame.frame) {
            self.hears(number, frame);
        } else {
            self.elsewhere.hear(&frame.frame, frame.at);
        }
    }

    /// Whether a frame is the drive's: by its number, or by an identifier that it may have taken.
    fn sent_it(&self, frame: &LineFrame) -> bool {
        let moved = among(&self.tx, &frame.frame) || among(&self.second[1], &frame.frame);
        match frame.from {
            Some(drive) if drive == self.drive => true,
            Some(drive) => moved && !self.others.contains(&drive),
            None => moved && sender_of(&frame.frame).is_none(),
        }
    }

    /// The judgement, after the last frame.
    #[must_use]
    pub(crate) fn end(mut self, number: usize, frames: &[LineFrame]) -> JudgedDrives {
        if let Some(last) = frames.last() {
            self.missing(number, last.at);
            self.owes_at_the_end(number);
        }
        // The reply to the last request may be what a log does not have any more.
        let waits = self.asked.front().zip(frames.last());
        if self.slowest.is_none() && waits.is_some_and(|(asked, last)| asked.at < last.start) {
            self.judged.remarks.push(format!(
                "drive {} answers no request: it is off, or has other identifiers than {:03X} and {:03X}",
                self.drive, self.rx[0], self.tx[0]
            ));
        }
        self.judged
    }

    fn is_asked(&self) -> bool {
        let cycles = &self.cycles;
        !self.asked.is_empty() || cycles.iter().any(|cycle| matches!(cycle, Cycle::On(_)))
    }

    pub(super) fn breach(
        &mut self,
        frame: usize,
        register: u8,
        what: FrameSymptom,
        section: &'static str,
        about: String,
    ) {
        if self.judged.breaches.len() < MOST_BREACHES {
            self.judged.breaches.push(Breach {
                what,
                frame,
                drive: self.drive,
                register,
                section,
                about,
            });
        }
    }

    /// Notes a difference as a breach, or as a doubt where `why` names another cause than a wrong drive.
    pub(super) fn differs(
        &mut self,
        frame: usize,
        register: u8,
        what: FrameSymptom,
        section: &'static str,
        about: String,
        why: Option<String>,
    ) {
        match why {
            None => self.breach(frame, register, what, section, about),
            Some(why) => self.judged.doubt(format!(
                "frame {frame}, drive {}: {about}; {why}",
                self.drive
            )),
        }
    }

    /// What the drive may read out of a frame.
    fn hears(&mut self, number: usize, frame: &LineFrame) {
        let id = frame.frame.id().number();
        let rx = u16::try_from(id).unwrap_or(0);
        let Ok(request) = Request::decode(&frame.frame, rx, Dlc4::As3) else {
            return;
        };
        // What an error ended may have been taken before; 4 bytes may be ignored (`dlc4`).
        let heard = self.rx == [rx] && !self.other_rate;
        let sure = frame.ended == FrameEnd::Good && heard && frame.frame.dlc() != 4;
        match request {
            Request::Read { register } => {
                if let Cycle::On(running) = &mut self.cycles[usize::from(register)] {
                    // It may end the cycle (`oneshot-stops`).
                    running.sure = false;
                    running.blur(frame.at);
                }
                let silent = Register::of(register).dump == 0xFACE;
                self.ask(register, frame.at, number, sure && !silent);
            }
            Request::Cycle { register, every } => {
                self.owes(number, register);
                self.starts(register, every, frame.at, sure);
            }
            Request::Stop { register } => {
                self.owes(number, register);
                let cycle = &mut self.cycles[usize::from(register)];
                match (sure, &mut *cycle) {
                    (true, Cycle::Off(_)) => {}
                    (true, _) => *cycle = Cycle::Off(frame.at),
                    (false, Cycle::On(running)) => running.sure = false,
                    (false, _) => {}
                }
            }
            Request::Write { register, data } => self.writes(register, data, frame.at, sure),
        }
    }

    fn ask(&mut self, register: u8, at: Instant, frame: usize, sure: bool) {
        if self.asked.len() >= MOST_ASKED {
            self.asked.pop_front();
        }
        let mut held = self.held[usize::from(shown_in(register))].clone();
        let latest = self.slowest.unwrap_or_default() + self.patience;
        if let Some((since, other)) = self.loose.get(&register)
            && at.since(*since) <= latest
        {
            held = held.or(other);
        }
        self.asked.push_back(PendingRequest {
            register,
            at,
            frame,
            sure,
            excused: false,
            held,
        });
    }

    /// A frame of a cycle or an event has come in place of the reply to this request, which may be under way still.
    pub(super) fn may_come_later(&mut self, asked: &PendingRequest, at: Instant) {
        let held = self.held[usize::from(shown_in(asked.register))].or(&asked.held);
        let later = self.asked.iter_mut();
        for other in later.filter(|other| other.register == asked.register) {
            other.held = other.held.or(&held);
        }
        self.loose.insert(asked.register, (at, held));
    }

    fn starts(&mut self, register: u8, every: u8, at: Instant, sure: bool) {
        let runs = |cycle: &&Cycle| !matches!(cycle, Cycle::Off(_) | Cycle::Unknown);
        let known = self.cycles.iter().filter(runs).count();
        let was_on = matches!(self.cycles[usize::from(register)], Cycle::On(_));
        // A full table refuses, or gives up another cycle (`table-full`).
        let full = !was_on && known >= CYCLES;
        if full {
            for cycle in &mut self.cycles {
                if let Cycle::On(running) = cycle {
                    running.sure = false;
                }
            }
        }
        let silent = Register::of(register).dump == 0xFACE;
        // Cycles from before the first frame may fill the table; each shows itself within 254 ms.
        let begin = self.gap.or(self.begin);
        let old = begin.is_some_and(|begin| at.since(begin) > LONGEST_CYCLE + self.tolerance);
        let unknown =
            self.cycles.contains(&Cycle::Unknown) && !(old && self.unsolicited.is_empty());
        let certain = sure && !full && !silent && !unknown;
        self.cycles[usize::from(register)] = Cycle::On(Running::new(every, at, certain));
    }

    fn writes(&mut self, number: u8, data: Data, at: Instant, sure: bool) {
        let register = Register::of(number);
        let place = usize::from(number);
        if number == 0x51 {
            self.mode_at = at;
        }
        match number {
            0x84 => self.supply.stored(),
            // A load brings every parameter back; the EEPROM is not known.
            0x83 => {
                self.supply.stored();
                for other in REGISTERS.iter().filter(|row| row.access == Access::RW) {
                    self.held[usize::from(other.number)] = Contents::any();
                }
                (self.wide, self.wide_at) = (None, at);
            }
            0x78 => self.homes = Homing::AskedFor,
            0x73 => self.other_rate |= self.held[place].sure() != Some(data.bits() & 0xFFFF),
            0xDC => {
                let wide = data.bits() & 0x0100 != 0;
                self.wide = sure.then_some(wide);
                self.wide_at = at;
            }
            _ => {}
        }
        if !takes_writes(register) {
            return self.refuses(register, data.bits());
        }
        let before = self.held[place].clone();
        // Identifiers out of a range are ignored (`id-range`).
        let takes = sure && !matches!(number, 0x68 | 0x69);
        self.held[place] = before.written(register, data, takes);
        let waiting = self.asked.iter_mut();
        for asked in waiting.filter(|asked| shown_in(asked.register) == number) {
            asked.held = asked.held.or(&self.held[place]);
        }
        self.supply
            .wrote(number, before.sure().filter(|_| takes), at);
        if number == 0x51 && data.bits() & u32::from(MODE_LOCK) != 0 {
            if sure {
                self.homes = Homing::Ended;
            }
            // `lock-clears-command`.
            for command in [0x31, 0x90] {
                self.held[command] = self.held[command].may_be(0);
            }
        }
        self.may_use(number, data.bits());
    }

    /// A register of identifiers holds this: the drive may use it at once, or from its next start on (`id-change`, `second-identifiers`).
    pub(super) fn may_use(&mut self, register: u8, raw: u32) {
        let all = match register {
            0x68 => &mut self.rx,
            0x69 => &mut self.tx,
            0x88 => &mut self.second[0],
            0x89 => &mut self.second[1],
            _ => return,
        };
        if let Ok(id @ 1..=0x7FF) = u16::try_from(raw & 0xFFFF)
            && !all.contains(&id)
        {
            all.push(id);
        }
    }

    /// A write to a register that cannot be written. A value that it may have by chance shows nothing.
    fn refuses(&mut self, register: &Register, raw: u32) {
        let raw = raw & register.mask();
        let held = self.held[usize::from(register.number)].sure();
        let telling = held.is_some_and(|held| held != raw) && raw > 1;
        let never = matches!(register.access, Access::RO | Access::UK);
        if telling && never && !is_live(register.number) {
            self.refused.insert(register.number, raw);
        }
    }

    /// Frames that have been due for long.
    fn missing(&mut self, number: usize, now: Instant) {
        if self.other_rate {
            return;
        }
        let slowest = match self.timed {
            true => self.slowest,
            false => Some(self.slowest.unwrap_or_default()),
        };
        let patience = slowest.map(|slowest| slowest + slowest + self.patience);
        while let (Some(first), Some(patience)) = (self.asked.front().cloned(), patience)
            && now.since(first.at) > patience
        {
            self.asked.pop_front();
            self.unanswered(&first);
        }
        for register in 0..=u8::MAX {
            if let Cycle::On(running) = &mut self.cycles[usize::from(register)]
                && running.is_missing(now, self.patience)
            {
                running.sure = false;
                running.blur(now);
                match running.owed {
                    0 => {
                        let about = running.not_there(register);
                        self.breach(number, register, Missing, "ex 9", about);
                    }
                    _ => self.owes(number, register),
                }
            }
        }
    }

    fn sends(&mut self, number: usize, frame: &LineFrame) {
        self.judged.replies += 1;
        let tx = u16::try_from(frame.frame.id().number()).unwrap_or(0);
        let first = frame.frame.data().first().copied().unwrap_or(0);
        let may_use = self.tx.contains(&tx) || self.second[1].contains(&tx);
        if !may_use || frame.frame.id().is_extended() {
            self.judged.compared += 1;
            return self.named_otherwise(number, frame, first);
        }
        self.named = true;
        let reply = match Reply::decode(&frame.frame, tx) {
            Ok(reply) => reply,
            Err(_) if self.timed && !self.is_asked() => {
                return self.judged.doubt(format!(
                    "frame {number}, {}: nothing asks drive {} for a frame, and another station may have sent this one with its identifier",
                    written(&frame.frame),
                    self.drive
                ));
            }
            Err(why) => {
                self.judged.compared += 1;
                let about = format!("{} is no reply: {why}", written(&frame.frame));
                return self.breach(number, first, Length, "4.5", about);
            }
        };
        self.judged.compared += 1;
        let asked = self.why(number, frame, &reply);
        self.length(number, frame.start, &reply);
        self.value(number, &reply, asked.as_ref());
    }

    /// A frame of the drive has another identifier. It may have been set before the first frame (ex 1), or in a gap of the log.
    fn named_otherwise(&mut self, number: usize, frame: &LineFrame, register: u8) {
        let id = identifier(frame.frame.id());
        let about = format!("it has identifier {id}, and {:03X} is expected", self.tx[0]);
        let sure = self.named || !self.timed || frame.frame.id().is_extended();
        let why = (!sure).then(|| {
            format!(
                "it may have been set where the log has no frames, as a setup with `drive {} tx {id}` says",
                self.drive
            )
        });
        self.differs(number, register, Name, "3.1", about, why);
        self.may_use(0x69, frame.frame.id().number());
    }
}

/// The register whose contents a reply is judged by: MODE for STATUS.
const fn shown_in(register: u8) -> u8 {
    match register {
        0x40 => 0x51,
        register => register,
    }
}

/// Whether a frame has one of these identifiers.
fn among(all: &[u16], frame: &Frame) -> bool {
    let id = frame.id();
    !id.is_extended() && all.iter().any(|known| u32::from(*known) == id.number())
}
