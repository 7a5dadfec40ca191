//! What a frame may do to a physical drive, decided frame by frame from what the drive would read out of it.
//!
//! Reading needs no permission, but cycles load the bus: 181 beats 201 in arbitration, so replies could lock the master out, even its
//! stop frame. Where the manual leaves open how a drive reads a frame (`dlc4`), the more dangerous reading counts.
//!
//! The [`Gate`] sees every frame before it is sent, and knows the lock, the identifiers and the cycles from these frames alone.

mod class;
mod denial;
mod speed;

pub use class::{Class, NAMED, class};
pub use denial::{Denial, Fast, Missing};

use super::frame::{Data, Ignored, Request, low};
use super::properties::Dlc4;
use super::words::MODE_LOCK;
use crate::can::{BitRate, Frame};
use crate::time::{Instant, Span};
use alloc::vec::Vec;
use class::need;
use speed::Speed;

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
        }
    }

    fn all(&self) -> bool {
        self.motion && self.eeprom && self.bus_settings
    }
}

/// Bits of the longest reply on the bus: 6 data bytes and all stuff bits.
const REPLY_BITS: u64 = Frame::worst_wire_bits(false, 6) as u64;

/// The shortest time between two writes of 84.
const EEPROM_REST: Span = Span::from_millis(60_000);

/// What the gate knows of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Guarded {
    /// As the rig's file names it.
    first_rx: u16,
    first_tx: u16,
    /// On which it may receive: after a write to 68 the old and the new one, since it is open when the drive changes.
    rx: Vec<u16>,
    tx: Vec<u16>,
    /// On which it may receive as well: what has been written to 88 (`second-identifiers`).
    second: Vec<u16>,
    /// A lock written through this gate is in force.
    locked: bool,
    /// Registers with a cycle and their intervals in ms.
    cycles: Vec<(u8, u8)>,
    /// New bus settings have been written since the last restart.
    moved: bool,
    speed: Speed,
}

/// Judges every frame of a bus before it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gate {
    limits: Limits,
    rate: BitRate,
    drives: Vec<Guarded>,
    eeprom_at: Option<Instant>,
    eeprom_writes: u32,
}

impl Gate {
    /// A gate in front of a bus of this rate with drives that receive and send on these identifiers.
    #[must_use]
    pub fn new(limits: Limits, rate: BitRate, drives: &[(u16, u16)]) -> Self {
        let drives = drives.iter().map(|&(rx, tx)| Guarded {
            first_rx: rx,
            first_tx: tx,
            rx: [rx].to_vec(),
            tx: [tx].to_vec(),
            second: Vec::new(),
            locked: false,
            cycles: Vec::new(),
            moved: false,
            speed: Speed::default(),
        });
        Self {
            limits,
            rate,
            drives: drives.collect(),
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
        let meant = |drive: &Guarded| !frame.id().is_extended() && drive.may_hear(number);
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
            drive.follow(request, sure && !drive.is_second(number));
        }
        if let Request::Write { register: 0x84, .. } = request {
            self.eeprom_at = Some(now);
            self.eeprom_writes += 1;
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
        for drive in &mut self.drives {
            drive.locked = false;
            drive.speed = Speed::default();
        }
    }

    /// Takes notice of C8, the rpm of 100 % speed, and of 34, the limit of the speed, as they were read from the drive that receives
    /// on `rx`.
    pub fn learn(&mut self, rx: u16, full: u16, limit: u16) {
        for drive in self.drives.iter_mut().filter(|own| own.rx.contains(&rx)) {
            drive.speed.full = Some(full);
            drive.speed.limit = Some(limit.cast_signed().unsigned_abs());
        }
    }

    /// Takes notice that new bus settings have been written earlier to the drive that receives on `rx`.
    pub fn note_moved(&mut self, rx: u16) {
        for drive in self.drives.iter_mut().filter(|own| own.rx.contains(&rx)) {
            drive.moved = true;
        }
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

    /// The drives whose identifiers were changed, as identifiers to receive and to send: those of the rig's file, and the latest.
    pub fn moved(&self) -> impl Iterator<Item = ((u16, u16), (u16, u16))> {
        self.drives.iter().filter_map(|drive| {
            let first = (drive.first_rx, drive.first_tx);
            let latest = (*drive.rx.last()?, *drive.tx.last()?);
            (first != latest).then_some((first, latest))
        })
    }

    /// The cycles that were started and not stopped: identifier of the drive, register.
    pub fn cycles(&self) -> impl Iterator<Item = (u16, u8)> {
        self.drives.iter().flat_map(|drive| {
            let rx = drive.rx.last().copied().unwrap_or(drive.first_rx);
            drive
                .cycles
                .iter()
                .map(move |(register, _)| (rx, *register))
        })
    }

    /// How often 84 was written.
    #[must_use]
    pub const fn eeprom_writes(&self) -> u32 {
        self.eeprom_writes
    }

    /// The share of the bit rate that the replies of all cycles take, in thousandths, with `request` added.
    fn load_with(&self, request: Request, meant: &dyn Fn(&Guarded) -> bool) -> u64 {
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

    fn permits(&self, now: Instant, drive: &Guarded, request: Request) -> Result<(), Denial> {
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

impl Guarded {
    /// Whether it may hear a frame with this identifier of 11 bits.
    fn may_hear(&self, number: u32) -> bool {
        let mut all = self.rx.iter().chain(&self.second);
        all.any(|&rx| u32::from(rx) == number)
    }

    /// Whether it hears frames with this identifier at most as those of a second one.
    fn is_second(&self, number: u32) -> bool {
        !self.rx.iter().any(|&rx| u32::from(rx) == number)
    }

    fn remember_second(&mut self, raw: u32) {
        let id = u16::try_from(raw)
            .ok()
            .filter(|id| (1..=0x7FF).contains(id));
        if let Some(id) = id.filter(|id| !self.second.contains(id)) {
            self.second.push(id);
        }
    }

    /// Keeps the state that an admitted frame leads to. `sure`: every drive reads the frame so.
    fn follow(&mut self, request: Request, sure: bool) {
        match request {
            Request::Read { .. } => {}
            Request::Cycle { register, every } => {
                self.cycles.retain(|(with, old)| {
                    // An interval that may still be in force counts until it is certain.
                    *with != register || (!sure && *old < every)
                });
                if !self.cycles.iter().any(|(with, _)| *with == register) {
                    self.cycles.push((register, every));
                }
            }
            Request::Stop { register } if sure => {
                self.cycles.retain(|(with, _)| *with != register);
            }
            Request::Stop { .. } => {}
            Request::Write { register, data } => self.written(register, data, sure),
        }
    }

    fn written(&mut self, register: u8, data: Data, sure: bool) {
        let value = low(data.bits());
        self.speed.written(register, value, sure);
        // With a number that is none of 11 bits no drive can be reached.
        let remember = |list: &mut Vec<u16>| {
            if !(1..=0x7FF).contains(&value) {
                return;
            }
            list.retain(|id| *id != value);
            list.push(value);
        };
        match register {
            0x51 if value & MODE_LOCK == 0 => self.locked = false,
            0x51 => self.locked |= sure,
            0x68 => remember(&mut self.rx),
            0x69 => remember(&mut self.tx),
            0x88 => self.remember_second(data.bits()),
            _ => {}
        }
        self.moved |= matches!(register, 0x68 | 0x69 | 0x73);
    }
}
