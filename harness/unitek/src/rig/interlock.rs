//! Interlocks on registers of UNITEK drives: what must hold of drives while a rig is used.
//!
//! A register is asked for in the pauses of a conversation. Nothing tells its reply from a frame that the drive sends by itself (5.2):
//! while a register has a cycle, or STATUS is sent by event, those frames are compared, and the register is not asked for.

use super::Axis;
use crate::value::{bits, register};
use harness_bench::guard::Watch;
use harness_bench::link::{Line, Trouble};
use harness_bench::medium::{HeardPiece, Out};
use harness_bench::rig::Rig;
use harness_bench::rig::condition::{Mistake, PortCondition};
use harness_bench::rig::file::Interlock;
use harness_proto::can;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::{Data, Reply, Request};
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::units::{Given, Scaling, shown, usual, value};
use std::cmp::Ordering;

/// MODE, its bit for sending STATUS by event, and STATUS (5.2-3).
const MODE: u8 = 0x51;
const BY_EVENT: u16 = 1 << 4;
const STATUS: u8 = 0x40;

/// Registers whose change leaves the scale of every other one: commands, MODE, MODE's mask and READ.
const NO_SCALE: [u8; 6] = [0x31, 0x90, 0x6E, MODE, 0x52, 0x3D];

/// How often a drive that must answer is asked: one frame may be lost.
const TRIES: u8 = 3;

/// A bound: a number, and its unit where the register has one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RegisterBound(f64, Option<Given>);

impl PartialOrd for RegisterBound {
    /// Numbers of different units are not compared: that needs the drive's scale.
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        let same = self.1 == other.1;
        same.then(|| self.0.partial_cmp(&other.0)).flatten()
    }
}

/// Checks an entry of a rig's file.
///
/// # Errors
/// What is wrong with it.
pub(super) fn checked(interlock: &Interlock) -> Result<(), Mistake> {
    read(interlock).map(|_| ())
}

fn read(
    interlock: &Interlock,
) -> Result<(&'static Register, PortCondition<RegisterBound>), Mistake> {
    let name = interlock.register.as_deref().unwrap_or_default();
    let expected = "a register of `drivebench cells --bus unitek` expected here";
    let register = register(name).map_err(|message| ("register", message, expected.to_owned()))?;
    let bits = bits(register.unit).iter();
    let bits: Vec<_> = bits.map(|bit| (bit.number, bit.name)).collect();
    let condition = interlock.condition_of("register", &bits, |text| bound(text, register))?;
    Ok((register, condition))
}

/// Reads a bound: a number with a unit of the register, or a whole number where it has none.
fn bound(text: &str, register: &Register) -> Result<RegisterBound, (String, String)> {
    let end = text.trim_end_matches(|c: char| c.is_ascii_alphabetic() || c == '%');
    let (number, unit) = (end.trim(), &text[end.len()..]);
    let given = Given::from_name(unit);
    let scales = |given| value(register, 0, given, Scaling::default()).is_some();
    let (fits, expected) = match usual(register.unit) {
        Some(usual) => (
            given.is_some_and(scales),
            format!(
                "a number with its unit, such as 10{}, expected here",
                usual.name()
            ),
        ),
        None => (
            unit.is_empty() && number.parse::<i64>().is_ok(),
            "the register has no unit: a whole number in quotes expected here".to_owned(),
        ),
    };
    let parsed = number
        .parse()
        .ok()
        .filter(|parsed: &f64| parsed.is_finite());
    match parsed.filter(|_| fits) {
        Some(parsed) => Ok(RegisterBound(parsed, given)),
        None => Err((
            format!("`{text}` is no bound of {}", register.name),
            expected,
        )),
    }
}

#[derive(Debug)]
pub(super) struct RegisterInterlocks {
    all: Vec<RegisterInterlock>,
    patience: Span,
    /// What came during a look and is for the conversation.
    unasked: Vec<(Instant, HeardPiece)>,
}

#[derive(Debug)]
struct RegisterInterlock {
    axis: Axis,
    register: &'static Register,
    condition: PortCondition<RegisterBound>,
    entry: Interlock,
    every: Span,
    /// On a clock that is never set back.
    next: Instant,
    /// Read from the drive when it is needed, and again after what may have changed it.
    scaling: Option<Scaling>,
    /// The drive sends the register by itself, as the conversation has asked it to.
    sends_itself: bool,
}

enum Look {
    Holds,
    Broken(String),
    Silent,
}

impl RegisterInterlocks {
    /// The interlocks of a rig with these drives; `None` where it has none.
    pub(super) fn of(rig: &Rig, axes: &[Axis], patience: Span) -> Option<Self> {
        let of_entry = |entry: &Interlock| {
            // The file was checked.
            let (register, condition) = read(entry).ok()?;
            let axis = axes.iter().find(|axis| axis.node == entry.drive)?;
            Some(RegisterInterlock {
                axis: *axis,
                register,
                condition,
                entry: entry.clone(),
                every: entry.every.span(),
                next: Instant::START,
                scaling: None,
                sends_itself: false,
            })
        };
        let all: Vec<_> = rig.file.interlock.iter().filter_map(of_entry).collect();
        (!all.is_empty()).then_some(Self {
            all,
            patience,
            unasked: Vec::new(),
        })
    }
}

impl Watch for RegisterInterlocks {
    fn due(&self) -> Option<Instant> {
        let asked = self.all.iter();
        let asked = asked.filter(|asked| !asked.sends_itself || asked.lacks_scale());
        asked.map(|asked| asked.next).min()
    }

    fn look(&mut self, now: Instant, line: &mut dyn Line) -> Result<(), String> {
        for interlock in self.all.iter_mut().filter(|due| due.next <= now) {
            interlock.next = now + interlock.every;
            let mut asks = RegisterReader {
                line,
                patience: self.patience,
                tries: 1,
                unasked: &mut self.unasked,
            };
            // In the middle of a scenario a drive may be silent on purpose; between scenarios it must answer.
            if let Look::Broken(why) = interlock.look(&mut asks) {
                return Err(why);
            }
        }
        Ok(())
    }

    fn look_at_all(&mut self, line: &mut dyn Line) -> Result<(), Trouble> {
        for interlock in &mut self.all {
            // Nothing is under way: the way to the safe state has ended what the conversation before had begun.
            (interlock.scaling, interlock.sends_itself) = (None, false);
            let mut asks = RegisterReader {
                line,
                patience: self.patience,
                tries: TRIES,
                unasked: &mut self.unasked,
            };
            match interlock.look(&mut asks) {
                Look::Holds => {}
                Look::Broken(why) => return Err(Trouble::Interlock(why)),
                Look::Silent => {
                    let why = format!(
                        "{} cannot be read: the drive does not answer",
                        interlock.entry.words(interlock.register.name)
                    );
                    return Err(Trouble::Lost(why));
                }
            }
        }
        Ok(())
    }

    fn sent(&mut self, what: Out<'_>) {
        for frame in what.frames() {
            for interlock in &mut self.all {
                if let Ok(request) = Request::decode(frame, interlock.axis.rx, Dlc4::As3) {
                    interlock.follow(request);
                }
            }
        }
    }

    fn hear(&mut self, heard: &HeardPiece) -> Result<(), String> {
        let all = self.all.iter();
        for interlock in all.filter(|cyclic| cyclic.sends_itself && !cyclic.lacks_scale()) {
            if let Some(reply) = interlock.reply(heard, interlock.register.number)
                && let Some(why) = interlock.broken(reply)
            {
                return Err(why);
            }
        }
        Ok(())
    }

    fn take_unasked(&mut self) -> Vec<(Instant, HeardPiece)> {
        std::mem::take(&mut self.unasked)
    }
}

impl RegisterInterlock {
    /// Notes what a request of the conversation changes.
    fn follow(&mut self, request: Request) {
        let number = self.register.number;
        match request {
            Request::Cycle { register, .. } if register == number => self.sends_itself = true,
            Request::Stop { register } if register == number => self.sends_itself = false,
            Request::Write { register, data } if register == MODE && number == STATUS => {
                self.sends_itself = low(data) & BY_EVENT != 0;
            }
            Request::Write { register, .. } if !NO_SCALE.contains(&register) => self.scaling = None,
            _ => {}
        }
    }

    /// Whether the scale of the register has to be read.
    fn lacks_scale(&self) -> bool {
        self.scaling.is_none() && usual(self.register.unit).is_some()
    }

    fn look(&mut self, asks: &mut RegisterReader<'_, '_>) -> Look {
        if self.lacks_scale() {
            let read = [0xCE, 0xC6, 0xD9].map(|number| asks.ask(self, number));
            let [Some(rpm_max), Some(device_current), Some(units_at_200)] =
                read.map(|answer| answer.map(|reply| low(reply.data)))
            else {
                return Look::Silent;
            };
            self.scaling = Some(Scaling {
                rpm_max,
                device_current,
                units_at_200,
            });
        }
        if self.sends_itself {
            return Look::Holds;
        }
        match asks.ask(self, self.register.number) {
            None => Look::Silent,
            Some(reply) => self.broken(reply).map_or(Look::Holds, Look::Broken),
        }
    }

    /// What a piece says of a register of this drive.
    fn reply(&self, heard: &HeardPiece, register: u8) -> Option<Reply> {
        let HeardPiece::Frame(can::CanEvent::Frame(frame)) = heard else {
            return None;
        };
        let reply = Reply::decode(frame, self.axis.tx).ok()?;
        (reply.register == register).then_some(reply)
    }

    fn broken(&self, reply: Reply) -> Option<String> {
        let raw = (reply.number() & i64::from(u32::MAX)) as u32;
        let scaling = self.scaling.unwrap_or_default();
        let number = |given: Option<Given>| match given {
            Some(given) => value(self.register, raw, given, scaling),
            None => Some(self.register.number_of(raw) as f64),
        };
        let unit = match self.condition {
            PortCondition::Within(min, max) => min.or(max).and_then(|bound| bound.1),
            PortCondition::Bit(..) => None,
        };
        let read = unit.and_then(|unit| shown(self.register, raw, unit, scaling));
        let read = match (read, self.condition) {
            (Some(read), _) => read.to_string(),
            (None, PortCondition::Bit(..)) => format!("{raw:X}"),
            (None, PortCondition::Within(..)) => self.register.number_of(raw).to_string(),
        };
        let why = self.entry.broken(&self.condition, raw, &read, |min, max| {
            // What has no meaning is within no bounds.
            min.is_none_or(|bound| number(bound.1).is_some_and(|is| is >= bound.0))
                && max.is_none_or(|bound| number(bound.1).is_some_and(|is| is <= bound.0))
        })?;
        Some(format!("{}: {why}", self.entry.words(self.register.name)))
    }
}

/// Asks drives over a line.
struct RegisterReader<'a, 'l> {
    line: &'a mut (dyn Line + 'l),
    patience: Span,
    tries: u8,
    unasked: &'a mut Vec<(Instant, HeardPiece)>,
}

impl RegisterReader<'_, '_> {
    /// Reads a register; `None` where no reply comes.
    fn ask(&mut self, interlock: &RegisterInterlock, register: u8) -> Option<Reply> {
        let frame = Request::Read { register }.encode(interlock.axis.rx).ok()?;
        (0..self.tries).find_map(|_| {
            let sent = self.line.send(0, Out::Frames(&[frame]));
            let until = sent + self.patience;
            while self.line.trouble().is_none() {
                while let Some((at, heard)) = self.line.receive(0) {
                    match interlock.reply(&heard, register) {
                        Some(reply) => return Some(reply),
                        None => self.unasked.push((at, heard)),
                    }
                }
                if self.line.now() >= until {
                    break;
                }
                let _more = self.line.wait(until);
            }
            None
        })
    }
}

/// The lower 16 bits.
const fn low(data: Data) -> u16 {
    (data.bits() & 0xFFFF) as u16
}
