//! A single drive without a ring: cells, inputs and time.

use harness_proto::nd21::io::Input;
use harness_proto::nd21::{bits, ram};
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::{Instant, Span};
use harness_sim::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory, set_parity};
use harness_sim::novobus::device::Device;

/// A drive on the bench.
pub(crate) struct Rig {
    pub(crate) drive: Nd21Drive,
    pub(crate) now: Instant,
}

impl Rig {
    /// A drive as delivered with an EEPROM changed by `change`, after its self-test.
    pub(crate) fn with(properties: Nd21Properties, change: impl FnOnce(&mut [u8; 256])) -> Self {
        let mut eeprom = factory::eeprom();
        change(&mut eeprom);
        set_parity(&mut eeprom);
        let mut rig = Self {
            drive: Nd21Drive::new(Properties::default(), properties, eeprom),
            now: Instant::START,
        };
        rig.run(Span::from_millis(101));
        rig
    }

    /// A drive as delivered, released and started.
    pub(crate) fn started() -> Self {
        let mut rig = Self::with(Nd21Properties::default(), |_| {});
        rig.input(Input::Gpin3, true);
        rig.input(Input::Gpin5, true);
        rig.clear(ram::STATUS, bits::status::BLOCK);
        rig.run(Span::from_millis(1));
        rig
    }

    pub(crate) fn run(&mut self, span: Span) {
        self.now += span;
        self.drive.advance(self.now);
    }

    /// Runs for `count` cycles of 432 us.
    pub(crate) fn cycles(&mut self, count: u64) {
        self.run(Span::from_micros(432) * count);
    }

    /// Cycles until `done`, at most `most`.
    pub(crate) fn until(&mut self, most: u64, mut done: impl FnMut(&Self) -> bool) -> u64 {
        for count in 0..most {
            if done(self) {
                return count;
            }
            self.cycles(1);
        }
        panic!("not done after {most} cycles");
    }

    pub(crate) fn input(&mut self, input: Input, high: bool) {
        self.drive.stimulate(Stimulus::Input(input, high));
    }

    pub(crate) fn byte(&self, address: u16) -> u8 {
        self.drive.program().cells().peek(address)
    }

    pub(crate) fn word(&self, address: u16) -> u16 {
        u16::from_be_bytes([self.byte(address), self.byte(address + 1)])
    }

    pub(crate) fn signed(&self, address: u16) -> i16 {
        self.word(address).cast_signed()
    }

    /// The four bytes at `address` as a number with a sign.
    pub(crate) fn long(&self, address: u16) -> i32 {
        (u32::from(self.word(address)) << 16 | u32::from(self.word(address + 2))).cast_signed()
    }

    /// Writes as the bus does.
    pub(crate) fn write(&mut self, address: u16, byte: u8) {
        self.drive.program_mut().write(address, byte);
    }

    pub(crate) fn write_word(&mut self, address: u16, word: u16) {
        let [high, low] = word.to_be_bytes();
        self.write(address, high);
        self.write(address + 1, low);
    }

    pub(crate) fn set(&mut self, address: u16, bits: u8) {
        self.write(address, self.byte(address) | bits);
    }

    pub(crate) fn clear(&mut self, address: u16, bits: u8) {
        self.write(address, self.byte(address) & !bits);
    }
}
