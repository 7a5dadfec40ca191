//! What a write to the EEPROM would take (ND21 14.10.5).

/// Bit 5 of `EEPROMcontrol`: a byte has been read (14.10.5.2).
const READ: u8 = 1 << 5;

/// `EEPROMbuffer` of a drive: address and byte, as far as they are known.
///
/// A drive that reads a byte (81) puts it over the address whenever it has it. Until an answer has shown that it has, nothing is
/// known of the buffer, whatever is written there (14.10.5.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct EepromBuffer {
    bytes: [Option<u8>; 2],
    /// A read may be under way.
    reading: bool,
    /// How many reads were begun.
    reads: u32,
}

impl EepromBuffer {
    /// Address and byte that a write would take.
    pub(super) const fn bytes(&self) -> [Option<u8>; 2] {
        self.bytes
    }

    /// How many reads were begun.
    pub(super) const fn reads(&self) -> u32 {
        self.reads
    }

    /// A byte was written, or is not known any more.
    pub(super) fn write(&mut self, place: usize, byte: Option<u8>) {
        if let Some(place) = self.bytes.get_mut(place) {
            *place = byte.filter(|_| !self.reading);
        }
    }

    /// 81 was sent.
    pub(super) fn read(&mut self) {
        self.forget();
        self.reading = true;
        self.reads = self.reads.wrapping_add(1);
    }

    /// `EEPROMcontrol` held this when it was read behind this number of reads.
    pub(super) fn control(&mut self, reads: u32, control: u8) {
        if reads == self.reads && control & READ != 0 {
            self.reading = false;
        }
    }

    /// What was written is not known any more.
    pub(super) fn forget(&mut self) {
        self.bytes = [None; 2];
    }
}
