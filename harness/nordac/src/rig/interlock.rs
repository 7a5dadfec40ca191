//! Interlocks on words and parameters of NORDAC inverters: what must hold of inverters while a rig is used.
//!
//! The words of a reply (ZSW, HIW, PZD4) are compared in every exchange that passes. A parameter takes a task of the parameter channel,
//! which is the master's own: it is read before each attempt at a scenario and each command, and by the [driver](super::super::driver)
//! while time passes in a command. A scenario sends its telegrams itself, so it is not interrupted.

use super::known::KnownInverters;
use super::talk::Talk;
use super::{MASTER, RigSlave};
use crate::value::{Cell, ReplyWord, cells, percentage};
use harness_bench::command::cyclic::{Setpoint, setpoint};
use harness_bench::guard::Watch;
use harness_bench::link::{Line, Trouble};
use harness_bench::medium::HeardPiece;
use harness_bench::rig::Rig;
use harness_bench::rig::condition::{Mistake, PortCondition};
use harness_bench::rig::file::Interlock;
use harness_proto::decode::Decoded;
use harness_proto::nordac::words::ZSW;
use harness_proto::nordac::{Image, ParameterRef, Pkw, Task};
use harness_proto::profibus::Telegram;
use harness_proto::time::{Instant, Span};

/// The status word as a parameter (4.1.3).
const STATUS_WORD: u16 = 968;

/// The longest reply of an exchange: 20 octets of PPO type 2, and 9 around them.
const LONGEST: usize = 29;

#[derive(Clone, Debug)]
pub(crate) struct InverterInterlock {
    pub(crate) slave: u8,
    cell: Cell,
    condition: PortCondition<i64>,
    entry: Interlock,
    every: Span,
    /// On the clock of the driver.
    pub(crate) next: Instant,
}

/// Checks an entry of a rig's file.
///
/// # Errors
/// What is wrong with it.
pub(super) fn checked(interlock: &Interlock) -> Result<(), Mistake> {
    InverterInterlock::read(interlock).map(|_| ())
}

impl InverterInterlock {
    fn read(interlock: &Interlock) -> Result<Self, Mistake> {
        let name = interlock.parameter.clone().unwrap_or_default();
        let wrong = |message| {
            let expected =
                "ZSW, HIW, PZD4, or a parameter of `drivebench cells --bus nordac`, expected here";
            ("parameter", message, expected.to_owned())
        };
        let found = cells(std::slice::from_ref(&name)).map_err(wrong)?;
        let cell = match found[..] {
            [Cell::Parameter(parameter)] if parameter.parameter.number == STATUS_WORD => {
                Cell::Word(ReplyWord::Status)
            }
            [cell] => cell,
            _ => return Err(wrong("an interlock looks at one thing".to_owned())),
        };
        let bits: Vec<_> = match cell {
            Cell::Word(ReplyWord::Status) => ZSW.iter().map(|bit| (bit.number, bit.name)).collect(),
            _ => Vec::new(),
        };
        let condition = interlock.condition_of("parameter", &bits, |text| bound(text, cell))?;
        Ok(Self {
            slave: interlock.drive,
            cell,
            condition,
            entry: interlock.clone(),
            every: interlock.every.span(),
            next: Instant::START,
        })
    }

    /// The interlocks of a rig's file, which was checked.
    fn all(rig: &Rig) -> Vec<Self> {
        let all = rig.file.interlock.iter();
        all.flat_map(Self::read).collect()
    }

    /// The interlocks on parameters, which a driver has to read.
    pub(crate) fn parameters(rig: &Rig) -> Vec<Self> {
        let mut all = Self::all(rig);
        all.retain(|interlock| interlock.parameter().is_some());
        all
    }

    pub(crate) const fn parameter(&self) -> Option<ParameterRef> {
        match self.cell {
            Cell::Parameter(parameter) => Some(parameter),
            Cell::Word(_) => None,
        }
    }

    /// Notes when it is looked at again.
    pub(crate) fn seen_at(&mut self, now: Instant) {
        self.next = now + self.every;
    }

    /// Why it cannot be read.
    pub(crate) fn unread(&self, why: &str) -> Trouble {
        let words = self.entry.words(&self.cell.name());
        Trouble::Lost(format!("{words} cannot be read: {why}"))
    }

    /// Why it does not hold where this was read; `None` if it does.
    pub(crate) fn broken(&self, number: i64) -> Option<String> {
        let read = match self.cell {
            Cell::Parameter(named) => {
                let element = named.index.element;
                named.parameter.show(element, number).to_string()
            }
            Cell::Word(ReplyWord::Actual) => {
                let word = word_of(number);
                format!("{} ({word:04X})", percentage(word))
            }
            Cell::Word(ReplyWord::Status) => format!("{:04X}", word_of(number)),
            Cell::Word(ReplyWord::Second) => number.to_string(),
        };
        let why = self.entry.broken(
            &self.condition,
            word_of(number).into(),
            &read,
            |min, max| min.is_none_or(|min| *min <= number) && max.is_none_or(|max| number <= *max),
        )?;
        Some(format!("{}: {why}", self.entry.words(&self.cell.name())))
    }

    /// Why it does not hold in the inputs of an exchange; `None` if it does, or if it is on a parameter.
    fn broken_in(&self, image: &Image) -> Option<String> {
        let Cell::Word(word) = self.cell else {
            return None;
        };
        let raw = word.of(image);
        self.broken(match word {
            ReplyWord::Status => raw.into(),
            ReplyWord::Actual | ReplyWord::Second => raw.cast_signed().into(),
        })
    }
}

/// The bits of a number that came as a word.
const fn word_of(number: i64) -> u16 {
    (number & 0xFFFF) as u16
}

/// Reads a bound, in the numbers of a word or a parameter.
fn bound(text: &str, cell: Cell) -> Result<i64, (String, String)> {
    let (read, expected) = match cell {
        Cell::Parameter(parameter) => {
            let read = parameter.parameter.parse(parameter.index.element, text);
            let unit = parameter.parameter.unit_of(parameter.index.element).name;
            let expected = match unit {
                "" => "a number in quotes expected here".to_owned(),
                unit => format!("a number in {unit} expected here"),
            };
            // A number without the unit would count raw steps.
            let named = unit.is_empty() || text.trim_end().ends_with(|c: char| !c.is_ascii_digit());
            (read.ok().filter(|_| named), expected)
        }
        Cell::Word(ReplyWord::Actual) => {
            let read = match setpoint(text) {
                Ok(Setpoint::Raw(raw)) if text.trim_end().ends_with('%') => {
                    Some(raw.cast_signed().into())
                }
                _ => None,
            };
            let expected = "a percentage of the maximum frequency, such as 50%, expected here";
            (read, expected.to_owned())
        }
        Cell::Word(ReplyWord::Second) => {
            let read = text.trim().parse::<i16>().ok().map(i64::from);
            (read, "a whole number in quotes expected here".to_owned())
        }
        Cell::Word(ReplyWord::Status) => {
            (None, "`bit` and `level` expected in its place".to_owned())
        }
    };
    read.ok_or_else(|| (format!("`{text}` is no bound of {}", cell.name()), expected))
}

#[derive(Debug)]
pub(super) struct InverterInterlocks {
    all: Vec<InverterInterlock>,
    slaves: Vec<RigSlave>,
    patience: Span,
    /// The last octets that were received, without damage.
    heard: Vec<u8>,
}

impl InverterInterlocks {
    /// The interlocks of a rig with these slaves; `None` where it has none.
    pub(super) fn of(rig: &Rig, slaves: &[RigSlave], patience: Span) -> Option<Self> {
        let all = InverterInterlock::all(rig);
        (!all.is_empty()).then(|| Self {
            all,
            slaves: slaves.to_vec(),
            patience,
            heard: Vec::new(),
        })
    }
}

impl Watch for InverterInterlocks {
    fn due(&self) -> Option<Instant> {
        None
    }

    fn look(&mut self, _now: Instant, _line: &mut dyn Line) -> Result<(), String> {
        Ok(())
    }

    /// Takes each slave into the exchange, with words that are not valid: they change nothing (bit 10 of STW).
    fn look_at_all(&mut self, line: &mut dyn Line) -> Result<(), Trouble> {
        self.heard.clear();
        let mut talk = Talk::new(Box::new(line), self.patience);
        for interlock in &self.all {
            let address = interlock.slave;
            let mut slaves = self.slaves.iter();
            let slave = slaves.find(|slave| slave.address == address);
            let Some(slave) = slave else { continue };
            let known = KnownInverters::new(*slave);
            talk.restart(interlock.slave);
            let number = match interlock.parameter() {
                Some(own_parameter) if known.ppo().has_pkw() => {
                    let parameter = own_parameter.parameter;
                    let ind = own_parameter.ind();
                    let task = Pkw::of(Task::read(parameter).ak(), parameter.number, ind, 0);
                    let started = talk.start(interlock.slave, known.ppo(), None);
                    let raw = started.and_then(|()| known.task(&mut talk, task));
                    let raw = raw.map_err(|error| interlock.unread(&error.to_string()))?;
                    let raw = raw.ok_or_else(|| interlock.unread("the inverter refuses it"))?;
                    parameter.number_of(raw)
                }
                Some(_) => {
                    let why = format!("{} has no parameter channel", known.ppo());
                    return Err(interlock.unread(&why));
                }
                None => {
                    let started = talk.start(address, known.ppo(), None);
                    let image = started
                        .and_then(|()| talk.exchange(address, known.ppo(), &Image::default()));
                    let image = image.map_err(|error| interlock.unread(&error.to_string()))?;
                    match interlock.broken_in(&image) {
                        Some(why) => return Err(Trouble::Interlock(why)),
                        None => continue,
                    }
                }
            };
            if let Some(why) = interlock.broken(number) {
                return Err(Trouble::Interlock(why));
            }
        }
        Ok(())
    }

    fn hear(&mut self, heard: &HeardPiece) -> Result<(), String> {
        let HeardPiece::Octet(octet) = heard else {
            return Ok(());
        };
        if octet.error.is_some() {
            self.heard.clear();
            return Ok(());
        }
        self.heard.push(octet.byte);
        if self.heard.len() > LONGEST {
            self.heard.remove(0);
        }
        for slave in &self.slaves {
            let Some((address, image)) = reply(&self.heard, slave) else {
                continue;
            };
            let all = self.all.iter();
            let mut all = all.filter(|interlock| interlock.slave == address);
            if let Some(why) = all.find_map(|interlock| interlock.broken_in(&image)) {
                return Err(why);
            }
        }
        Ok(())
    }
}

/// The inputs of a slave, where the last octets end with its reply to an exchange.
fn reply(octets: &[u8], slave: &RigSlave) -> Option<(u8, Image)> {
    let ppo = slave.ppo?;
    let telegram = octets.get(octets.len().checked_sub(ppo.octets() + 9)?..)?;
    let Decoded::Value {
        value: Telegram::Pdu(pdu),
        ..
    } = Telegram::decode(telegram)
    else {
        return None;
    };
    let plain = pdu.dsap().is_none() && pdu.ssap().is_none();
    let from_it = (pdu.sa(), pdu.da()) == (slave.address, MASTER);
    let image = Image::decode(ppo, pdu.data())?;
    (plain && from_it).then_some((slave.address, image))
}
