//! The digital outputs that `WriteIO` changes (ND21 10.4).

/// One of the digital outputs that `WriteIO` reaches (ND21 10.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Output {
    /// GPO1, X3 pin 31.
    Gpo1,
    /// GPO2, X3 pin 23.
    Gpo2,
}

/// What `WriteIO` asks for (ND21 10.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct OutputChange {
    /// Which output.
    pub output: Output,
    /// Set (true) or cleared.
    pub set: bool,
}

impl OutputChange {
    /// The change that a code stands for: 00 clear GPO1, 01 set GPO1, 02 clear GPO2, 03 set GPO2.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Self> {
        let output = match code {
            0 | 1 => Output::Gpo1,
            2 | 3 => Output::Gpo2,
            _ => return None,
        };
        Some(Self {
            output,
            set: code & 1 == 1,
        })
    }

    /// The code on the bus.
    #[must_use]
    pub const fn code(self) -> u8 {
        let output = match self.output {
            Output::Gpo1 => 0,
            Output::Gpo2 => 2,
        };
        output | self.set as u8
    }
}
