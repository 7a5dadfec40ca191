//! How many drives a ring has, and which (ND21 8.5, 9.3, 14.8).

use super::{Axis, Error, OpenRings};
use crate::language::run::over_bus::read_byte;
use crate::locate::locate;
use harness_bench::link::{Line, Octets, wait_keeping};
use harness_proto::line::Received;
use harness_proto::nd21::bits::flags2;
use harness_proto::nd21::units::{
    Date, SpeedRange, operating_hours_from_bytes, serial_number_from_bytes,
};
use harness_proto::nd21::{State, ee, ram};
use harness_proto::novobus::address::{MAX_DRIVES, RingSize};
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, enough};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::Span;

/// A telegram that addresses no drive: each of N drives adds 1 to the 00, and no sum is 0 (9.3). All drives pass the net byte on.
pub(crate) const COUNT: [u8; 3] = [0x82, 0x00, SYNCO];

/// Counts the drives of a ring. If nothing sensible comes back, counts once more after the check sequence (9.8). Changes
/// nothing in the drives.
///
/// # Errors
/// [`Error::TimeOut`] where no ring answers, [`Error::Link`] where the link carries nothing.
pub(crate) fn count_drives(link: &mut dyn Line, ring: usize) -> Result<RingSize, Error> {
    let counted = count_behind(link, ring, &[]);
    counted
        .or_else(|| count_repaired(link, ring))
        .ok_or_else(|| link.trouble().cloned().map_or_else(no_answer, Error::Link))
}

/// Brings a ring back and counts its drives. As many check sequences as the largest ring needs are sent where something comes back behind the
/// first two (9.8). Drives after a time-out pass on seven zeros and then an address (9.9), so that a drive behind them may not hear the eight
/// zeros for which it waits (9.7). After the first check sequence they are drives that pass on 17.
fn count_repaired(link: &mut dyn Line, ring: usize) -> Option<RingSize> {
    let (first, heard) = counted(link, ring, &CHECK_SEQUENCE.repeat(2));
    let more = first.is_none() && !heard.is_empty() && link.trouble().is_none();
    match more {
        true => {
            let enough: Vec<_> = enough(MAX_DRIVES).collect();
            count_behind(link, ring, &enough)
        }
        false => first,
    }
}

fn no_answer() -> Error {
    Error::TimeOut {
        waited: Span::from_millis(50),
        what: "a ring to answer: it is broken, or a drive is not ready for operation (ND21 9.9)"
            .to_owned(),
    }
}

/// Sends some bytes and then the telegram that counts; `None` where nothing sensible comes back.
pub(crate) fn count_behind(link: &mut dyn Line, ring: usize, before: &[u8]) -> Option<RingSize> {
    counted(link, ring, before).0
}

/// The same with the bytes that came; 0 for a damaged one.
fn counted(link: &mut dyn Line, ring: usize, before: &[u8]) -> (Option<RingSize>, Vec<u8>) {
    let mut bytes = before.to_vec();
    bytes.extend([SYNCO, SYNCO]);
    bytes.extend(COUNT);
    let mut heard = Vec::new();
    let size = listen(link, ring, &bytes, MAX_DRIVES, |received| {
        heard.push(if received.error.is_none() {
            received.byte
        } else {
            0
        });
        match heard[..] {
            [.., sync, drives, net] if (sync, net) == (COUNT[0], COUNT[2]) => {
                RingSize::new(drives.into()).ok()
            }
            _ => None,
        }
    });
    (size, heard)
}

/// Sends bytes and SYNCO behind them, and shows what comes, until one of them says something or all must have come round this many drives.
fn listen<T>(
    link: &mut dyn Line,
    ring: usize,
    bytes: &[u8],
    drives: u16,
    mut heard: impl FnMut(Received) -> Option<T>,
) -> Option<T> {
    while link.receive_octet(ring).is_some() {}
    let sent = link.send_octets(ring, bytes);
    let end = sent + link.byte_time() * (u64::from(drives) + 8) + Span::from_millis(50);
    loop {
        // A busy computer may look for the bytes only when their time is over.
        let last = link.now() >= end || link.trouble().is_some();
        wait_keeping(link, end);
        while let Some((_, received)) = link.receive_octet(ring) {
            if let Some(found) = heard(received) {
                return Some(found);
            }
        }
        if last {
            return None;
        }
    }
}

/// For how long [`unasked`] listens for a byte.
const SILENCE: Span = Span::from_millis(100);

/// For how long bytes that were sent before may still come, also from a ring at a quarter of the rate.
const REST: Span = Span::from_millis(1_000);

/// Bytes that come for [`REST`] although nothing is sent; the last ones of them. Bytes that stop were sent before.
pub(crate) fn unasked(line: &mut dyn Line, ring: usize) -> Vec<Received> {
    let rest = line.now() + REST;
    loop {
        let end = line.now() + SILENCE;
        let mut heard = Vec::new();
        while line.now() < end && line.trouble().is_none() {
            line.wait(end);
            heard.extend(std::iter::from_fn(|| line.receive_octet(ring)).map(|(_, byte)| byte));
        }
        if heard.is_empty() || line.now() >= rest || line.trouble().is_some() {
            return heard;
        }
    }
}

/// What a ring reported during its recovery (9.7, 9.8).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Recovery {
    /// The drive that spelled out its address before.
    pub before: Option<SpelledOut>,
    /// The drive that does so after the check sequence: the ring is not back.
    pub after: Option<u8>,
    /// Zeros come without end although nothing is sent, also after the check sequence. A drive in error mode answers each byte with one
    /// (9.7), so these are no report of drive 0.
    pub zeros_unasked: bool,
    /// How many drives answer; `None` where the ring is not back.
    pub drives: Option<RingSize>,
    /// The last bytes that came for those that were sent after the check sequence, where the ring is not back and no drive spells out its
    /// address.
    pub heard: Vec<u8>,
}

/// How many bytes [`Recovery::heard`] has at the most.
const SHOWN: usize = 8;

impl Recovery {
    /// The drive that reported a fault in front of it, before the ring was brought back.
    #[must_use]
    pub(crate) fn fault(&self) -> Option<SpelledOut> {
        self.before
            .filter(|spelled| spelled.why != SpellingCause::MissedMaster)
    }
}

/// A drive that spelled out its address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SpelledOut {
    pub drive: u8,
    /// What can have made it do so.
    pub why: SpellingCause,
}

/// What makes a drive spell out its address (9.7, 9.9).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpellingCause {
    /// A fault in front of it.
    Fault,
    /// A fault, or no byte for 10 ms: it monitors time-outs, and so does a drive between it and the master. That one names itself where no
    /// master sends, unless the silence was just long enough for some of the drives. Or it could not be asked.
    FaultOrSilence,
    /// No master sent for 10 ms: it monitors time-outs, and no drive between it and the master does.
    MissedMaster,
}

/// Listens to what a ring reports, sends 17 zeros and the check sequence (9.8), and counts the drives.
#[must_use]
pub(crate) fn recover(link: &mut dyn Line, ring: usize) -> Recovery {
    recover_up_to(link, ring, MAX_DRIVES)
}

/// The same of a ring that should have this many drives at most, which takes less time.
#[must_use]
pub(crate) fn recover_up_to(link: &mut dyn Line, ring: usize, drives: u16) -> Recovery {
    let (before, _) = reported(link, ring, drives);
    let drives = count_repaired(link, ring);
    let (after, heard) = match drives {
        Some(_) => (None, Vec::new()),
        None => reported(link, ring, MAX_DRIVES),
    };
    let zeros_unasked = after == Some(0) && !unasked(link, ring).is_empty();
    let counts = |drive: &u8| !(zeros_unasked && *drive == 0);
    let (before, after) = (before.filter(counts), after.filter(counts));
    let before = before.map(|drive| SpelledOut {
        drive,
        why: drives.map_or(SpellingCause::Fault, |size| why(link, ring, drive, size)),
    });
    Recovery {
        before,
        after,
        zeros_unasked,
        drives,
        heard: match after {
            Some(_) => Vec::new(),
            None => heard,
        },
    }
}

/// How often it is asked whether a drive monitors time-outs: where the computer is held up, drives that do time out again.
const TRIES: usize = 4;

/// What can have made a drive spell out its address, by which drives monitor time-outs (ND21 14.10.2).
fn why(link: &mut dyn Line, ring: usize, drive: u8, size: RingSize) -> SpellingCause {
    let mut monitors = |drive| {
        let flags2 = (0..TRIES).find_map(|_| {
            let read = read_byte(link, size.drives(), (ring, drive), ram::FLAGS2);
            if read.is_none() {
                let enough: Vec<_> = enough(size.drives().into()).collect();
                let _size = count_behind(link, ring, &enough);
            }
            read
        });
        flags2.map(|flags2| flags2 & flags2::MONITORING != 0)
    };
    match monitors(drive) {
        Some(false) => SpellingCause::Fault,
        Some(true) if (drive + 1..size.drives()).all(|other| monitors(other) == Some(false)) => {
            SpellingCause::MissedMaster
        }
        _ => SpellingCause::FaultOrSilence,
    }
}

/// The zeros in front of the address that a drive spells out, and some more (9.7).
const ZEROS: usize = 50;

/// The drive that spells out its address while the master sends SYNCO (9.7, 9.9) to a ring of this many drives, and the last bytes that came.
fn reported(link: &mut dyn Line, ring: usize, drives: u16) -> (Option<u8>, Vec<u8>) {
    // Once round the ring, and the zeros.
    let sent = vec![SYNCO; usize::from(drives) + ZEROS];
    let mut heard = Vec::new();
    let _all: Option<()> = listen(link, ring, &sent, drives, |received| {
        heard.push(received);
        None
    });
    let located = locate(&heard, u8::try_from(MAX_DRIVES).unwrap_or(u8::MAX));
    let last = heard[heard.len().saturating_sub(SHOWN)..].iter();
    let last = last.map(|received| received.byte).collect();
    (located.map(|location| location.drive), last)
}

/// The identity that a drive reports (14.3.5, 14.8).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    /// The serial number; `None` where the EEPROM holds none.
    pub serial_number: Option<u32>,
    /// `EE_Version` as it stands: the places of its bits are lost in the print (14.3.5).
    pub ee_version: u8,
    /// Hours of operation, and hours blocked (14.8.2).
    pub hours: (u16, u16),
    /// The start-up date, if there is one.
    pub start_up: Option<Date>,
    /// The date of the last change of parameters, if there is one.
    pub changed: Option<Date>,
    /// The first bytes of the ROM information (12.3).
    pub rom: [u8; 8],
}

impl OpenRings<'_> {
    /// Reads how a drive is.
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn state(&self, axis: Axis) -> Result<State, Error> {
        Ok(State {
            status: self.read_byte(axis, ram::STATUS)?,
            flags: self.read_byte(axis, ram::FLAGS)?,
            flags2: self.read_byte(axis, ram::FLAGS2)?,
            error: self.read_word(axis, ram::ERRORCODE)?,
        })
    }

    /// Reads the range of speeds, on which the scale of every speed and ramp depends (14.3.2).
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn speed_range(&self, axis: Axis) -> Result<SpeedRange, Error> {
        let byte = self.read_byte(axis, ram::SW_VERSION2)?;
        Ok(SpeedRange::from_sw_version2(byte))
    }

    /// Reads what a drive says of itself, from its EEPROM.
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn identity(&self, axis: Axis) -> Result<Identity, Error> {
        let mut identities = self.identities(&[axis])?;
        identities.pop().ok_or(Error::NoSuchOrder)
    }

    /// Reads what drives say of themselves, side by side: on a ring of 250 drives an answer takes 75 ms, and
    /// many can be under way.
    ///
    /// # Errors
    /// See [`Error`]; the first one where several drives fail.
    pub(crate) fn identities(&self, axes: &[Axis]) -> Result<Vec<Identity>, Error> {
        let mut eeproms = vec![[0; 256]; axes.len()];
        let words = [
            ee::BETRIEB_STD,
            ee::SPERRE_STD,
            ee::INIT_DATUM,
            ee::PROG_DATUM,
        ];
        let serial_number = ee::SERIENNUMMER..ee::SERIENNUMMER + 3;
        let addresses = words.iter().flat_map(|word| [*word, word + 1]);
        for address in addresses.chain(serial_number).chain([ee::VERSION]) {
            let bytes = self.read_eeprom_of(axes, address)?;
            for (eeprom, byte) in eeproms.iter_mut().zip(bytes) {
                eeprom[usize::from(address)] = byte;
            }
        }
        let mut identities = Vec::new();
        for (axis, eeprom) in axes.iter().zip(&eeproms) {
            let mut rom = [0; 8];
            rom.copy_from_slice(&self.read_bytes(*axis, 0x2F00, 8)?);
            identities.push(Identity::new(eeprom, rom));
        }
        Ok(identities)
    }
}

impl Identity {
    fn new(eeprom: &[u8; 256], rom: [u8; 8]) -> Self {
        let byte = |address: u8| eeprom[usize::from(address)];
        let word = |address: u8| [byte(address), byte(address + 1)];
        let date = |address| Date::from_raw(u16::from_be_bytes(word(address))).ok();
        let serial = [0, 1, 2].map(|offset| byte(ee::SERIENNUMMER + offset));
        Self {
            serial_number: serial_number_from_bytes(serial).ok(),
            ee_version: byte(ee::VERSION),
            hours: (
                operating_hours_from_bytes(word(ee::BETRIEB_STD)),
                operating_hours_from_bytes(word(ee::SPERRE_STD)),
            ),
            start_up: date(ee::INIT_DATUM),
            changed: date(ee::PROG_DATUM),
            rom,
        }
    }
}
