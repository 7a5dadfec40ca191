//! CRC and stuff bits of a frame (ISO 11898-1), a byte at a time.

/// x15 + x14 + x10 + x8 + x7 + x4 + x3 + 1.
const CRC_POLYNOMIAL: u16 = 0x4599;

/// Counts the bits of a frame with their stuff bits, and computes the CRC over the bits without them.
pub(super) struct Coder {
    /// Bits so far, without stuff bits.
    pub(super) bits: u32,
    /// Stuff bits so far.
    pub(super) stuffed: u32,
    /// CRC of the bits so far.
    pub(super) crc: u16,
    line: Stuffing,
}

/// What the stuffing of further bits depends on.
#[derive(Clone, Copy)]
struct Stuffing {
    last: u8,
    /// Equal bits at the end of what is on the wire, stuff bits included: 0 to 4.
    run: u8,
}

impl Stuffing {
    const FREE: Self = Self { last: 1, run: 0 };

    /// The next bit; whether a stuff bit follows it.
    const fn push(self, bit: u8) -> (Self, bool) {
        let run = if bit == self.last { self.run + 1 } else { 1 };
        if run == 5 {
            // The stuff bit is the opposite one, and the first of a run.
            let last = 1 - bit;
            (Self { last, run: 1 }, true)
        } else {
            (Self { last: bit, run }, false)
        }
    }

    const fn index(self) -> usize {
        (self.last * 5 + self.run) as usize
    }
}

/// For each state of the stuffing and each byte: the next state and the stuff bits.
static STUFFING: [[(Stuffing, u8); 256]; 10] = {
    let mut table = [[(Stuffing::FREE, 0); 256]; 10];
    let mut state = 0;
    while state < 10 {
        let mut byte = 0;
        while byte < 256 {
            let mut line = Stuffing {
                last: state as u8 / 5,
                run: state as u8 % 5,
            };
            let mut stuffed = 0;
            let mut place = 8;
            while place > 0 {
                place -= 1;
                let (next, more) = line.push((byte >> place & 1) as u8);
                line = next;
                stuffed += more as u8;
            }
            table[state][byte] = (line, stuffed);
            byte += 1;
        }
        state += 1;
    }
    table
};

/// The CRC of each byte.
static CRC: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 7;
        let mut bit = 0;
        while bit < 8 {
            crc = next_crc(crc, 0);
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

const fn next_crc(crc: u16, bit: u16) -> u16 {
    let shifted = crc << 1 & 0x7FFF;
    if crc >> 14 & 1 == bit {
        shifted
    } else {
        shifted ^ CRC_POLYNOMIAL
    }
}

impl Default for Coder {
    fn default() -> Self {
        Self {
            bits: 0,
            stuffed: 0,
            crc: 0,
            line: Stuffing::FREE,
        }
    }
}

impl Coder {
    /// Appends the lowest `count` bits of `value`, most significant first: single bits, then whole bytes.
    pub(super) fn push(&mut self, value: u32, count: u32) {
        self.bits += count;
        let bytes = count / 8;
        for place in (8 * bytes..count).rev() {
            let bit = value >> place & 1;
            self.crc = next_crc(self.crc, bit as u16);
            let (line, stuffed) = self.line.push(bit as u8);
            self.line = line;
            self.stuffed += u32::from(stuffed);
        }
        for byte in value.to_be_bytes().into_iter().skip(4 - bytes as usize) {
            let index = (self.crc >> 7) as u8 ^ byte;
            self.crc = self.crc << 8 & 0x7FFF ^ CRC[usize::from(index)];
            let (line, stuffed) = STUFFING[self.line.index()][usize::from(byte)];
            self.line = line;
            self.stuffed += u32::from(stuffed);
        }
    }
}
