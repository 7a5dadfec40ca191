//! Probes that settle what the manual leaves open, before a scenario may accuse a drive.
//!
//! They need no permission: reads, cycles, STATUS_MASK (52) and the lock. What they do not settle stays open, and a scenario that depends
//! on it accuses no drive.

use super::known::{FIRMWARE, KnownDrives};
use super::observed::Observed;
use crate::driver::{Driver, Error};
use harness_bench::link::{Line, Link as _};
use harness_bench::medium::{HeardPiece, Out};
use harness_proto::can::{self, BitRate, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{Data, Reply};
use harness_proto::unitek::guard::Limits;
use harness_proto::unitek::properties::MapReply;
use harness_proto::unitek::words::{ERROR_TIME_OUT, MODE_EVENT, MODE_LOCK, status};
use harness_proto::unitek::{Register, Width};

/// A register to which nothing is assigned (dump).
const UNASSIGNED: u8 = 0x81;
const STATUS: u8 = 0x40;
const MODE: u8 = 0x51;
const MASK: u8 = 0x52;
/// The commands of speed and of torque.
const SPEED: u8 = 0x31;
const TORQUE: u8 = 0x90;
/// Bit 8 of its contents makes every reply 6 bytes long (App 3).
const WIDTH: u8 = 0xDC;
const WIDE: u32 = 0x0100;

/// The second pair of identifiers.
const SECOND: u8 = 0x88;

/// The interval of a probe's cycle, in ms.
const EVERY: u8 = 100;
const CYCLE: Span = Span::from_millis(100);
const HALF: Span = Span::from_millis(50);

/// By how much a frame may be off its time.
const SLACK: Span = Span::from_millis(30);

/// Nine registers, one more than there are cycles (App 8).
const NINE: [u8; 9] = [0x1B, 0x30, 0x31, 0x90, 0x51, 0x52, 0x6D, 0x6E, 0x11];

/// The time-out of the bus, one that is tried, in ms, and the function that clears errors.
const TIME_OUT: u8 = 0xD0;
const TIMED_OUT_AFTER: u16 = 40;
const ERROR_MAP: u8 = 0x8F;
const CANCEL: u8 = 0x8E;

/// The function that starts homing.
const HOMING: u8 = 0x78;

/// How long homing is waited for.
const LONGEST_HOMING: Span = Span::from_millis(10_000);

/// The registers that probes write and set back; the first one without any permission.
pub(super) const WRITTEN: [u8; 4] = [MASK, WIDTH, SECOND, TIME_OUT];

/// How often a probe is made that a busy computer has disturbed.
const TRIES: usize = 3;

/// Settles what can be settled of a drive. It is locked afterwards.
///
/// # Errors
/// The link is in trouble, or the drive does not answer.
pub(super) fn settle(
    known: &mut KnownDrives,
    link: &mut Observed<'_>,
    patience: Span,
) -> Result<(), Error> {
    let mut probe = Probe {
        known,
        link,
        patience,
    };
    probe.by_replies()?;
    let lock = Data::Short(MODE_LOCK);
    probe.write(MODE, lock)?;
    probe.events()?;
    probe.widths()?;
    probe.cycles()?;
    probe.table()?;
    let counted = probe.read(0x95)?;
    let counts = probe.known.cell(0x95) != counted.data.bits();
    let word = if counts { "live" } else { "frozen" };
    probe.known.settle("can-counters", word);
    // A reply on an idle bus takes less.
    let delay = probe.link.noted.shortest;
    probe.known.reply_delay = delay.filter(|delay| *delay > Span::from_micros(500));
    Ok(())
}

/// Settles what shows only within limits: where bus settings may be changed, which are as before afterwards and not stored, and where the
/// motor of a drive may turn. It is locked afterwards. No drive of the rig uses the identifier `free`.
///
/// # Errors
/// As [`settle`].
pub(super) fn settle_within(
    known: &mut KnownDrives,
    link: &mut Observed<'_>,
    patience: Span,
    rate: BitRate,
    limits: &Limits,
    free: u16,
) -> Result<(), Error> {
    let mut probe = Probe {
        known,
        link,
        patience,
    };
    if limits.bus_settings {
        probe.wide()?;
        probe.second(free)?;
    }
    if limits.motion {
        probe.homing(rate)?;
        probe.write(MODE, Data::Short(MODE_LOCK))?;
    }
    if limits.motion && limits.bus_settings {
        probe.time_out()?;
        probe.write(MODE, Data::Short(MODE_LOCK))?;
    }
    Ok(())
}

/// The value of `interval-accuracy` that the frames of a cycle show, where time is exact. One frame that is a scan late makes the interval
/// after it shorter; a drive that is late at each frame keeps no value, and is judged as an exact one.
fn accuracy(frames: &[Instant]) -> Option<&'static str> {
    let quarter = Span::from_micros(250);
    let is = |gap: Span, expected: Span| gap < expected + quarter && gap + quarter > expected;
    let on_the_mean = |three: &[Instant]| is(three[2].since(three[0]), CYCLE + CYCLE);
    let mut gaps = frames.windows(2).map(|pair| pair[1].since(pair[0]));
    let all_exact = gaps.all(|gap| is(gap, CYCLE));
    match frames.len() {
        0..3 => None,
        _ if all_exact => Some("exact"),
        _ if frames.windows(3).all(on_the_mean) => Some("one-scan"),
        _ => Some("exact"),
    }
}

/// Whether a register of 16 bits has a sign, and holds a negative value.
fn is_negative(register: u8, bits: u32) -> bool {
    let register = Register::of(register);
    register.width == Width::Bits16 && register.signed && bits & 0x8000 != 0
}

struct Probe<'p, 'l> {
    known: &'p mut KnownDrives,
    link: &'p mut Observed<'l>,
    patience: Span,
}

impl Probe<'_, '_> {
    fn driver(&mut self) -> Driver<'_> {
        let tolerance = self.link.time_tolerance();
        Driver::new(Box::new(&mut *self.link), &[self.known.axis], self.patience)
            .outlasting(tolerance)
    }

    fn read(&mut self, register: u8) -> Result<Reply, Error> {
        let axis = self.known.axis;
        self.driver().read(axis, register)
    }

    /// Writes a register. What it reads afterwards is not judged here.
    fn write(&mut self, register: u8, data: Data) -> Result<(), Error> {
        let axis = self.known.axis;
        match self.driver().write(axis, register, data) {
            Ok(_) | Err(Error::Differs { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// Writes what a register held before, again where a frame was lost. A drive that never takes it is reported at the end of the attempt.
    fn set_back(&mut self, register: u8, data: Data) -> Result<(), Error> {
        let axis = self.known.axis;
        for _ in 0..TRIES {
            match self.driver().write(axis, register, data) {
                Err(Error::Differs { .. }) => {}
                other => return other.map(|_| ()),
            }
        }
        Ok(())
    }

    /// Sends data bytes as they are. Returns when the frame has left.
    fn send(&mut self, data: &[u8]) -> Result<Instant, Error> {
        self.send_on(self.known.axis.rx, data)
    }

    /// Sends data on an identifier, and returns when it was sent.
    fn send_on(&mut self, rx: u16, data: &[u8]) -> Result<Instant, Error> {
        let Ok(frame) = Frame::base(rx, data) else {
            return Ok(self.link.now());
        };
        let end = self.link.send(0, Out::Frames(&[frame]));
        self.sound().map(|()| end)
    }

    fn sound(&self) -> Result<(), Error> {
        self.link
            .trouble()
            .map_or(Ok(()), |trouble| Err(Error::Link(trouble.clone())))
    }

    /// The frames of the drive that come up to a time.
    fn listen(&mut self, until: Instant) -> Result<Vec<(Instant, Reply)>, Error> {
        let mut heard = Vec::new();
        loop {
            while let Some((at, piece)) = self.link.receive(0) {
                if let HeardPiece::Frame(can::CanEvent::Frame(frame)) = piece
                    && let Ok(reply) = Reply::decode(&frame, self.known.axis.tx)
                {
                    heard.push((at, reply));
                }
            }
            self.sound()?;
            if self.link.now() >= until {
                return Ok(heard);
            }
            let _more = self.link.wait(until);
        }
    }

    /// What the replies to plain reads show: widths, stuff bytes, and bits of STATUS.
    fn by_replies(&mut self) -> Result<(), Error> {
        let mut stuffs = self.known.replies.values().map(|reply| reply.stuff);
        if let Some(first) = stuffs.next()
            && stuffs.all(|stuff| stuff == first)
        {
            let word = format!("{first:02X}");
            self.known.settle("stuff", &word);
        }
        let status_reply = self.known.replies.get(&STATUS).copied();
        if let Some(reply) = status_reply {
            if !self.known.is_wide() {
                let long = matches!(reply.data, Data::Long(_));
                let word = if long { "native" } else { "short" };
                self.known.settle("map-reply", word);
            }
            let bits = reply.data.bits();
            let stands = self.known.cell(0xF5) == 1;
            if bits & (status::STANDING | status::READY) != 0 {
                self.known.settle("status-bits", "full");
            } else if stands {
                self.known.settle("status-bits", "printed");
            }
        }
        if self.waits_for_a_lock() {
            self.known.settle("enable-after-lock", "yes");
        }
        if self.known.is_wide() {
            let replies: Vec<_> = self.known.replies.values().copied().collect();
            replies.iter().for_each(|reply| self.extended(reply));
        }
        let word = match self.read(UNASSIGNED) {
            Ok(_) => "face",
            Err(Error::NoReply { .. }) => "silent",
            Err(error) => return Err(error),
        };
        self.known.settle("unknown-register", word);
        Ok(())
    }

    /// Whether the drive is not enabled although it is ready, both of its inputs are closed and it is not locked.
    fn waits_for_a_lock(&self) -> bool {
        let on = |register, bit: u32| self.known.cell(register) >> bit & 1 == 1;
        let closed = on(0xE8, 0) && on(0xD8, 5) && on(0xE2, 0);
        let enabled = self.known.cell(STATUS) & status::ENABLED != 0;
        let known = [0xE8, 0xD8, 0xE2, MODE, STATUS]
            .iter()
            .all(|register| self.known.cells.contains_key(register));
        known && closed && self.known.cell(MODE) & u32::from(MODE_LOCK) == 0 && !enabled
    }

    /// What is sent by event: a locked drive shows it, since a torque command of 0 clears bit 8 of STATUS and a speed command of 0 sets it.
    fn events(&mut self) -> Result<(), Error> {
        const BOTH: Data = Data::Short(MODE_LOCK | MODE_EVENT);
        let zero = Data::Short(0);
        let mask = self.known.cell(MASK);
        self.write(SPEED, zero)?;
        self.write(MASK, Data::Long(status::SPEED))?;
        let set_up = self.status_by(MODE, BOTH)?;
        let (mut falls, mut rises) = (None, None);
        // An adapter may lose a frame.
        let rounds = match self.link.time_tolerance() {
            Span::ZERO => 1,
            _ => TRIES,
        };
        for _ in 0..rounds {
            falls = self.status_by(TORQUE, zero)?.or(falls);
            rises = self.status_by(SPEED, zero)?.or(rises);
            if falls.is_some() == rises.is_some() {
                break;
            }
        }
        self.write(MODE, Data::Short(MODE_LOCK))?;
        self.set_back(MASK, Data::Long(mask))?;
        let edges = match (rises.is_some(), falls.is_some()) {
            (true, true) => "both",
            (true, false) => "rising",
            (false, true) => "falling",
            // It may send nothing by event at all.
            (false, false) => return Ok(()),
        };
        self.known.settle("event-edges", edges);
        let word = if set_up.is_some() { "at-once" } else { "none" };
        self.known.settle("event-at-set-up", word);
        let narrow = self.known.settled.contains("map-reply")
            && self.known.properties.map_reply == MapReply::Short;
        match rises.or(falls) {
            Some(Data::Short(_)) => self.known.settle("event-reply", "as-map-reply"),
            // With 32 bits in replies, both values give the same frame.
            Some(Data::Long(_)) if narrow => self.known.settle("event-reply", "native"),
            _ => {}
        }
        Ok(())
    }

    /// STATUS, if it is sent while a register is written. The write is not read back, so that no reply stands between.
    fn status_by(&mut self, register: u8, data: Data) -> Result<Option<Data>, Error> {
        let [low, high, ..] = data.bits().to_le_bytes();
        let sent = self.send(&[register, low, high])?;
        let heard = self.listen(sent + self.patience.max(SLACK))?;
        let status = heard.iter().find(|(_, reply)| reply.register == STATUS);
        Ok(status.map(|(_, reply)| reply.data))
    }

    /// Frames of 4 bytes, and 16 bits to a register of 32. STATUS_MASK decides nothing while the drive sends no events.
    fn widths(&mut self) -> Result<(), Error> {
        const WHOLE: u32 = 0x1122_3344;
        let mask = self.known.cell(MASK);
        self.write(MASK, Data::Long(WHOLE))?;
        self.send(&[MASK, 0x66, 0x55])?;
        let short = self.read(MASK)?.data.bits();
        self.write(MASK, Data::Long(WHOLE))?;
        self.send(&[MASK, 0x66, 0x55, 0x77])?;
        let four = self.read(MASK)?.data.bits();
        self.set_back(MASK, Data::Long(mask))?;
        match short {
            0x0000_5566 => self.known.settle("short-write", "extend"),
            0x1122_5566 => self.known.settle("short-write", "keep-high"),
            _ => {}
        }
        match four {
            WHOLE => self.known.settle("dlc4", "ignore"),
            other if other == short => self.known.settle("dlc4", "as3"),
            _ => {}
        }
        Ok(())
    }

    /// How a reply of 6 bytes extends 16 bits: a negative value of a register with a sign shows it.
    fn extended(&mut self, reply: &Reply) {
        let bits = reply.data.bits();
        match (is_negative(reply.register, bits), reply.data, bits >> 16) {
            (true, Data::Long(_), 0xFFFF) => self.known.settle("wide-replies", "sign"),
            (true, Data::Long(_), 0) => self.known.settle("wide-replies", "zero"),
            _ => {}
        }
    }

    /// Settles `wide-replies` where replies have 4 bytes: bit 8 of DC is set for one reply of 6.
    fn wide(&mut self) -> Result<(), Error> {
        let cells = self.known.cells.iter();
        let negative = cells.map(|(register, raw)| (*register, *raw));
        let negative = negative.clone().find(|(row, raw)| is_negative(*row, *raw));
        let (false, Some((register, _))) = (self.known.is_wide(), negative) else {
            return Ok(());
        };
        let width = self.known.cell(WIDTH);
        let written = |raw: u32| Data::Short((raw & 0xFFFF) as u16);
        self.write(WIDTH, written(width | WIDE))?;
        let reply = self.read(register);
        self.set_back(WIDTH, written(width))?;
        self.extended(&reply?);
        Ok(())
    }

    /// Whether the second identifiers are used at once. A drive that does not answer there may use them from its next start on.
    fn second(&mut self, free: u16) -> Result<(), Error> {
        let before = self.known.cell(SECOND);
        self.write(SECOND, Data::Long(free.into()))?;
        let sent = self.send_on(free, &[0x3D, FIRMWARE, 0])?;
        let heard = self.listen(sent + self.patience.max(SLACK))?;
        self.set_back(SECOND, Data::Long(before))?;
        if heard.iter().any(|(_, reply)| reply.register == FIRMWARE) {
            self.known.settle("second-identifiers", "immediate");
        }
        Ok(())
    }

    /// When the first frame of a cycle comes, and what a single request does to the cycle.
    fn cycles(&mut self) -> Result<(), Error> {
        let register = NINE[0];
        for _ in 0..TRIES {
            self.link.take_late();
            let sent = self.send(&[0x3D, register, EVERY])?;
            let first = self.listen(sent + CYCLE * 3 + HALF)?;
            self.send(&[0x3D, register, 0])?;
            let now = self.link.now();
            let then = self.listen(now + CYCLE * 2)?;
            self.send(&[0x3D, register, 0xFF])?;
            let now = self.link.now();
            self.listen(now + SLACK)?;
            if self.link.take_late() > SLACK {
                continue;
            }
            let times = |all: &[(Instant, Reply)]| -> Vec<Instant> {
                let replies = all.iter().filter(|(_, reply)| reply.register == register);
                replies.map(|(at, _)| *at).collect()
            };
            if let [one, two, ..] = times(&first)[..] {
                let (wait, gap) = (one.since(sent), two.since(one));
                let regular = gap + SLACK > CYCLE && gap < CYCLE + SLACK;
                let exact = self.link.time_tolerance() == Span::ZERO;
                if let (true, Some(word)) = (exact && regular, accuracy(&times(&first))) {
                    self.known.settle("interval-accuracy", word);
                }
                if regular && wait < HALF {
                    self.known.settle("cyclic-first", "at-once");
                } else if regular && wait + SLACK > CYCLE {
                    self.known.settle("cyclic-first", "after");
                }
            }
            match times(&then).len() {
                0 => {}
                1 => self.known.settle("oneshot-stops", "yes"),
                _ => self.known.settle("oneshot-stops", "no"),
            }
            return Ok(());
        }
        Ok(())
    }

    /// How long homing takes (ex 12): until a calibrated axis is in tolerance.
    fn homing(&mut self, rate: BitRate) -> Result<(), Error> {
        self.write(MODE, Data::Short(0))?;
        let bits = self.read(STATUS)?.data.bits();
        if bits & status::ENABLED == 0 || bits & status::TOLERANCE != 0 {
            return Ok(());
        }
        self.send(&[0x3D, STATUS, 1])?;
        let began = self.send(&[HOMING, 1, 0])?;
        let end = began + LONGEST_HOMING;
        let mut done = None;
        while done.is_none() && self.link.now() < end {
            let now = self.link.now();
            let heard = self.listen((now + HALF).min(end))?;
            done = heard.into_iter().find(|(at, reply)| {
                let there = reply.data.bits() & status::TOLERANCE != 0;
                *at > began && reply.register == STATUS && there
            });
        }
        self.send(&[0x3D, STATUS, 0xFF])?;
        let now = self.link.now();
        self.listen(now + SLACK)?;
        let Some((at, reply)) = done else {
            return Ok(());
        };
        let frame = reply.encode(self.known.axis.tx);
        let length = frame.map_or(Span::ZERO, |frame| rate.time_of(frame.wire_bits()));
        // The drive begins with the next millisecond of its clock, and sends at the end of one.
        let took = (at.since(began).saturating_sub(length)).as_nanos();
        let took = Span::from_millis(took.div_ceil(1_000_000));
        self.known
            .measure_homing(took, self.link.time_tolerance() == Span::ZERO);
        Ok(())
    }

    /// What clears a time-out of the bus, and whether the drive is enabled again after it.
    ///
    /// # Errors
    /// Nothing clears it: no value of an open point explains that.
    fn time_out(&mut self) -> Result<(), Error> {
        let read = |probe: &mut Self, register, mask| {
            let reply = probe.read(register)?;
            Ok(reply.data.bits() & mask != 0)
        };
        let timed_out = |probe: &mut Self| read(probe, ERROR_MAP, ERROR_TIME_OUT);
        let enabled = |probe: &mut Self| read(probe, STATUS, status::ENABLED);
        let before = self.known.cell(TIME_OUT);
        if timed_out(self)? {
            return Ok(());
        }
        self.write(MODE, Data::Short(0))?;
        let was_enabled = enabled(self)?;
        self.write(TIME_OUT, Data::Short(TIMED_OUT_AFTER))?;
        let now = self.link.now();
        self.listen(now + CYCLE)?;
        let found = timed_out(self)?;
        self.set_back(TIME_OUT, Data::Short((before & 0xFFFF) as u16))?;
        if !found {
            return Ok(());
        }
        self.write(CANCEL, Data::Short(0))?;
        let stays = timed_out(self)?;
        let again = enabled(self)?;
        self.write(MODE, Data::Short(MODE_LOCK))?;
        self.write(MODE, Data::Short(0))?;
        match (stays, timed_out(self)?) {
            (false, _) => self.known.settle("time-out-clear", "cancel"),
            (true, false) => self.known.settle("time-out-clear", "lock"),
            (true, true) => {
                let node = self.known.axis.node;
                return Err(Error::TimeOutStays { node });
            }
        }
        // One that its lock has cleared was locked and released by that.
        if !stays && was_enabled && enabled(self)? {
            let word = if again { "no" } else { "yes" };
            self.known.settle("enable-after-lock", word);
        }
        Ok(())
    }

    /// What becomes of a ninth cycle.
    fn table(&mut self) -> Result<(), Error> {
        for register in NINE {
            self.send(&[0x3D, register, EVERY])?;
        }
        let now = self.link.now();
        // Behind the first frames, which may come at once.
        self.listen(now + HALF)?;
        let heard = self.listen(now + CYCLE * 2 + HALF)?;
        for register in NINE {
            self.send(&[0x3D, register, 0xFF])?;
        }
        let now = self.link.now();
        self.listen(now + SLACK)?;
        let there = |register| heard.iter().any(|(_, reply)| reply.register == register);
        let [first, .., ninth] = NINE;
        let others = NINE[1..8].iter().all(|register| there(*register));
        match (there(first), there(ninth)) {
            (true, false) if others => self.known.settle("table-full", "refuse"),
            (false, true) if others => self.known.settle("table-full", "oldest"),
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mean that is wrong is no value of the property: such a drive is not taken for one that is a scan late now and then.
    #[test]
    fn intervals_that_are_too_long_are_not_one_scan() {
        let at = |all: &[u64]| -> Vec<Instant> {
            let all = all.iter();
            all.map(|ms| Instant::START + Span::from_millis(*ms))
                .collect()
        };
        for (frames, word) in [
            (&[100, 200][..], None),
            (&[100, 200, 300], Some("exact")),
            (&[100, 201, 300], Some("one-scan")),
            (&[101, 200, 301], Some("one-scan")),
            (&[101, 202, 303], Some("exact")),
            (&[99, 198, 297], Some("exact")),
        ] {
            assert_eq!(accuracy(&at(frames)), word, "{frames:?}");
        }
    }
}
