//! Reference model of the NOVOBUS ring, to be read beside chapters 9 and 10 of the ND21 User Manual
//! 1/96 and to hold a faster simulator against. It knows bytes and no time: a drive turns the list
//! of bytes on its inbound link into that on its outbound link, one after another, so time-outs
//! (ND21 9.9) are out of its reach. Where the manual contradicts its byte tables, the tables win.

use std::fmt;
use std::ops::Deref;

// First and last cell that a command may touch (ND21 10.1, 10.2).
const RAM: (u16, u16) = (0xFD80, 0xFF7F);
const READ_BYTE_RANGES: [(u16, u16); 2] = [(0x2F00, 0x2FBF), (0xFD80, 0xFFFF)];
const READ_WORD_RANGES: [(u16, u16); 2] = [(0x2F00, 0x2FDF), RAM];

/// Where RAM and the registers behind it begin, and how many cells they have (ND21 10.1).
const RAM_AND_REGISTERS: (u16, usize) = (RAM.0, 0x280);

// Kept address (ND21 9.2, the RAM map), the flag of the time-out monitoring (14.10.2), and the port of GPO1 (bit 7) and GPO2 (bit 5) (ND21 10.4).
const BUS_ADDR: u16 = 0xFF36;
const FLAGS2: u16 = 0xFF57;
const PORT: u16 = 0xFFB7;
/// The check sequence, without its 17 zeros (ND21 9.8).
const CHECK_SEQUENCE: [u8; 5] = [0xFF, 0x44, 0x72, 0x4C, 0x41];

/// What a receiver reads off the line (ND21 8.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The eight data bits.
    pub byte: u8,
    /// The line marked it bad: parity, framing, break or overrun.
    pub error: bool,
}

/// What a line does to one transmitted byte: 8 data bits, odd parity, 1 stop bit (ND21 8.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Flips the data bits of the mask, the parity bit too (first flag), the stop bit too (second).
    /// Bad if data and parity flips are odd in number or the stop bit is flipped, else unnoticed.
    Flip(u8, bool, bool),
    /// Another good byte in its place.
    Replace(u8),
    /// The byte never arrives.
    Drop,
    /// The byte arrives twice.
    Duplicate,
    /// A good byte arrives before it.
    Insert(u8),
    /// Reads 00, bad.
    Break,
}

/// Where a drive stands in the byte stream (ND21 9.1).
#[derive(Clone, Copy, Debug, Default)]
#[repr(u8)]
enum ReferenceState {
    #[default]
    Sync,
    /// Net bytes that will follow the address byte, how many of them are process data.
    Address(u8, u8),
    /// Net bytes to come, how many of them are process data, whether this drive is addressed.
    Net(u8, u8, bool),
    Error,
}

/// A few bytes, six at most: the longest command (ND21 10).
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Bytes {
    bytes: [u8; 6],
    length: usize,
}

impl Bytes {
    fn push(&mut self, byte: u8) {
        self.bytes[self.length] = byte;
        self.length += 1;
    }

    fn clear(&mut self) {
        self.length = 0;
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

impl fmt::Debug for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self[..].fmt(f)
    }
}

/// Memory cells; one never set reads 00.
#[derive(Clone, Debug)]
struct Memory {
    ram: [u8; RAM_AND_REGISTERS.1],
    /// Cells elsewhere that were set, each once.
    elsewhere: Vec<(u16, u8)>,
}

impl Default for Memory {
    fn default() -> Self {
        Self {
            ram: [0; RAM_AND_REGISTERS.1],
            elsewhere: Vec::new(),
        }
    }
}

/// One drive of the ring: its memory and its place in the protocol (ND21 9, 10).
#[derive(Clone, Debug, Default)]
pub struct Drive {
    memory: Memory,
    state: ReferenceState,
    /// An explicit address was seen, so `BusAddr` means something to a short telegram (ND21 9.2).
    address_valid: bool,
    /// First process data byte received, second one to be sent (ND21 9.4).
    process: (u8, u8),
    /// The command as far as received, its answer as far as sent (ND21 9.5).
    command: Bytes,
    answer: Bytes,
    /// What a read command fetched, lowest address first (ND21 10.1).
    fetched: [u8; 4],
    /// Error mode: good zeros in a row, zeros sent, "*" seen, check sequence bytes seen (ND21 9.7).
    zeros_received: u8,
    zeros_sent: u8,
    preceding: bool,
    matched: usize,
    /// What was executed, oldest first: a command without its checking byte, or 00 and two process data bytes.
    executed: Vec<Bytes>,
    /// Time-outs have been monitored at some time (ND21 14.10.2).
    monitored: bool,
}

impl Drive {
    /// A drive after power-up: cells 00, waits for a sync byte, no short address valid (ND21 9.2).
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The same as [`Self::new`], on the room that it has.
    pub fn restart_all(&mut self) {
        self.memory.ram.fill(0);
        self.memory.elsewhere.clear();
        self.restart();
        self.executed.clear();
        self.monitored = false;
    }

    /// The cells FD80 to FFFF (ND21 10.1).
    #[must_use]
    pub fn ram_and_registers(&self) -> &[u8; 0x280] {
        &self.memory.ram
    }

    /// Sets any memory cell, past the bus and its ranges (ND21 10).
    pub fn poke(&mut self, address: u16, byte: u8) {
        self.monitored |= address == FLAGS2 && byte & 0x04 != 0;
        match address.checked_sub(RAM_AND_REGISTERS.0) {
            Some(place) => self.memory.ram[usize::from(place)] = byte,
            None => {
                self.memory.elsewhere.retain(|cell| cell.0 != address);
                self.memory.elsewhere.push((address, byte));
            }
        }
    }

    /// Reads any memory cell, past the bus and its ranges (ND21 10); one never set reads 00.
    #[must_use]
    pub fn peek(&self, address: u16) -> u8 {
        match address.checked_sub(RAM_AND_REGISTERS.0) {
            Some(place) => self.memory.ram[usize::from(place)],
            None => {
                let mut set = self.memory.elsewhere.iter();
                set.find(|cell| cell.0 == address).map_or(0, |cell| cell.1)
            }
        }
    }

    /// Whether time-outs were monitored at any time (bit 2 of `Flags2`, ND21 14.10.2), even if they no longer are: from then on silence may
    /// have had effects that this model does not know (9.9).
    #[must_use]
    pub fn has_monitored(&self) -> bool {
        self.monitored
    }

    /// Fetches what was executed since the last call, oldest first: commands without their checking byte; 00 and two bytes
    /// for process data, as 00 begins no command (ND21 9.5).
    pub fn take_executed(&mut self) -> Vec<Bytes> {
        std::mem::take(&mut self.executed)
    }

    /// Discards an incomplete command.
    pub fn forget_half(&mut self) {
        self.command.clear();
        self.answer.clear();
    }

    /// Treats the process data under way as received, and executes nothing (ND21 9.4).
    pub fn forget_process_data(&mut self) {
        if let ReferenceState::Net(left, process, addressed) = self.state {
            self.state = match left - process {
                0 => ReferenceState::Sync,
                left => ReferenceState::Net(left, 0, addressed),
            };
        }
    }

    /// Silence for 10 ms: the error mode, in which increments begin with the "*" (ND21 9.9).
    pub fn time_out(&mut self) {
        if !self.in_error() {
            self.state = ReferenceState::Error;
            self.zeros_received = 0;
            self.preceding = false;
            self.matched = 0;
        }
        self.zeros_sent = 17;
    }

    /// Whether the drive is in error mode (ND21 9.7).
    #[must_use]
    pub fn in_error(&self) -> bool {
        matches!(self.state, ReferenceState::Error)
    }

    /// Takes one byte off the line, gives the byte sent for it; only PAUSE gets none (ND21 9, 9.2).
    #[inline]
    pub fn receive(&mut self, cell: Cell) -> Option<u8> {
        match self.state {
            ReferenceState::Error => Some(self.error_mode(cell)),
            _ => self.normal_mode(cell),
        }
    }

    #[inline(never)]
    fn normal_mode(&mut self, cell: Cell) -> Option<u8> {
        let reply = match (self.state, cell.byte) {
            (ReferenceState::Error, _) => Ok(self.error_mode(cell)),
            // ND21 9.7: parity and framing are checked by every drive, addressed or not.
            _ if cell.error => Err(0x0502),
            (ReferenceState::Sync, 0x80) => Ok(0x80), // SYNCO
            (ReferenceState::Sync, 0x81) => return None, // PAUSE
            (ReferenceState::Sync, byte) => self.sync_byte(byte),
            (ReferenceState::Address(net, process), byte) => {
                self.address_valid = true;
                self.begin(byte.wrapping_add(1), net, process);
                Ok(byte.wrapping_add(1))
            }
            (ReferenceState::Net(left, process, addressed), byte) => {
                self.state = match left {
                    1 => ReferenceState::Sync,
                    _ => ReferenceState::Net(left - 1, process.saturating_sub(1), addressed),
                };
                match process {
                    // ND21 9.3: passed on, contents not checked.
                    _ if !addressed => Ok(byte),
                    0 => self.parameter_byte(byte),
                    _ => Ok(self.process_byte(byte, process)),
                }
            }
        };
        Some(reply.unwrap_or_else(|code| {
            // ND21 14.10.1: the error code, high byte first.
            self.poke_word([0xFD, 0x82], code.to_be_bytes());
            self.state = ReferenceState::Error;
            self.error_mode(cell)
        }))
    }

    /// ND21 9.2: `1 N S 0 T2 T1 T0 D`, forwarded unchanged; a short telegram uses the sum kept.
    fn sync_byte(&mut self, byte: u8) -> Result<u8, u16> {
        let (net, process) = ((byte >> 1) & 7, (byte & 1) * 2);
        match byte & 0xF0 {
            0x80 if net >= process => self.state = ReferenceState::Address(net, process),
            0xA0 if net >= process => self.begin(self.peek(BUS_ADDR), net, process),
            0xE0 if net >= process => self.begin(self.peek(BUS_ADDR).wrapping_add(1), net, process),
            _ => return Err(0x0504),
        }
        Ok(byte)
    }

    /// ND21 9.3: every drive keeps the sum; the net bytes are for the one whose sum is 00.
    fn begin(&mut self, sum: u8, net: u8, process: u8) {
        self.poke(BUS_ADDR, sum);
        if net > 0 {
            self.state = ReferenceState::Net(net, process, self.address_valid && sum == 0);
        }
    }

    /// ND21 9.4, 14.10.3: from `DataOut` (FF34), latched at the first byte; to `DataIn` (FF32).
    fn process_byte(&mut self, byte: u8, process: u8) -> u8 {
        if process == 2 {
            let from = u16::from_be_bytes([0xFF, self.peek(0xFF34)]);
            self.process = (byte, self.peek(from.wrapping_add(1)));
            return self.peek(from);
        }
        let mut executed = Bytes::default();
        executed.push(0);
        executed.push(self.process.0);
        executed.push(byte);
        self.executed.push(executed);
        self.poke_word([0xFF, self.peek(0xFF32)], [self.process.0, byte]);
        self.process.1
    }

    /// ND21 9.5, 9.6: a command, answered in step, executed when its checking byte is right.
    fn parameter_byte(&mut self, byte: u8) -> Result<u8, u16> {
        let length = match self.command.first().unwrap_or(&byte) {
            0xC8 | 0xDD => 3,
            0xC0 | 0xA4 | 0xA5 => 4,
            0xC1 | 0x82 => 5,
            0xC7 | 0x63 => 6,
            _ => return Err(0x0505),
        };
        if self.command.len() + 1 < length {
            self.command.push(byte);
            let reply = self.parameter_reply(byte)?;
            self.answer.push(reply);
            return Ok(reply);
        }
        if byte != check_sum(self.command.iter().copied()) {
            return Err(0x0507);
        }
        let reply = match self.command[0] {
            // ND21 10.1, ReadLong: six bytes do not hold an echo, four data bytes and a checksum.
            0xC7 => self.fetched[3],
            _ => check_sum(self.answer.iter().map(|byte| byte.wrapping_neg())),
        };
        self.execute();
        self.command.clear();
        self.answer.clear();
        Ok(reply)
    }

    /// ND21 10: the answer to the last byte of an unfinished command, or an improper parameter.
    fn parameter_reply(&mut self, byte: u8) -> Result<u8, u16> {
        match *self.command {
            // ReadByte, ReadWord (big-endian in memory, low byte first on the bus), ReadLong.
            [0xC0, low, high] => Ok(self.fetch(&READ_BYTE_RANGES, [high, low], 1)?[0]),
            [0xC1, low, high] => Ok(self.fetch(&READ_WORD_RANGES, [high, low], 2)?[1]),
            [0xC1, _, _, b'?'] => Ok(self.fetched[0]),
            [0xC7, low, high] => Ok(self.fetch(&[RAM], [high, low], 4)?[0]),
            [0xC7, _, _, b'1'] => Ok(self.fetched[1]),
            [0xC7, _, _, _, b'2'] => Ok(self.fetched[2]),
            [0xC1 | 0xC7, _, _, _, ..] => Err(0x0506),
            // WriteByte, WriteWord, And and Or, WriteIO, ResetH8.
            [0x82, _, low, high] => self.fetch(&[RAM], [high, low], 1).and(Ok(byte)),
            [0x63, _, _, low, high] => self.fetch(&[RAM], [high, low], 2).and(Ok(byte)),
            [0xA4 | 0xA5, _, low] if low > 0x7F => Err(0x0506),
            [0xC8, code] if code > 3 => Err(0x0506),
            [0xDD, fixed] if fixed != b'!' => Err(0x0506),
            _ => Ok(byte),
        }
    }

    /// ND21 10.1, 10.2: all `width` cells must lie in one range; a read fetches them with `AddrH`.
    fn fetch(&mut self, at: &[(u16, u16)], word: [u8; 2], width: u16) -> Result<[u8; 4], u16> {
        let address = u16::from_be_bytes(word);
        self.fetched = [0, 1, 2, 3].map(|offset| self.peek(address.wrapping_add(offset)));
        let fits = |at: &&(u16, u16)| (at.0..=at.1 - (width - 1)).contains(&address);
        at.iter().find(fits).map(|_| self.fetched).ok_or(0x0506)
    }

    /// ND21 10.2 to 10.5: what a complete command does.
    fn execute(&mut self) {
        self.executed.push(self.command);
        match *self.command {
            [0x82, data, low, high] => self.poke(u16::from_be_bytes([high, low]), data),
            [0x63, lower, upper, low, high] => self.poke_word([high, low], [upper, lower]),
            [0xA4, data, low] => self.change(0xFF00 | u16::from(low), data, 0),
            [0xA5, data, low] => self.change(0xFF00 | u16::from(low), 0xFF, data),
            [0xC8, 0] => self.change(PORT, 0x7F, 0),
            [0xC8, 1] => self.change(PORT, 0xFF, 0x80),
            [0xC8, 2] => self.change(PORT, 0xDF, 0),
            [0xC8, 3] => self.change(PORT, 0xFF, 0x20),
            [0xDD, _] => {
                self.memory.ram[..usize::from(RAM.1 - RAM.0) + 1].fill(0);
                self.restart();
            }
            _ => {}
        }
    }

    fn change(&mut self, address: u16, and: u8, or: u8) {
        self.poke(address, self.peek(address) & and | or);
    }

    fn poke_word(&mut self, address: [u8; 2], [high, low]: [u8; 2]) {
        let address = u16::from_be_bytes(address);
        self.poke(address, high);
        // Behind FFFF there is nothing.
        if let Some(next) = address.checked_add(1) {
            self.poke(next, low);
        }
    }

    /// After a reset and a check sequence all but the memory is as after power-up.
    fn restart(&mut self) {
        self.state = ReferenceState::Sync;
        self.address_valid = false;
        self.process = (0, 0);
        self.forget_half();
        self.fetched = [0; 4];
        (self.zeros_received, self.zeros_sent) = (0, 0);
        (self.preceding, self.matched) = (false, 0);
    }

    /// ND21 9.7, 9.8: from the offending byte on, zeros, then increments, until the check sequence.
    #[inline]
    fn error_mode(&mut self, cell: Cell) -> u8 {
        let good = |byte| !cell.error && cell.byte == byte;
        // "*": eight good zeros in a row show the preceding drive in error mode; remembered.
        self.zeros_received = u8::from(good(0)) * self.zeros_received.saturating_add(1);
        self.preceding |= self.zeros_received >= 8;
        if self.preceding {
            // "@": the check sequence passes; a byte that breaks it off may restart it.
            if !good(CHECK_SEQUENCE[self.matched]) {
                self.matched = 0;
            }
            if good(CHECK_SEQUENCE[self.matched]) {
                self.matched += 1;
                if self.matched == CHECK_SEQUENCE.len() {
                    self.restart();
                }
                return cell.byte;
            }
            // "#": the 17th zero is the last.
            if self.zeros_sent >= 17 {
                return cell.byte.wrapping_add(1);
            }
        }
        self.zeros_sent = self.zeros_sent.saturating_add(1);
        0
    }
}

/// Sends bytes round a ring; gives for each link what its receiver read, in order (ND21 8.5, 9).
///
/// `drives` begin behind the master with drive N-1. A fault is (link, byte number from 1 as
/// transmitted there, fault): link 0 leads from the master to the first drive, link n from the last
/// one to the master. Faults at one byte act in the order given, one at no byte does nothing.
pub fn run(drives: &mut [Drive], sent: &[u8], faults: &[(usize, usize, Fault)]) -> Vec<Vec<Cell>> {
    let mut links = Vec::new();
    run_into(&mut links, drives, sent, faults);
    links
}

/// The same, into the lists of an earlier run.
pub fn run_into(
    links: &mut Vec<Vec<Cell>>,
    drives: &mut [Drive],
    sent: &[u8],
    faults: &[(usize, usize, Fault)],
) {
    links.resize(drives.len() + 1, Vec::new());
    links.iter_mut().for_each(Vec::clear);
    for (number, &byte) in (1..).zip(sent) {
        transmit(byte, (0, number), faults, &mut links[0]);
    }
    for (link, drive) in (1..).zip(drives) {
        let (before, behind) = links.split_at_mut(link);
        let mut number = 0;
        for &cell in &before[link - 1] {
            if let Some(byte) = drive.receive(cell) {
                number += 1;
                transmit(byte, (link, number), faults, &mut behind[0]);
            }
        }
    }
}

/// What is read of a byte, of this number on this link.
fn transmit(
    mut byte: u8,
    place: (usize, usize),
    faults: &[(usize, usize, Fault)],
    read: &mut Vec<Cell>,
) {
    let (mut parity, mut framing, mut copies) = (false, false, 1);
    for (_, _, fault) in faults.iter().filter(|at| (at.0, at.1) == place) {
        match *fault {
            Fault::Flip(mask, parity_bit, stop_bit) => {
                byte ^= mask;
                parity ^= (mask.count_ones() % 2 == 1) ^ parity_bit;
                framing ^= stop_bit;
            }
            Fault::Replace(other) => (byte, parity, framing) = (other, false, false),
            Fault::Drop => copies = 0,
            Fault::Duplicate => copies += 1,
            Fault::Insert(byte) => read.push(Cell { byte, error: false }),
            Fault::Break => (byte, framing) = (0, true),
        }
    }
    let error = parity || framing;
    for _ in 0..copies {
        read.push(Cell { byte, error });
    }
}

/// ND21 9.6: the sum; 00 is reserved for error messages, 01 is sent instead.
fn check_sum(bytes: impl Iterator<Item = u8>) -> u8 {
    bytes.fold(0, u8::wrapping_add).max(1)
}

#[cfg(test)]
mod tests;
