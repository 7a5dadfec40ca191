//! Which cells a byte on the bus changes, and how (ND21 10.2 to 10.5, 14.2.1).

use crate::novobus::drive::Drive;
use crate::novobus::reference::Bytes;
use harness_proto::nd21::bits::{flags2, hw_version2, selftest, status, sw_version};
use harness_proto::nd21::cells::{CellAccess, cell_at, changes_by_itself};
use harness_proto::nd21::eeprom::LINKS;
use harness_proto::nd21::{CONFIRM_ERROR, ee, io, ram};
use std::ops::RangeInclusive;
use std::sync::LazyLock;

/// RAM and the registers behind it, FD80 to FFFF (10.1).
pub(super) type Image = [u8; 0x280];

const FIRST: u16 = 0xFD80;

/// What a byte may change beside what it means: the bus's own bits (14.4.3).
const OWN_BITS: u8 = flags2::OK | flags2::TIMEOUT;

/// For each cell, the bits that only the bus changes: they can be written, and the drive does not change them by itself.
static MASTERS: LazyLock<Image> = LazyLock::new(|| {
    std::array::from_fn(|place| {
        let address = address(place);
        match cell_at(address) {
            // An error is shown by the drive, and the bus keeps the address of each telegram (14.10.1, 9.2).
            _ if [ram::ERRORCODE, ram::ERRORCODE + 1, ram::BUS_ADDR].contains(&address) => 0,
            // Only the bus switches the monitoring of time-outs on or off (14.10.2).
            _ if address == ram::FLAGS2 => flags2::MONITORING,
            Some(cell) if cell.access != CellAccess::Read && !changes_by_itself(address) => {
                !cell.read_only_bits
            }
            _ => 0,
        }
    })
});

fn address(place: usize) -> u16 {
    FIRST + place as u16
}

fn place(address: u16) -> Option<usize> {
    address.checked_sub(FIRST).map(usize::from)
}

/// What a cell holds; 00 where there is none.
pub(super) fn at(image: &Image, address: u16) -> u8 {
    place(address).map_or(0, |place| image[place])
}

/// What the cells of a drive hold.
pub(super) fn image(drive: &Drive) -> Image {
    *drive.cells().ram_and_registers()
}

/// The first cell that has another value although only the bus changes it: its address, what it held and what it holds.
pub(super) fn changed_by_itself(was: &Image, is: &Image) -> Option<(u16, u8, u8)> {
    if was == is {
        return None;
    }
    // The nominal speed comes over the bus only where SwVersion says so (14.3.1).
    const NSOLL: RangeInclusive<u16> = ram::NSOLL..=ram::NSOLL + 1;
    let from_bus = at(was, ram::SW_VERSION) & sw_version::SOURCE == sw_version::SOURCE_NOVOBUS;
    let pairs = was.iter().zip(is).zip(MASTERS.iter()).enumerate();
    let mut changed = pairs.filter(|(_, ((was, is), mask))| (*was ^ *is) & *mask != 0);
    let (place, _) = changed.find(|(place, _)| {
        let address = address(*place);
        !(is_of_a_function(address) || !from_bus && NSOLL.contains(&address))
    })?;
    Some((address(place), was[place], is[place]))
}

/// Whether a function of the cycle control, or a referencing run, may set it (13.1.1, 13.1.7).
fn is_of_a_function(address: u16) -> bool {
    const CELLS: [RangeInclusive<u16>; 6] = [
        ram::VTIPPEN..=ram::VTIPPEN + 1,
        ram::PS_V0..=ram::PS_V0 + 1,
        ram::IMAX..=ram::I0,
        ram::N_MAX..=ram::N_MAX + 1,
        ram::N_RAMPE_PLUS..=ram::N_RAMPE_MINUS + 1,
        ram::D_LAGE..=ram::D_LAGE + 1,
    ];
    CELLS.iter().any(|cells| cells.contains(&address))
}

/// Whether one of these commands is ResetH8 (10.5).
pub(super) fn is_reset(executed: &[Bytes]) -> bool {
    executed
        .iter()
        .any(|command| command.first() == Some(&0xDD))
}

/// The cells that a command means, and the section that says so.
fn meant(command: &[u8], before: &Image) -> (&'static str, Vec<u16>) {
    let word = |low: u8, high: u8| u16::from_be_bytes([high, low]);
    let two = |address: u16| vec![address, address.wrapping_add(1)];
    match *command {
        [0x82, _, low, high] => ("10.2", vec![word(low, high)]),
        [0x63, _, _, low, high] => ("10.2", two(word(low, high))),
        [0xA4 | 0xA5, _, low] => ("10.3", vec![word(low, 0xFF)]),
        [0xC8, _] => ("10.4", vec![io::OUTPUTS]),
        [0x00, ..] => ("9.4", two(word(at(before, ram::DATA_IN), 0xFF))),
        _ => ("10.1", Vec::new()),
    }
}

/// What a cell holds after a write of `data` to it: read-only cells and bits stay as they are (14.2.1).
fn written(address: u16, before: u8, data: u8) -> u8 {
    match cell_at(address).filter(|cell| cell.access != CellAccess::Read) {
        Some(cell) => before & cell.read_only_bits | data & !cell.read_only_bits,
        None => before,
    }
}

/// Compares the cells after a byte with the reference model. Returns the first difference, with its section. The arguments hold
/// the commands that the model executed with the byte, its cells, and the bus error code if the byte caused an error.
pub(super) fn executed(
    executed: &[Bytes],
    before: &Image,
    reference: &Image,
    drive: &Drive,
    code: Option<u16>,
) -> Option<(&'static str, String)> {
    if is_reset(executed) {
        return at_start(drive).map(|about| ("10.5", about));
    }
    let is = image(drive);
    let mut must = *before;
    let mut section = "14.2.1";
    let mut loose = Vec::new();
    for command in executed {
        let (of_command, cells) = meant(command, before);
        section = of_command;
        for address in cells {
            let Some(place) = place(address) else {
                continue;
            };
            let data = reference[place];
            must[place] = match address {
                io::OUTPUTS => output(command, data, before),
                _ => written(address, before[place], data),
            };
            match (address, data) {
                // Whatever is asked of it, the EEPROM controller shows at once what it does (14.10.5.1).
                (ram::EEPROM_CONTROL, _) => loose.push(address),
                (ram::ERRORCODE, CONFIRM_ERROR) => confirm(&mut must),
                // The positioning controller takes its orders there (13.3.1).
                (ram::PS_STATUS, _) => loose.push(address),
                _ => {}
            }
        }
    }
    if let Some(code) = code {
        section = "14.11.14";
        let [high, low] = code.to_be_bytes();
        must[usize::from(ram::ERRORCODE - FIRST)] = high;
        must[usize::from(ram::ERRORCODE - FIRST) + 1] = low;
        loose.push(ram::STATUS);
    }
    let bus_addr = usize::from(ram::BUS_ADDR - FIRST);
    must[bus_addr] = reference[bus_addr];
    if let Some(place) = differing(&must, &is, &loose) {
        let about = format!(
            "cell {:04X} holds {:02X} behind {} and {:02X} before, it must hold {:02X}",
            address(place),
            is[place],
            executed
                .last()
                .map_or_else(|| "a byte".to_owned(), |command| format!("{command:02X?}")),
            before[place],
            must[place],
        );
        return Some((section, about));
    }
    None
}

/// The first cell that differs, apart from the `loose` cells and the bus's own bits.
fn differing(must: &Image, is: &Image, loose: &[u16]) -> Option<usize> {
    if must == is {
        return None;
    }
    let pairs = must.iter().zip(is).enumerate();
    let mut otherwise = pairs.filter(|(place, (must, is))| {
        let free = match address(*place) {
            ram::FLAGS2 => OWN_BITS,
            cell if loose.contains(&cell) => 0xFF,
            _ => 0,
        };
        (**must ^ **is) & !free != 0
    });
    otherwise.next().map(|(place, _)| place)
}

/// The port of the outputs after WriteIO: with the analogue output active GPO1 is no digital one (14.3.4).
fn output(command: &[u8], data: u8, before: &Image) -> u8 {
    let analogue = at(before, ram::HW_VERSION2) & hw_version2::NO_ANALOGUE_OUTPUT == 0;
    match command {
        [0xC8, 0 | 1] if analogue => at(before, io::OUTPUTS),
        [0xC8, _] => data,
        // No command writes there.
        _ => at(before, io::OUTPUTS),
    }
}

/// AF in `errorcode` deletes the error (14.10.1).
fn confirm(must: &mut Image) {
    must[usize::from(ram::ERRORCODE - FIRST)] = 0;
    must[usize::from(ram::ERRORCODE - FIRST) + 1] = 0;
    must[usize::from(ram::STATUS - FIRST)] &= !status::ERROR;
}

/// The first cell of a newly started drive that differs from what its EEPROM requires (10.5, 14.2.2): cells with an EEPROM place
/// hold its contents, other cells that only the bus changes hold 00.
pub(super) fn at_start(drive: &Drive) -> Option<String> {
    let is = image(drive);
    let mut must: Image = [0; 0x280];
    for link in LINKS {
        for offset in 0..link.size {
            if let Some(place) = place(link.ram + u16::from(offset)) {
                must[place] = drive.cells().eeprom()[usize::from(link.eeprom + offset)];
            }
        }
    }
    // 13.1.4: this speed begins as the highest one.
    let speed = usize::from(ram::N_MAX - FIRST);
    must.copy_within(speed..speed + 2, usize::from(ram::PS_V0 - FIRST));
    let self_test = drive.cells().eeprom()[usize::from(ee::SELFTEST)];
    if self_test & selftest::MONITORING != 0 {
        must[usize::from(ram::FLAGS2 - FIRST)] = flags2::MONITORING;
    }
    let pairs = must.iter().zip(&is).zip(MASTERS.iter());
    let place = pairs
        .map(|((must, is), mask)| (must ^ is) & mask)
        .position(|difference| difference != 0)?;
    let (address, must, is) = (address(place), must[place], is[place]);
    Some(format!(
        "cell {address:04X} holds {is:02X} when the drive starts, it must hold {must:02X}"
    ))
}
