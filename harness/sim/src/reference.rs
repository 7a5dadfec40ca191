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
enum State {
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
    state: State,
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

    /// Whether time-outs were monitored at any time (bit 2 of `Flags2`, ND21 14.10.2), be they not any more: from there on silence may have
    /// done what this model does not know (9.9).
    #[must_use]
    pub fn has_monitored(&self) -> bool {
        self.monitored
    }

    /// Fetches what was executed since the last call, oldest first: commands without their checking byte; 00 and two bytes
    /// for process data, as 00 begins no command (ND21 9.5).
    pub fn take_executed(&mut self) -> Vec<Bytes> {
        std::mem::take(&mut self.executed)
    }

    /// Forgets a command received in half.
    pub fn forget_half(&mut self) {
        self.command.clear();
        self.answer.clear();
    }

    /// Takes the process data that are under way for received, and executes nothing (ND21 9.4).
    pub fn forget_process_data(&mut self) {
        if let State::Net(left, process, addressed) = self.state {
            self.state = match left - process {
                0 => State::Sync,
                left => State::Net(left, 0, addressed),
            };
        }
    }

    /// Silence for 10 ms: the error mode, in which increments begin with the "*" (ND21 9.9).
    pub fn time_out(&mut self) {
        if !self.in_error() {
            self.state = State::Error;
            self.zeros_received = 0;
            self.preceding = false;
            self.matched = 0;
        }
        self.zeros_sent = 17;
    }

    /// Whether the drive is in error mode (ND21 9.7).
    #[must_use]
    pub fn in_error(&self) -> bool {
        matches!(self.state, State::Error)
    }

    /// Takes one byte off the line, gives the byte sent for it; only PAUSE gets none (ND21 9, 9.2).
    pub fn receive(&mut self, cell: Cell) -> Option<u8> {
        let reply = match (self.state, cell.byte) {
            (State::Error, _) => return Some(self.error_mode(cell)),
            // ND21 9.7: parity and framing are checked by every drive, addressed or not.
            _ if cell.error => Err(0x0502),
            (State::Sync, 0x80) => Ok(0x80),    // SYNCO
            (State::Sync, 0x81) => return None, // PAUSE
            (State::Sync, byte) => self.sync_byte(byte),
            (State::Address(net, process), byte) => {
                self.address_valid = true;
                self.begin(byte.wrapping_add(1), net, process);
                Ok(byte.wrapping_add(1))
            }
            (State::Net(left, process, addressed), byte) => {
                self.state = match left {
                    1 => State::Sync,
                    _ => State::Net(left - 1, process.saturating_sub(1), addressed),
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
            self.state = State::Error;
            self.error_mode(cell)
        }))
    }

    /// ND21 9.2: `1 N S 0 T2 T1 T0 D`, forwarded unchanged; a short telegram uses the sum kept.
    fn sync_byte(&mut self, byte: u8) -> Result<u8, u16> {
        let (net, process) = ((byte >> 1) & 7, (byte & 1) * 2);
        match byte & 0xF0 {
            0x80 if net >= process => self.state = State::Address(net, process),
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
            self.state = State::Net(net, process, self.address_valid && sum == 0);
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
        self.state = State::Sync;
        self.address_valid = false;
        self.process = (0, 0);
        self.forget_half();
        self.fetched = [0; 4];
        (self.zeros_received, self.zeros_sent) = (0, 0);
        (self.preceding, self.matched) = (false, 0);
    }

    /// ND21 9.7, 9.8: from the offending byte on, zeros, then increments, until the check sequence.
    fn error_mode(&mut self, cell: Cell) -> u8 {
        let good = |byte| !cell.error && cell.byte == byte;
        // "*": eight good zeros in a row show the preceding drive in error mode; remembered.
        self.zeros_received = match good(0) {
            true => self.zeros_received.saturating_add(1),
            false => 0,
        };
        self.preceding |= self.zeros_received >= 8;
        if self.preceding {
            // "@": the check sequence passes; a byte that breaks it off may begin it anew.
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
    let mut links = Vec::with_capacity(drives.len() + 1);
    let mut outbound = Vec::with_capacity(sent.len() + faults.len());
    links.push(transmit(0, sent, faults));
    for (drive, link) in drives.iter_mut().zip(1..) {
        let inbound: &Vec<Cell> = &links[link - 1];
        outbound.clear();
        outbound.extend(inbound.iter().filter_map(|cell| drive.receive(*cell)));
        links.push(transmit(link, &outbound, faults));
    }
    links
}

/// What is read of the bytes transmitted on one link.
fn transmit(link: usize, sent: &[u8], faults: &[(usize, usize, Fault)]) -> Vec<Cell> {
    let mut read = Vec::with_capacity(sent.len() + faults.len());
    for (&byte, number) in sent.iter().zip(1..) {
        let (mut byte, mut parity, mut framing, mut copies) = (byte, false, false, 1);
        for (_, _, fault) in faults.iter().filter(|at| (at.0, at.1) == (link, number)) {
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
        read.extend(std::iter::repeat_n(Cell { byte, error }, copies));
    }
    read
}

/// ND21 9.6: the sum; 00 is reserved for error messages, 01 is sent instead.
fn check_sum(bytes: impl Iterator<Item = u8>) -> u8 {
    bytes.fold(0, u8::wrapping_add).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    // The columns of the printed tables, one a line: master, drives 99 to 95 (drive 98 as drive 97
    // reads it), drive 0. The print of 9.7 ends with row 18; its five telegrams go on to row 30.
    const LINKS: [usize; 7] = [0, 1, 2, 3, 4, 5, 100];
    const TABLE_9_7: &str = "\
        88 FB C0 13 FE D1 88 FC C0 13 FE D1 88 FD C0 13 FE D1 88 FE C0 13 FE D1 88 FF C0 13 FE D1
        88 FC C0 13 FE D1 88 FD C0 13 FE D1 88 FE C0 13 FE D1 88 FF C0 13 FE D1 88 00 C0 13 88 A5
        88 FD C0 13 FE D1 88 FE C0 12 FE D1 88 FF C0 13 FE D1 88 00 C0 13 88 A5 88 01 C0 13 88 A5
        88 FE C0 13 FE D1 88 FF C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00
        88 FF C0 13 FE D1 88 00 C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 01 01 01
        88 00 C0 13 88 A5 88 01 C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 02
        88 5F C0 13 88 A5 88 60 C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 61";
    const TABLE_9_8: &str = "\
        88 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 FF 44 72 4C 41 88 FC C0 13 FE D1
        88 01 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 FF 44 72 4C 41 88 FD C0 13 FE D1
        88 02 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 FF 44 72 4C 41 88 FE C0 13 FE D1
        00 00 00 00 00 00 00 00 00 01 01 01 01 01 01 01 01 01 FF 44 72 4C 41 88 FF C0 13 FE D1
        01 01 01 01 01 01 01 01 01 02 02 02 02 02 02 02 02 02 FF 44 72 4C 41 88 00 C0 13 88 A5
        02 02 02 02 02 02 02 02 02 03 03 03 03 03 03 03 03 03 FF 44 72 4C 41 88 01 C0 13 88 A5
        61 61 61 61 61 61 61 61 61 62 62 62 62 62 62 62 62 62 FF 44 72 4C 41 88 60 C0 13 88 A5";

    fn bytes(text: &str) -> Vec<u8> {
        let byte = |word| u8::from_str_radix(word, 16).unwrap();
        text.split_whitespace().map(byte).collect()
    }

    /// What these links carry, the first line being what the master sends.
    fn check(ring: &mut [Drive], faults: &[(usize, usize, Fault)], links: &[usize], table: &str) {
        let columns: Vec<_> = table.lines().map(bytes).collect();
        let cells = run(ring, &columns[0], faults);
        for (link, column) in links.iter().zip(columns) {
            let read: Vec<u8> = cells[*link].iter().map(|cell| cell.byte).collect();
            assert_eq!(read, column, "link {link}");
        }
    }

    /// ND21 9.7 and 9.8: the second table goes on where the first one ends.
    #[test]
    fn byte_tables() {
        let mut drive = Drive::new();
        drive.poke(0xFE13, 0x88);
        let mut ring = vec![drive; 100];
        let fault = (2, 10, Fault::Flip(1, false, false));
        check(&mut ring, &[fault], &LINKS, TABLE_9_7);
        assert_eq!(ring.iter().position(Drive::in_error), Some(2));
        check(&mut ring, &[], &LINKS, TABLE_9_8);
        assert_eq!(ring.iter().position(Drive::in_error), None);
    }

    /// ND21 9.2, 9.4: no short address after power-up, then drive 0, the next, the same; PAUSE.
    #[test]
    fn short_telegrams_and_process_data() {
        let mut ring = [Drive::new(), Drive::new()];
        let table = "A2 55 85 FE 12 34 E5 56 78 81 A5 9A BC 80
            A2 55 85 FF 12 34 E5 00 00 A5 56 78 80
            A2 55 85 00 00 00 E5 00 00 A5 56 78 80";
        ring[0].poke(0xFF32, 8);
        ring[0].poke(0xFF34, 8);
        check(&mut ring, &[], &[0, 1, 2], table);
        assert_eq!([ring[0].peek(0xFF08), ring[0].peek(0xFF09)], [0x9A, 0xBC]);
    }

    /// ND21 8.3: what one byte, 05, turns into.
    #[test]
    fn line_faults() {
        let check = |fault, expected: &[(u8, bool)]| {
            let read = transmit(0, &[5], &[(0, 1, fault)]);
            let read: Vec<_> = read.iter().map(|cell| (cell.byte, cell.error)).collect();
            assert_eq!(read, expected, "{fault:?}");
        };
        check(Fault::Flip(3, false, false), &[(6, false)]);
        check(Fault::Flip(1, true, false), &[(4, false)]);
        check(Fault::Flip(3, true, false), &[(6, true)]);
        check(Fault::Flip(3, false, true), &[(6, true)]);
        check(Fault::Replace(6), &[(6, false)]);
        check(Fault::Drop, &[]);
        check(Fault::Duplicate, &[(5, false), (5, false)]);
        check(Fault::Insert(6), &[(6, false), (5, false)]);
        check(Fault::Break, &[(0, true)]);
    }

    /// Cells from `at` on before and after an exchange; then bytes of which the last is refused, so
    /// that no zeros are heard but those of the address byte and of the last byte.
    fn command(at: u16, before: &str, after: &str, exchange: &str, refused: &str, code: u8) {
        let mut ring = [Drive::new()];
        for (cell, byte) in (at..).zip(bytes(before)) {
            ring[0].poke(cell, byte);
        }
        check(&mut ring, &[], &[0, 1], exchange);
        let mut cells = (at..).zip(bytes(after));
        assert!(cells.all(|(cell, byte)| ring[0].peek(cell) == byte));
        let heard = run(&mut ring, &bytes(refused), &[]).remove(1);
        assert_eq!(heard.iter().filter(|cell| cell.byte == 0).count(), 2);
        assert_eq!([ring[0].peek(0xFD82), ring[0].peek(0xFD83)], [5, code]);
    }

    macro_rules! commands {
        ($($name:ident $($case:literal)*;)*) => {
            $(#[test] fn $name() { command($($case),*); })*
        };
    }
    commands! {
        read_byte 0x2FBF "12" "" "88 FF C0 BF 2F AE\n88 00 C0 BF 12 6F" "86 FF C0 C0 2F" 6;
        read_word 0xFF7E "12 34" "" "8A FF C1 7E FF 3F 7D\n8A 00 C1 7E 34 12 7B" "86 FF C1 7F FF" 6;
        read_long 0xFF7C "01 02 03 04" "" "8C FF C7 7C FF 31 32 A5\n8C 00 C7 7C 01 02 03 04" "88 FF C7 7C FF 30" 6;
        write_byte 0xFD80 "11" "5A" "8A FF 82 5A 80 FD 59\n8A 00 82 5A 80 FD A7" "88 FF 82 5A 80 FF" 6;
        write_word 0xFF7E "" "12 34" "8C FF 63 34 12 7E FF 26\n8C 00 63 34 12 7E FF DA" "8A FF 63 34 12 7F FF" 6;
        and 0xFF7F "5A" "0A" "88 FF A4 0F 7F 32\n88 00 A4 0F 7F CE" "86 FF A4 0F 80" 6;
        or 0xFF00 "24" "7F" "88 FF A5 5B 00 01\n88 00 A5 5B 00 01" "88 FF A5 0F 7F 32" 7;
        write_io_1_2 0xFFB7 "28" "88" "8C FF C8 01 C9 C8 02 CA\n8C 00 C8 01 37 C8 02 36" "84 FF C8 04" 6;
        write_io_0_3 0xFFB7 "88" "28" "8C FF C8 00 C8 C8 03 CB\n8C 00 C8 00 38 C8 03 35" "82 FF C8 90" 4;
        reset_h8 0xFD80 "11 22" "00 00" "86 FF DD 21 FE A2 55\n86 00 DD 21 02 A2 55" "82 FF 83" 5;
    }
}
