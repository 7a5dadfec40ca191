//! What a frame may do to a physical drive, decided frame by frame from what the drive would read out of it.
//!
//! Reading needs no permission, but cycles load the bus: 181 beats 201 in arbitration, so replies could lock the master out, even its
//! stop frame. Where the manual leaves open how a drive reads a frame (`dlc4`), the more dangerous reading counts.
//!
//! The [`Gate`] sees every frame before it is sent, and knows the lock, the identifiers and the cycles from these frames alone.

use super::frame::{Data, Ignored, Request, low};
use super::properties::Dlc4;
use super::register::{Access, Register};
use super::words::{MODE_EVENT, MODE_LOCK};
use crate::can::{BitRate, Frame};
use crate::time::{Instant, Span};
use alloc::vec::Vec;
use core::fmt;

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
    /// Registers of [`Class::Named`] that the rig's file names.
    pub named: Vec<u8>,
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
            named: NAMED.to_vec(),
        }
    }

    fn all(&self) -> bool {
        self.motion && self.eeprom && self.bus_settings
    }
}

/// Registers that only a rig file that names them permits.
pub const NAMED: [u8; 3] = [0x03, 0x1A, 0x85];

/// What a write to a register may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// Nothing that needs a permission.
    Harmless,
    /// Depends on the value and the lock: 51, 31, 90, 17, 18.
    ByValue,
    /// Moves the motor, or changes how it moves.
    Motion,
    /// Wears the EEPROM, or changes data of device and motor.
    Eeprom,
    /// Device data that changes currents or what 100 % speed is.
    EepromAndMotion,
    /// Changes how the drive is reached.
    BusSettings,
    /// Needs to be named in the rig's file.
    Named,
    /// Is not listed, or cannot be written: needs all permissions.
    Unlisted,
    /// Can make the drive unusable.
    Never,
}

/// First register, last register, class.
const CLASSES: &[(u8, u8, Class)] = {
    use Class::{BusSettings, ByValue, Eeprom, EepromAndMotion, Harmless, Motion, Named, Never};
    &[
        (0x10, 0x16, Harmless),
        (0x52, 0x52, Harmless),
        (0x17, 0x18, ByValue),
        (0x31, 0x31, ByValue),
        (0x51, 0x51, ByValue),
        (0x90, 0x90, ByValue),
        (0x1C, 0x2F, Motion),
        (0x33, 0x36, Motion),
        (0x3B, 0x3C, Motion),
        (0x3E, 0x3F, Motion),
        (0x46, 0x46, Motion),
        (0x4C, 0x4C, Motion),
        (0x50, 0x50, Motion),
        (0x53, 0x53, Motion),
        (0x58, 0x58, Motion),
        (0x5B, 0x5B, Motion),
        (0x5E, 0x5E, Motion),
        (0x60, 0x60, Motion),
        (0x6A, 0x6C, Motion),
        (0x6E, 0x6E, Motion),
        (0x71, 0x72, Motion),
        (0x75, 0x7A, Motion),
        (0x7E, 0x80, Motion),
        (0x8E, 0x8E, Motion),
        (0xBE, 0xC3, Motion),
        (0xC7, 0xC7, Motion),
        (0xC9, 0xCB, Motion),
        (0xCD, 0xCD, Motion),
        (0xCF, 0xCF, Motion),
        (0xD1, 0xD4, Motion),
        (0xDA, 0xDB, Motion),
        (0xED, 0xED, Motion),
        (0xF0, 0xF1, Motion),
        (0x05, 0x0F, Eeprom),
        (0x19, 0x19, Eeprom),
        (0x3A, 0x3A, Eeprom),
        (0x44, 0x44, Eeprom),
        (0x47, 0x47, Eeprom),
        (0x4D, 0x4F, EepromAndMotion),
        (0x59, 0x59, Eeprom),
        (0x64, 0x65, Eeprom),
        (0x7C, 0x7D, Eeprom),
        (0x83, 0x84, Eeprom),
        (0x87, 0x87, Eeprom),
        (0x8B, 0x8D, Eeprom),
        (0xA2, 0xA7, Eeprom),
        (0xB1, 0xB6, Eeprom),
        (0xBB, 0xBD, Eeprom),
        (0xC4, 0xC6, Eeprom),
        (0xC8, 0xC8, EepromAndMotion),
        (0xD7, 0xD7, Eeprom),
        (0xEE, 0xEE, Eeprom),
        (0xF8, 0xFA, Eeprom),
        (0x68, 0x69, BusSettings),
        (0x73, 0x73, BusSettings),
        (0x88, 0x89, BusSettings),
        (0xD0, 0xD0, BusSettings),
        (0xDC, 0xDC, BusSettings),
        (0x03, 0x03, Named),
        (0x1A, 0x1A, Named),
        (0x85, 0x85, Named),
        (0x04, 0x04, Never),
        (0x5A, 0x5A, Never),
        (0x62, 0x62, Never),
        (0x67, 0x67, Never),
        (0xB0, 0xB0, Never),
        (0xB7, 0xBA, Never),
    ]
};

/// The class of writes to a register.
#[must_use]
pub fn class(register: u8) -> Class {
    let listed = CLASSES
        .iter()
        .find(|(first, last, _)| (*first..=*last).contains(&register))
        .map(|(_, _, class)| *class);
    match (listed, Register::of(register).access) {
        (Some(Class::Never), _) | (_, Access::UK) => Class::Never,
        // One inside a range too.
        (_, Access::RO) => Class::Unlisted,
        (listed, _) => listed.unwrap_or(Class::Unlisted),
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
    /// A lock written through this gate is in force.
    locked: bool,
    /// Registers with a cycle and their intervals in ms.
    cycles: Vec<(u8, u8)>,
    /// New bus settings have been written since the last restart.
    moved: bool,
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
            locked: false,
            cycles: Vec::new(),
            moved: false,
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
        let meant = |drive: &Guarded| {
            !frame.id().is_extended() && drive.rx.iter().any(|&rx| u32::from(rx) == number)
        };
        if !self.drives.iter().any(meant) {
            return Err(Denial::Identifier);
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
            drive.follow(request, sure);
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
            if drive.rx.iter().any(|&rx| u32::from(rx) == number) {
                // What another master locks it may release again.
                drive.follow(request, false);
            }
        }
    }

    /// Forgets every lock: the drives were restarted, or frames were lost.
    pub fn doubt(&mut self) {
        self.drives
            .iter_mut()
            .for_each(|drive| drive.locked = false);
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

/// The permissions that a write needs.
fn need(class: Class, register: u8, value: u16, locked: bool) -> &'static [Missing] {
    use Missing::{All, BusSettings, Eeprom, Motion, WayBack};
    match (class, register) {
        (Class::Harmless | Class::Named | Class::Never, _) => &[],
        (Class::ByValue, 0x51) => {
            let known = value & !(MODE_LOCK | MODE_EVENT) == 0;
            match (known, value & MODE_LOCK != 0) {
                (true, true) => &[],
                (true, false) => &[Motion],
                (false, _) => &[All],
            }
        }
        (Class::ByValue, 0x31 | 0x90) if value == 0 && locked => &[],
        (Class::ByValue, 0x17 | 0x18) if locked => &[],
        (Class::ByValue | Class::Motion, _) => &[Motion],
        // 83 brings a stored speed command back, which moves a drive that is not locked (our choice).
        (Class::Eeprom, 0x83) if !locked => &[Eeprom, Motion],
        (Class::Eeprom, _) => &[Eeprom],
        (Class::EepromAndMotion, _) => &[Eeprom, Motion],
        (Class::BusSettings, 0x73) => &[BusSettings, Eeprom, WayBack],
        (Class::BusSettings, _) => &[BusSettings],
        (Class::Unlisted, _) => &[All],
    }
}

impl Guarded {
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
        let remember = |list: &mut Vec<u16>| {
            list.retain(|id| *id != value);
            list.push(value);
        };
        match register {
            0x51 if value & MODE_LOCK == 0 => self.locked = false,
            0x51 => self.locked |= sure,
            0x68 => remember(&mut self.rx),
            0x69 => remember(&mut self.tx),
            _ => {}
        }
        self.moved |= matches!(register, 0x68 | 0x69 | 0x73);
    }
}

/// A permission that is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Missing {
    /// [`Limits::motion`].
    Motion,
    /// [`Limits::eeprom`].
    Eeprom,
    /// [`Limits::bus_settings`].
    BusSettings,
    /// [`Limits::way_back`].
    WayBack,
    /// [`Limits::motion`], [`Limits::eeprom`] and [`Limits::bus_settings`].
    All,
    /// [`Limits::named`].
    Named,
}

impl Missing {
    fn held(self, limits: &Limits) -> bool {
        match self {
            Self::Motion => limits.motion,
            Self::Eeprom => limits.eeprom,
            Self::BusSettings => limits.bus_settings,
            Self::WayBack => limits.way_back,
            Self::All => limits.all(),
            Self::Named => false,
        }
    }

    /// What the rig's file has to say.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Motion => "allow_motion",
            Self::Eeprom => "allow_eeprom",
            Self::BusSettings => "allow_bus_settings",
            Self::WayBack => "a stated way back from another bit rate",
            Self::All => "allow_motion, allow_eeprom and allow_bus_settings",
            Self::Named => "the register in its list of named registers",
        }
    }
}

/// Why a frame is not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Denial {
    /// No drive of the rig's file receives on its identifier.
    Identifier,
    /// The rig's file does not permit it.
    NotPermitted {
        /// The register.
        register: u8,
        /// What is missing.
        missing: Missing,
    },
    /// No rig file can permit it.
    Never {
        /// The register.
        register: u8,
    },
    /// 16 bits to 35 or ED: the upper half, the torque ramp, would become 0.
    HalfRamp {
        /// The register.
        register: u8,
    },
    /// The replies of all cycles would take more than half of the bit rate.
    Load {
        /// Thousandths of the bit rate.
        permille: u64,
    },
    /// 84 was written less than a minute ago.
    EepromWear,
    /// New bus settings would be stored, after which the drive may be reachable by RS232 only.
    LostDrive,
}

impl fmt::Display for Denial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |register: u8| Register::of(register).name;
        match *self {
            Self::Identifier => f.write_str(
                "no drive of the rig file receives on this identifier: add the drive to the rig file",
            ),
            Self::NotPermitted { register, missing } => write!(
                f,
                "a write to register {register:02X} ({}) needs {} in the rig file",
                name(register),
                missing.name()
            ),
            Self::Never { register } => write!(
                f,
                "a write to register {register:02X} ({}) can make the drive unusable; no rig file permits it",
                name(register)
            ),
            Self::HalfRamp { register } => write!(
                f,
                "16 bits for register {register:02X} ({}) also set its upper half to 0: read it first, then write all 32 bits",
                name(register)
            ),
            Self::Load { permille } => write!(
                f,
                "the cyclic replies would take {}.{} % of the bit rate, at most 50 % are permitted: stop a cycle, or ask less often",
                permille / 10,
                permille % 10
            ),
            Self::EepromWear => {
                f.write_str("the EEPROM was written less than a minute ago: wait before the next write of 84")
            }
            Self::LostDrive => f.write_str(
                "new identifiers or a new bit rate would be stored, and the drive may then answer on RS232 only: confirm it in the rig file",
            ),
        }
    }
}

impl core::error::Error for Denial {}
