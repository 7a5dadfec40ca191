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
    /// Answers on their way before the first one that tells of this read.
    earlier: u32,
}

impl EepromBuffer {
    /// Address and byte that a write would take.
    pub(super) const fn bytes(&self) -> [Option<u8>; 2] {
        self.bytes
    }

    /// Whether a read may be under way.
    pub(super) const fn reading(&self) -> bool {
        self.reading
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
        self.earlier = self.earlier.saturating_add(1);
    }

    /// A read was sent of a cell whose answer cannot be told from one of `EEPROMcontrol`: an answer has half the address (10.1).
    pub(super) fn read_alike(&mut self) {
        if self.reading {
            self.earlier = self.earlier.saturating_add(1);
        }
    }

    /// The answer to 81 has come.
    pub(super) fn read_answered(&mut self) {
        self.earlier = self.earlier.saturating_sub(1);
    }

    /// `EEPROMcontrol` was read, and held this.
    pub(super) fn control(&mut self, control: u8) {
        if self.earlier == 0 && control & READ != 0 {
            self.reading = false;
        }
    }

    /// A check sequence was sent; answers in front of it do not count any more.
    pub(super) fn recovered(&mut self) {
        self.earlier = 0;
    }

    /// What was written is not known any more.
    pub(super) fn forget(&mut self) {
        self.bytes = [None; 2];
    }
}
