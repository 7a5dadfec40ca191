//! What is known of a drive: what its registers read, and how it behaves where the manual leaves that open.

use super::Axis;
use crate::driver::{Driver, Error};
use crate::simulate::DriveSetup;
use harness_proto::time::Span;
use harness_proto::unitek::frame::Reply;
use harness_proto::unitek::properties::{PROPERTIES, Properties, Setting, UnitekProperty};
use harness_proto::unitek::words::{ERROR_NO_POWER, ERROR_TIME_OUT, status};
use harness_proto::unitek::{REGISTERS, Register};
use harness_sim::unitek::{Control, Inputs};
use std::collections::{BTreeMap, BTreeSet};

/// What a cell without a meaning reads (dump).
const UNASSIGNED: u32 = 0xFACE;

/// The firmware: the register that every drive answers.
pub(super) const FIRMWARE: u8 = 0x1B;

/// Registers that change without a write: read again before each scenario.
const LIVE: [u8; 28] = [
    0x31, 0x40, 0x49, 0x4A, 0x4B, 0x51, 0x52, 0x6D, 0x6E, 0x8F, 0x90, 0x92, 0x93, 0x95, 0x96, 0x97,
    0xA0, 0xD0, 0xD5, 0xD6, 0xD8, 0xE2, 0xE4, 0xE5, 0xE6, 0xE7, 0xE8, 0xEB,
];

/// Times that homing may take, in ms: the manual names none.
const HOMING: [u64; 5] = [0, 100, 1_000, 3_000, 10_000];

/// A drive, as far as it is known.
#[derive(Clone, Debug)]
pub(super) struct KnownDrives {
    pub(super) axis: Axis,
    /// What the registers read last.
    pub(super) cells: BTreeMap<u8, u32>,
    /// What the registers read at first, before any probe.
    pub(super) first: BTreeMap<u8, u32>,
    /// How it behaves; the default where that is not settled.
    pub(super) properties: Properties,
    /// The properties that are settled, by name.
    pub(super) settled: BTreeSet<&'static str>,
    /// The last replies with each register; for widths and stuff bytes.
    pub(super) replies: BTreeMap<u8, Reply>,
    /// The shortest time from a request to its reply, if one came later than on an idle bus.
    pub(super) reply_delay: Option<Span>,
    /// Frames were lost while this was found out.
    pub(super) doubtful: bool,
}

impl KnownDrives {
    pub(super) fn new(axis: Axis) -> Self {
        Self {
            axis,
            cells: BTreeMap::new(),
            first: BTreeMap::new(),
            properties: Properties::default(),
            settled: BTreeSet::new(),
            replies: BTreeMap::new(),
            reply_delay: None,
            doubtful: false,
        }
    }

    /// Reads every register that means something. Where one gives no reply, it is not known.
    ///
    /// # Errors
    /// The link is in trouble, or the drive does not answer for its firmware.
    pub(super) fn read_all(&mut self, driver: &mut Driver<'_>) -> Result<(), Error> {
        let assigned = REGISTERS.iter().filter(|row| row.dump != UNASSIGNED);
        let read = self.read(driver, assigned.map(|row| row.number));
        for (register, read) in &self.cells {
            self.first.entry(*register).or_insert(*read);
        }
        read
    }

    /// Reads what may have changed: registers that change without a write, and those that were written.
    ///
    /// # Errors
    /// As [`Self::read_all`].
    pub(super) fn read_again(
        &mut self,
        driver: &mut Driver<'_>,
        written: &BTreeSet<(u16, u8)>,
    ) -> Result<(), Error> {
        // A function may have loaded all parameters.
        if written.contains(&(self.axis.rx, 0x83)) {
            return self.read_all(driver);
        }
        let ours = written.iter().filter(|(rx, _)| *rx == self.axis.rx);
        let all: BTreeSet<u8> = ours.map(|(_, register)| *register).chain(LIVE).collect();
        self.read(driver, all.into_iter())
    }

    fn read(
        &mut self,
        driver: &mut Driver<'_>,
        registers: impl Iterator<Item = u8>,
    ) -> Result<(), Error> {
        self.note(driver.read(self.axis, FIRMWARE)?);
        for register in registers.filter(|register| *register != FIRMWARE) {
            match driver.read(self.axis, register) {
                Ok(reply) => self.note(reply),
                Err(Error::NoReply { .. }) => {
                    self.cells.remove(&register);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn note(&mut self, reply: Reply) {
        let mask = Register::of(reply.register).mask();
        self.cells.insert(reply.register, reply.data.bits() & mask);
        self.replies.insert(reply.register, reply);
    }

    /// What a register read last; 0 where that is not known.
    pub(super) fn cell(&self, register: u8) -> u32 {
        self.cells.get(&register).copied().unwrap_or(0)
    }

    /// Whether every reply has 6 bytes (App 3).
    pub(super) fn is_wide(&self) -> bool {
        self.cell(0xDC) & 0x0100 != 0
    }

    /// Whether it has the error of a time-out of the bus, which has come since its registers were read at first: it is known what clears it.
    pub(super) fn has_timed_out(&self) -> bool {
        let at_first = self.first.get(&0x8F).copied().unwrap_or(ERROR_TIME_OUT);
        self.cell(0x8F) & !at_first & ERROR_TIME_OUT != 0
    }

    /// A copy whose registers read what they read at first.
    pub(super) fn as_at_first(&self) -> Self {
        Self {
            cells: self.first.clone(),
            ..self.clone()
        }
    }

    pub(super) fn settle(&mut self, name: &str, word: &str) {
        if let Some(property) = UnitekProperty::of(name)
            && property.set(&mut self.properties, Setting::Word(word))
        {
            self.settled.insert(property.name);
        }
    }

    /// Takes over how long homing took. It is settled only where time is `exact`: an adapter and a busy computer take time, too.
    pub(super) fn measure_homing(&mut self, took: Span, exact: bool) {
        self.properties.homing_time = took;
        if exact {
            self.settled.insert("homing-time");
        }
    }

    /// The model of the drive as it is, standing and controlled by speed.
    pub(super) fn model(&self, properties: Properties) -> DriveSetup {
        let on = |register| self.cell(register) & 1 == 1;
        let word = |register| (self.cell(register) & 0xFFFF) as u16;
        let calibrated = self.cell(0x40) & status::CALIBRATED != 0;
        let dc_bus = self.cell(0x8F) & ERROR_NO_POWER == 0;
        let time_out = match self.has_timed_out() {
            true => ERROR_TIME_OUT,
            false => 0,
        };
        let inputs = Inputs {
            run: on(0xE8),
            rfe: self.cell(0xD8) >> 5 & 1 == 1,
            dc_bus,
            limit1: on(0xE4),
            limit2: on(0xE5),
            din1: on(0xE6),
            din2: on(0xE7),
            icns: on(0xF3),
            motor_temperature: word(0x49),
            igbt_temperature: word(0x4A),
            air_temperature: word(0x4B),
            voltage: word(0xEB),
            faults: self.cell(0x8F) & !ERROR_NO_POWER & !time_out,
            calibrated: calibrated.then_some(true),
            ..Inputs::default()
        };
        let shown = |register: &u8| !matches!(register, 0x68 | 0x69);
        DriveSetup {
            identifiers: (self.axis.rx, self.axis.tx),
            properties,
            inputs,
            registers: self
                .cells
                .iter()
                .filter(|(register, _)| shown(register))
                .map(|(register, raw)| (*register, *raw))
                .collect(),
            control: Some(Control::Speed),
            released: self.cell(0x40) & status::ENABLED != 0,
            timed_out: time_out != 0,
            ..DriveSetup::new(self.axis.node)
        }
    }

    /// What the drive can be where one of its properties is open; the value that is assumed first. None for a property that can have any
    /// value.
    pub(super) fn values_of(&self, property: &UnitekProperty) -> Vec<Properties> {
        use harness_proto::unitek::properties::Accepts;
        let Accepts::Words(words) = property.accepts else {
            return Vec::new();
        };
        let with = |word: &&'static str| {
            let mut other = self.properties;
            property
                .set(&mut other, Setting::Word(word))
                .then_some(other)
        };
        words.iter().filter_map(with).collect()
    }

    /// The drives that this one can be: each differs from what is assumed in one property that is not settled.
    pub(super) fn candidates(&self) -> Vec<Properties> {
        let mut all = Vec::new();
        let open = PROPERTIES
            .iter()
            .filter(|property| !self.settled.contains(property.name));
        for property in open {
            let (words, times) = values(property, self.reply_delay);
            let words = words.into_iter().map(Setting::Word);
            let times = times.into_iter().map(Setting::Time);
            for setting in words.chain(times) {
                let mut other = self.properties;
                let taken = property.set(&mut other, setting);
                if taken && other != self.properties {
                    all.push(other);
                }
            }
        }
        all
    }
}

/// The values that a property can have.
fn values(property: &UnitekProperty, reply_delay: Option<Span>) -> (Vec<&'static str>, Vec<Span>) {
    use harness_proto::unitek::properties::Accepts;
    match property.accepts {
        Accepts::Words(words) => (words.to_vec(), Vec::new()),
        Accepts::Byte => (vec!["00", "A5", "FF"], Vec::new()),
        Accepts::TimeUpTo(_) if property.name == "reply-delay" => {
            (Vec::new(), reply_delay.into_iter().collect())
        }
        Accepts::TimeUpTo(_) => (Vec::new(), HOMING.map(Span::from_millis).to_vec()),
    }
}
