//! The frame control octet, and how a slave tells a new request from a repeated one (EN 1).

/// The frame control octet (FC). Bit 7 is reserved and 0 in every telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FrameControl(pub u8);

impl FrameControl {
    /// A request.
    #[must_use]
    pub const fn request(function: FcFunction, sequence: Sequence) -> Self {
        Self(0x40 | sequence.bits() | function.code())
    }

    /// A reply of a slave.
    #[must_use]
    pub const fn reply(status: FcStatus) -> Self {
        Self(status.code())
    }

    /// Whether this is a request: bit 6.
    #[must_use]
    pub const fn is_request(self) -> bool {
        self.0 & 0x40 != 0
    }

    /// The frame count bit of a request: bit 5.
    #[must_use]
    pub const fn fcb(self) -> bool {
        self.0 & 0x20 != 0
    }

    /// Whether the frame count bit of a request counts: bit 4.
    #[must_use]
    pub const fn fcv(self) -> bool {
        self.0 & 0x10 != 0
    }

    /// The function of a request; `None` for a reply and for a code that no station knows.
    #[must_use]
    pub fn function(self) -> Option<FcFunction> {
        let code = self.0 & 0x0F;
        let known = FcFunction::ALL
            .into_iter()
            .find(|function| function.code() == code);
        known.filter(|_| self.is_request())
    }

    /// The status of a reply; `None` for a request and for a code that a DP slave does not send. Bits 5 and 4 (the kind of station) are not read.
    #[must_use]
    pub fn status(self) -> Option<FcStatus> {
        let code = self.0 & 0x0F;
        let known = FcStatus::ALL
            .into_iter()
            .find(|status| status.code() == code);
        known.filter(|_| !self.is_request())
    }
}

/// What a request asks for: bits 3 to 0 of its FC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FcFunction {
    /// Send data with acknowledgement, low priority: 3.
    SdaLow,
    /// Send data without acknowledgement, low: 4.
    SdnLow,
    /// Send data with acknowledgement, high: 5.
    SdaHigh,
    /// Send data without acknowledgement, high: 6.
    SdnHigh,
    /// FDL status: 9.
    FdlStatus,
    /// Send and request data, low: C.
    SrdLow,
    /// Send and request data, high: D.
    SrdHigh,
    /// Identification: E.
    Ident,
    /// Status of a service access point: F.
    LsapStatus,
}

impl FcFunction {
    /// Every function that stations know; a request with another one is not answered.
    pub const ALL: [Self; 9] = [
        Self::SdaLow,
        Self::SdnLow,
        Self::SdaHigh,
        Self::SdnHigh,
        Self::FdlStatus,
        Self::SrdLow,
        Self::SrdHigh,
        Self::Ident,
        Self::LsapStatus,
    ];

    /// The four bits.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::SdaLow => 3,
            Self::SdnLow => 4,
            Self::SdaHigh => 5,
            Self::SdnHigh => 6,
            Self::FdlStatus => 9,
            Self::SrdLow => 12,
            Self::SrdHigh => 13,
            Self::Ident => 14,
            Self::LsapStatus => 15,
        }
    }

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SdaLow => "SDA low",
            Self::SdnLow => "SDN low",
            Self::SdaHigh => "SDA high",
            Self::SdnHigh => "SDN high",
            Self::FdlStatus => "FDL status",
            Self::SrdLow => "SRD low",
            Self::SrdHigh => "SRD high",
            Self::Ident => "ident",
            Self::LsapStatus => "LSAP status",
        }
    }

    /// SRD, low or high: the slave treats both alike.
    #[must_use]
    pub const fn is_srd(self) -> bool {
        matches!(self, Self::SrdLow | Self::SrdHigh)
    }

    /// SDN, low or high: never answered.
    #[must_use]
    pub const fn is_sdn(self) -> bool {
        matches!(self, Self::SdnLow | Self::SdnHigh)
    }
}

/// The status in a reply: bits 3 to 0 of its FC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FcStatus {
    /// 00: OK.
    Ok,
    /// 03: no service activated (RS).
    Rs,
    /// 08: data (DL).
    DataLow,
    /// 0A: data, and a diagnosis waits (DH).
    DataHigh,
}

impl FcStatus {
    /// Every status that a DP slave sends.
    pub const ALL: [Self; 4] = [Self::Ok, Self::Rs, Self::DataLow, Self::DataHigh];

    /// The four bits.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Ok => 0,
            Self::Rs => 3,
            Self::DataLow => 8,
            Self::DataHigh => 10,
        }
    }

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::Rs => "RS",
            Self::DataLow => "DL",
            Self::DataHigh => "DH",
        }
    }
}

/// How a request says whether it is new: FCV and FCB.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sequence {
    /// 4x: new, and the slave forgets its record.
    #[default]
    None,
    /// 6x: new, the first of a sequence.
    First,
    /// 5x or 7x: new if the frame count bit differs from the record's.
    Counted(bool),
}

impl Sequence {
    /// FCB and FCV in their places.
    const fn bits(self) -> u8 {
        match self {
            Self::None => 0x00,
            Self::First => 0x20,
            Self::Counted(false) => 0x10,
            Self::Counted(true) => 0x30,
        }
    }

    /// Of the next new request to the same slave: First, 5x, 7x, 5x, ...
    #[must_use]
    pub const fn next(self) -> Self {
        match self {
            Self::None => Self::First,
            Self::First => Self::Counted(false),
            Self::Counted(bit) => Self::Counted(!bit),
        }
    }
}

impl From<FrameControl> for Sequence {
    fn from(control: FrameControl) -> Self {
        match (control.fcv(), control.fcb()) {
            (false, false) => Self::None,
            (false, true) => Self::First,
            (true, bit) => Self::Counted(bit),
        }
    }
}

/// What a slave remembers of the last counted request: one record for all masters (a decision of ours).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Fcb(Option<(u8, bool)>);

impl Fcb {
    /// Takes note of a request of station `sa`. `true` if it repeats the last one: its reply is sent again and nothing is executed.
    #[must_use]
    pub fn repeats(&mut self, sa: u8, control: FrameControl) -> bool {
        let now = match Sequence::from(control) {
            Sequence::None => None,
            Sequence::First => Some((sa, true)),
            Sequence::Counted(bit) => {
                if self.0 == Some((sa, bit)) {
                    return true;
                }
                Some((sa, bit))
            }
        };
        self.0 = now;
        false
    }

    /// Forgets the last request.
    pub fn forget(&mut self) {
        self.0 = None;
    }
}
