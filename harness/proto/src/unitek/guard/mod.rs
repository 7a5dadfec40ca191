//! What a frame may do to a physical drive, decided frame by frame from what the drive would read out of it.
//!
//! Reading needs no permission, but cycles load the bus: 181 beats 201 in arbitration, so replies could lock the master out, even its
//! stop frame. Where the manual leaves open how a drive reads a frame (`dlc4`), the more dangerous reading counts.
//!
//! The [`FrameGate`] sees every frame before it is sent, and knows the lock, the identifiers and the cycles from these frames alone.

mod class;
mod denial;
mod drive;
mod range;
mod speed;

pub use class::{Class, NAMED, class};
pub use denial::{Denial, FastWrite, Missing};
pub use range::ValueRange;

use super::frame::{Data, Ignored, Request, low};
use super::properties::Dlc4;
use crate::can::{BitRate, Frame};
use crate::time::{Instant, Span};
use alloc::vec::Vec;
use class::need;
use drive::GuardedDrive;

/// What the rig's file permits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// The motor may turn, and what the regulators work with may be changed.
    pub motion: bool,
    /// The EEPROM, and device and motor data, may be written.
    pub eeprom: bool,
    /// Identifiers, bit rate, width of replies and time-out may be changed.
    pub bus_settings: bool,
    /// The rig's file states how a drive with another bit rate is brought back.
    pub way_back: bool,
    /// The rig's file confirms that new bus settings may be stored in the EEPROM.
    pub store_bus_settings: bool,
    /// Frames may be sent that no drive of the rig's file receives: other identifiers, 29 bits.
    pub other_identifiers: bool,
    /// The highest speed that a drive may be told; any where this is `None`.
    pub max_speed: Option<HighestSpeed>,
    /// Registers of [`Class::Named`] that the rig's file names.
    pub named: Vec<u8>,
    /// The values that may be written to registers; to any other register each value may.
    pub ranges: Vec<ValueRange>,
}

/// The highest speed that a drive may be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HighestSpeed {
    /// As 31 and 34 count it: 32767 is 100 %.
    Raw(u16),
    /// In rpm; C8 says what 100 % is.
    Rpm(u16),
}

impl Limits {
    /// Permits everything but what is never permitted, as on a bench of simulated drives.
    #[must_use]
    pub fn unlimited() -> Self {
        Self {
            motion: true,
            eeprom: true,
            bus_settings: true,
            way_back: true,
            store_bus_settings: true,
            other_identifiers: true,
            max_speed: None,
            named: NAMED.to_vec(),
            ranges: Vec::new(),
        }
    }

    fn all(&self) -> bool {
        self.motion && self.eeprom && self.bus_settings
    }
}

/// Where a drive may be reached: on the identifiers of the rig's file, and on every one that was written to it since it was last found there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Places {
    /// Those of the rig's file, to receive and to send.
    pub first: (u16, u16),
    /// On which it may receive: the first one, then the latest.
    pub rx: Vec<u16>,
    /// On which it may send, in the same order.
    pub tx: Vec<u16>,
    /// What was written to 73 last, if it was written.
    pub timing: Option<u16>,
}

impl Places {
    /// Whether it was given other identifiers.
    #[must_use]
    pub fn has_moved(&self) -> bool {
        self.rx.len() > 1 || self.tx.len() > 1
    }
}

/// Bits of the longest reply on the bus: 6 data bytes and all stuff bits.
const REPLY_BITS: u64 = Frame::worst_wire_bits(false, 6) as u64;

/// The shortest time between two writes of 84.
const EEPROM_REST: Span = Span::from_millis(60_000);

/// Judges every frame of a bus before it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameGate {
    limits: Limits,
    rate: BitRate,
    drives: Vec<GuardedDrive>,
    /// Every identifier that was written to a drive: to receive, and to send.
    given: [Vec<u16>; 2],
    eeprom_at: Option<Instant>,
    eeprom_writes: u32,
}

impl FrameGate {
    /// A gate in front of a bus of this rate with drives that receive and send on these identifiers.
    #[must_use]
    pub fn new(limits: Limits, rate: BitRate, drives: &[(u16, u16)]) -> Self {
        Self {
            limits,
            rate,
            drives: drives.iter().copied().map(GuardedDrive::new).collect(),
            given: Default::default(),
            eeprom_at: None,
            eeprom_writes: 0,
        }
    }

    /// Judges a frame that is about to be sent at `now`; a frame that is admitted counts as sent.
    ///
    /// # Errors
    /// [`Denial`]; the frame must not be sent, and the gate has not changed.
    pub fn admit(&mut self, now: Instant, frame: &Frame) -> Result<(), Denial> {
        let number = frame.id().number();
        let meant = |drive: &GuardedDrive| !frame.id().is_extended() && drive.may_hear(number);
        if !self.drives.iter().any(meant) {
            return match self.limits.other_identifiers {
                true => Ok(()),
                false => Err(Denial::Identifier),
            };
        }
        let Some((request, sure)) = read(frame) else {
            return Ok(());
        };
        for drive in self.drives.iter().filter(|drive| meant(drive)) {
            self.permits(now, drive, request)?;
        }
        let load = self.load_with(request, &meant);
        if matches!(request, Request::Cycle { .. }) && load > 500 {
            return Err(Denial::Load { permille: load });
        }
        for drive in self.drives.iter_mut().filter(|drive| meant(drive)) {
            drive.follow(request, sure && drive.hears(number));
        }
        if let Request::Write { register, data } = request {
            let value = low(data.bits());
            match register {
                0x84 => {
                    self.eeprom_at = Some(now);
                    self.eeprom_writes += 1;
                }
                0x68 | 0x88 if !self.given[0].contains(&value) => self.given[0].push(value),
                0x69 | 0x89 if !self.given[1].contains(&value) => self.given[1].push(value),
                _ => {}
            }
        }
        Ok(())
    }

    /// Takes notice of a frame that another master has sent.
    pub fn overhear(&mut self, frame: &Frame) {
        let number = frame.id().number();
        let Some((request, _)) = read(frame) else {
            return;
        };
        for drive in &mut self.drives {
            if drive.may_hear(number) {
                // What another master locks it may release again.
                drive.follow(request, false);
            }
        }
    }

    /// Forgets every lock and every speed: the drives were restarted, or frames were lost.
    pub fn doubt(&mut self) {
        self.drives.iter_mut().for_each(GuardedDrive::doubt);
    }

    /// Takes notice of what the registers of a drive held before it was used: that may be set back, whatever the stated ranges.
    pub fn held_before(&mut self, first_rx: u16, cells: Vec<(u8, u32)>) {
        self.with(first_rx, |drive| drive.before = cells);
    }

    /// Takes notice of C8, the rpm of 100 % speed, and of 34, the limit of the speed, as they were read from the drive that receives
    /// on `rx`.
    pub fn learn(&mut self, rx: u16, full: u16, limit: u16) {
        for drive in self
            .drives
            .iter_mut()
            .filter(|drive| drive.rx.contains(&rx))
        {
            drive.speed.full = Some(full);
            drive.speed.limit = Some(limit.cast_signed().unsigned_abs());
        }
    }

    /// Whether new bus settings (68, 69, 73) were written to the drive whose first identifier is `first_rx`, and are not known to be set back:
    /// storing them (84) may lose the drive.
    #[must_use]
    pub fn has_moved(&self, first_rx: u16) -> bool {
        let mut drives = self.drives.iter();
        drives.any(|drive| drive.first_rx == first_rx && drive.moved)
    }

    /// Takes notice that the bus settings of this drive read as they did at first.
    pub fn moved_back(&mut self, first_rx: u16) {
        self.with(first_rx, |drive| drive.moved = false);
    }

    /// What the rig's file permits.
    #[must_use]
    pub const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Copies what another gate to the same drives knows of them.
    pub fn know_as(&mut self, other: &Self) {
        self.drives.clone_from(&other.drives);
    }

    /// Where each drive may be reached.
    pub fn places(&self) -> impl Iterator<Item = Places> {
        self.drives.iter().map(|drive| Places {
            first: (drive.first_rx, drive.first_tx),
            rx: drive.receives().collect(),
            tx: drive.sends().collect(),
            timing: drive.timing,
        })
    }

    /// Every identifier that was written to a drive since the gate was made: to receive on, and to send on.
    #[must_use]
    pub const fn given(&self) -> &[Vec<u16>; 2] {
        &self.given
    }

    /// Takes notice that the drive whose first identifier is `first_rx` has answered on `rx`.
    pub fn found(&mut self, first_rx: u16, rx: u16) {
        self.with(first_rx, |drive| drive.found(rx));
    }

    /// Takes notice that this drive answers on the identifiers of the rig's file, and on no other that was given to it.
    pub fn settled(&mut self, first_rx: u16) {
        self.with(first_rx, GuardedDrive::settled);
    }

    /// Takes notice that this drive sends nothing by itself.
    pub fn sends_nothing(&mut self, first_rx: u16) {
        self.with(first_rx, GuardedDrive::sends_nothing);
    }

    fn with(&mut self, first_rx: u16, act: impl FnOnce(&mut GuardedDrive)) {
        let mut all = self.drives.iter_mut();
        if let Some(drive) = all.find(|drive| drive.first_rx == first_rx) {
            act(drive);
        }
    }

    /// The registers of which this drive was told to send cycles since it was last seen to send none, with their longest intervals in ms.
    pub fn started(&self, first_rx: u16) -> impl Iterator<Item = (u8, u8)> + '_ {
        let drives = self
            .drives
            .iter()
            .filter(move |drive| drive.first_rx == first_rx);
        drives.flat_map(|drive| drive.started.iter().copied())
    }

    /// The cycles that were started and not stopped: identifier of the drive in the rig's file, register.
    pub fn cycles(&self) -> impl Iterator<Item = (u16, u8)> {
        self.drives.iter().flat_map(|drive| {
            let rx = drive.first_rx;
            let registers = drive.cycles.iter().map(|(register, _)| *register);
            registers.map(move |register| (rx, register))
        })
    }

    /// How often 84 was written.
    #[must_use]
    pub const fn eeprom_writes(&self) -> u32 {
        self.eeprom_writes
    }

    /// The share of the bit rate that the replies of all cycles take, in thousandths, with `request` added.
    fn load_with(&self, request: Request, meant: &dyn Fn(&GuardedDrive) -> bool) -> u64 {
        // Frames in 1000 s, so that a division loses nothing that counts.
        let frames = |every: u8| 1_000_000 / u64::from(every.max(1));
        let mut total = 0;
        for drive in &self.drives {
            let added = match request {
                Request::Cycle { register, every } if meant(drive) => Some((register, every)),
                _ => None,
            };
            let kept = drive
                .cycles
                .iter()
                .filter(|(register, _)| added.is_none_or(|(new, _)| new != *register));
            total += kept
                .chain(&added)
                .map(|(_, every)| frames(*every))
                .sum::<u64>();
        }
        total * REPLY_BITS / u64::from(self.rate.bits_per_second())
    }

    fn permits(&self, now: Instant, drive: &GuardedDrive, request: Request) -> Result<(), Denial> {
        let Request::Write { register, data } = request else {
            return Ok(());
        };
        let denied = |missing| Err(Denial::NotPermitted { register, missing });
        let limits = &self.limits;
        let need = match class(register) {
            Class::Never => return Err(Denial::Never { register }),
            Class::Named if limits.named.contains(&register) => &[][..],
            Class::Named => return denied(Missing::Named),
            class => need(class, register, low(data.bits()), drive.locked),
        };
        if let Some(missing) = need.iter().find(|need| !need.held(limits)) {
            return denied(*missing);
        }
        if let Some(identifier) = drive.taken(register, low(data.bits()), &self.drives) {
            return Err(Denial::Taken {
                register,
                identifier,
            });
        }
        let range = limits
            .ranges
            .iter()
            .find(|range| range.register == register);
        let before = drive.before.contains(&(register, data.bits()));
        if let Some(range) = range.filter(|range| !before && !range.admits(data)) {
            return Err(Denial::Range(*range));
        }
        let denies = |max| drive.speed.denies(max, register, low(data.bits()));
        if let Some(fast) = limits.max_speed.and_then(denies) {
            return Err(Denial::Speed { register, fast });
        }
        if matches!((register, data), (0x35 | 0xED, Data::Short(_))) {
            return Err(Denial::HalfRamp { register });
        }
        if register == 0x84 {
            if drive.moved && !limits.store_bus_settings {
                return Err(Denial::LostDrive);
            }
            if self
                .eeprom_at
                .is_some_and(|last| now.since(last) < EEPROM_REST)
            {
                return Err(Denial::EepromWear);
            }
        }
        Ok(())
    }
}

/// What a drive may read out of a frame, and whether every drive does.
fn read(frame: &Frame) -> Option<(Request, bool)> {
    let rx = u16::try_from(frame.id().number()).ok()?;
    let request = Request::decode(frame, rx, Dlc4::As3).ok()?;
    let sure = Request::decode(frame, rx, Dlc4::Ignore) != Err(Ignored::FourBytes);
    Some((request, sure))
}
