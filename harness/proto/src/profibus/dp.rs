//! The services of DP: service access points, and what their telegrams carry (EN 2).

use super::fdl::Buffer;
use core::fmt;

/// The SAP of the master's side of every service.
pub const MASTER_SAP: u8 = 62;

/// A service of a DP slave, by the SAP at the destination.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Service {
    /// No SAP: outputs go out, inputs come back.
    DataExchange,
    /// 55: a new address.
    SetSlaveAdd,
    /// 56: the inputs, for any master.
    RdInp,
    /// 57: the last outputs, for any master.
    RdOutp,
    /// 58: a command to one slave or to all, without answer.
    GlobalControl,
    /// 59: the configuration that the slave has.
    GetCfg,
    /// 60: diagnosis.
    SlaveDiag,
    /// 61: parameters: watchdog, ident number, groups.
    SetPrm,
    /// 62: the configuration that the master expects.
    ChkCfg,
}

impl Service {
    /// Every service.
    pub const ALL: [Self; 9] = [
        Self::DataExchange,
        Self::SetSlaveAdd,
        Self::RdInp,
        Self::RdOutp,
        Self::GlobalControl,
        Self::GetCfg,
        Self::SlaveDiag,
        Self::SetPrm,
        Self::ChkCfg,
    ];

    /// The SAP of the slave; `None` for [`DataExchange`](Self::DataExchange).
    #[must_use]
    pub const fn sap(self) -> Option<u8> {
        match self {
            Self::DataExchange => None,
            Self::SetSlaveAdd => Some(55),
            Self::RdInp => Some(56),
            Self::RdOutp => Some(57),
            Self::GlobalControl => Some(58),
            Self::GetCfg => Some(59),
            Self::SlaveDiag => Some(60),
            Self::SetPrm => Some(61),
            Self::ChkCfg => Some(62),
        }
    }

    /// The SAP of the master that asks; `None` for [`DataExchange`](Self::DataExchange).
    #[must_use]
    pub const fn master_sap(self) -> Option<u8> {
        match self {
            Self::DataExchange => None,
            _ => Some(MASTER_SAP),
        }
    }

    /// The service with this SAP at the destination.
    #[must_use]
    pub fn of(dsap: Option<u8>) -> Option<Self> {
        Self::ALL.into_iter().find(|service| service.sap() == dsap)
    }

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::DataExchange => "Data_Exchange",
            Self::SetSlaveAdd => "Set_Slave_Add",
            Self::RdInp => "RD_Inp",
            Self::RdOutp => "RD_Outp",
            Self::GlobalControl => "Global_Control",
            Self::GetCfg => "Get_Cfg",
            Self::SlaveDiag => "Slave_Diag",
            Self::SetPrm => "Set_Prm",
            Self::ChkCfg => "Chk_Cfg",
        }
    }
}

/// States of a DP slave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DpState {
    /// Waits for Set_Prm; the state after power-up.
    #[default]
    WaitPrm,
    /// Waits for Chk_Cfg.
    WaitCfg,
    /// Exchanges data.
    DataExch,
}

impl DpState {
    /// As the standard writes it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::WaitPrm => "Wait_Prm",
            Self::WaitCfg => "Wait_Cfg",
            Self::DataExch => "Data_Exch",
        }
    }
}

/// The data of Set_Prm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetPrm<'a> {
    /// Bits 7 to 0 of octet 1, see the constants of this type.
    pub status: u8,
    /// The two factors of the watchdog: 10 ms x first x second.
    pub watchdog: [u8; 2],
    /// Bits between the end of a request and the begin of a reply; 0 leaves it unchanged, and 1 to 10 count as 11.
    pub min_tsdr: u8,
    /// The ident number of the device that the master expects.
    pub ident: u16,
    /// Groups that the slave is in, one bit a group.
    pub group: u8,
    /// What follows octet 7.
    pub user: &'a [u8],
}

impl<'a> SetPrm<'a> {
    /// The slave belongs to this master from now on.
    pub const LOCK: u8 = 0x80;
    /// The slave is free for other masters.
    pub const UNLOCK: u8 = 0x40;
    /// Sync is asked for.
    pub const SYNC: u8 = 0x20;
    /// Freeze is asked for.
    pub const FREEZE: u8 = 0x10;
    /// The watchdog is on.
    pub const WATCHDOG: u8 = 0x08;

    /// Locks, without watchdog, sync, freeze, groups and user data, with the default min T_SDR.
    #[must_use]
    pub const fn lock(ident: u16) -> Self {
        Self {
            status: Self::LOCK,
            watchdog: [0; 2],
            min_tsdr: 11,
            ident,
            group: 0,
            user: &[],
        }
    }

    /// Reads the data of the service; `None` if there are fewer than 7 octets.
    #[must_use]
    pub fn decode(data: &'a [u8]) -> Option<Self> {
        let [status, wd1, wd2, min_tsdr, high, low, group, user @ ..] = data else {
            return None;
        };
        Some(Self {
            status: *status,
            watchdog: [*wd1, *wd2],
            min_tsdr: *min_tsdr,
            ident: u16::from_be_bytes([*high, *low]),
            group: *group,
            user,
        })
    }

    /// The data of the service; `None` if there are more user data than a telegram holds.
    #[must_use]
    pub fn encode(&self) -> Option<Buffer> {
        let [high, low] = self.ident.to_be_bytes();
        let [wd1, wd2] = self.watchdog;
        let head = [self.status, wd1, wd2, self.min_tsdr, high, low, self.group];
        let mut all = Buffer::of(&head)?;
        all.extend(self.user).then_some(all)
    }

    /// Whether a bit of the status is 1.
    #[must_use]
    pub const fn has(&self, bit: u8) -> bool {
        self.status & bit != 0
    }

    /// The time of the watchdog in units of 10 ms; `None` where it is off.
    #[must_use]
    pub fn watchdog_tens_of_ms(&self) -> Option<u16> {
        let [wd1, wd2] = self.watchdog.map(u16::from);
        self.has(Self::WATCHDOG).then_some(wd1 * wd2)
    }
}

/// The reply to Slave_Diag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Diagnosis {
    /// Buffer 1 to 3, see the constants of this type.
    pub status: [u8; 3],
    /// The master that the slave belongs to; `None` is FF.
    pub master: Option<u8>,
    /// The ident number of the slave.
    pub ident: u16,
    /// The bits of the device block of 2 octets, if it is there.
    pub extension: Option<u8>,
}

impl Diagnosis {
    /// Octet 1: a master sets it where a slave does not answer.
    pub const NON_EXISTENT: u8 = 0x01;
    /// Octet 1: not exchanging.
    pub const NOT_READY: u8 = 0x02;
    /// Octet 1: Chk_Cfg was refused.
    pub const CFG_FAULT: u8 = 0x04;
    /// Octet 1: there is an extension.
    pub const EXT_DIAG: u8 = 0x08;
    /// Octet 1: Set_Prm was refused.
    pub const PRM_FAULT: u8 = 0x40;
    /// Octet 2: wants Set_Prm.
    pub const PRM_REQ: u8 = 0x01;
    /// Octet 2: always 1.
    pub const ALWAYS: u8 = 0x04;
    /// Octet 2: the watchdog is on.
    pub const WD_ON: u8 = 0x08;
    /// Octet 2: frozen.
    pub const FREEZE: u8 = 0x10;
    /// Octet 2: synchronised.
    pub const SYNC: u8 = 0x20;

    /// Reads a diagnosis of 6 octets, or of 8 with a device block of 2; `None` for other data.
    #[must_use]
    pub fn decode(data: &[u8]) -> Option<Self> {
        let [one, two, three, master, high, low, rest @ ..] = data else {
            return None;
        };
        let extension = match rest {
            [] => None,
            [2, bits] => Some(*bits),
            _ => return None,
        };
        Some(Self {
            status: [*one, *two, *three],
            master: (*master != 0xFF).then_some(*master),
            ident: u16::from_be_bytes([*high, *low]),
            extension,
        })
    }

    /// The data of the reply.
    #[must_use]
    pub fn encode(&self) -> Buffer {
        let [one, two, three] = self.status;
        let [high, low] = self.ident.to_be_bytes();
        let master = self.master.unwrap_or(0xFF);
        let mut all = Buffer::of(&[one, two, three, master, high, low]).unwrap_or_default();
        if let Some(bits) = self.extension {
            let _fits = all.extend(&[2, bits]);
        }
        all
    }

    /// Whether all of `bits` are 1 in octet 1.
    #[must_use]
    pub const fn has(&self, bits: u8) -> bool {
        self.status[0] & bits == bits
    }

    /// Whether all of `bits` are 1 in octet 2.
    #[must_use]
    pub const fn has_mode(&self, bits: u8) -> bool {
        self.status[1] & bits == bits
    }

    /// The names of the bits that are 1, octet 1 first.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        let [one, two, three] = self.status;
        DIAGNOSIS_BITS
            .iter()
            .filter(move |(octet, bit, _)| {
                [one, two, three][usize::from(*octet) - 1] >> bit & 1 == 1
            })
            .map(|(_, _, name)| *name)
    }
}

/// The bits of a diagnosis: octet, bit, name. Bit 2 of octet 2 is always 1 and has none.
pub const DIAGNOSIS_BITS: [(u8, u8, &str); 16] = [
    (1, 0, "Station_Non_Existent"),
    (1, 1, "Station_Not_Ready"),
    (1, 2, "Cfg_Fault"),
    (1, 3, "Ext_Diag"),
    (1, 4, "Not_Supported"),
    (1, 5, "Invalid_Slave_Response"),
    (1, 6, "Prm_Fault"),
    (1, 7, "Master_Lock"),
    (2, 0, "Prm_Req"),
    (2, 1, "Stat_Diag"),
    (2, 3, "WD_On"),
    (2, 4, "Freeze_Mode"),
    (2, 5, "Sync_Mode"),
    (2, 6, "Not_Present"),
    (2, 7, "Deactivated"),
    (3, 7, "Ext_Diag_Overflow"),
];

/// The data of Global_Control.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GlobalControl {
    /// The command, see the constants of this type.
    pub command: u8,
    /// The groups that it is for; 0 is every slave.
    pub group: u8,
}

impl GlobalControl {
    /// All outputs become 0.
    pub const CLEAR_DATA: u8 = 0x02;
    /// The inputs follow the device again.
    pub const UNFREEZE: u8 = 0x04;
    /// The inputs of this moment stay.
    pub const FREEZE: u8 = 0x08;
    /// The outputs become effective at once again.
    pub const UNSYNC: u8 = 0x10;
    /// The outputs of this moment become effective, and later ones wait.
    pub const SYNC: u8 = 0x20;

    /// Reads the two octets of the service; `None` for any other number of them.
    #[must_use]
    pub const fn decode(data: &[u8]) -> Option<Self> {
        match *data {
            [command, group] => Some(Self { command, group }),
            _ => None,
        }
    }

    /// The data of the service.
    #[must_use]
    pub const fn encode(self) -> [u8; 2] {
        [self.command, self.group]
    }

    /// Whether a slave in the groups `groups` obeys.
    #[must_use]
    pub const fn is_for(self, groups: u8) -> bool {
        self.group == 0 || self.group & groups != 0
    }

    /// Whether a bit of the command is 1.
    #[must_use]
    pub const fn has(self, bit: u8) -> bool {
        self.command & bit != 0
    }
}

/// One octet of a configuration in the compact form: how much, in which direction, consistent over what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CfgByte {
    /// From the slave to the master.
    pub inputs: bool,
    /// From the master to the slave.
    pub outputs: bool,
    /// Counted in words, not in octets.
    pub words: bool,
    /// Consistent as a whole, not unit by unit.
    pub whole: bool,
    /// How many units, 1 to 16.
    pub count: u8,
}

impl CfgByte {
    /// Reads one octet; `None` for the special form (bits 5 and 4 are 0).
    #[must_use]
    pub const fn decode(octet: u8) -> Option<Self> {
        if octet & 0x30 == 0 {
            return None;
        }
        Some(Self {
            inputs: octet & 0x10 != 0,
            outputs: octet & 0x20 != 0,
            words: octet & 0x40 != 0,
            whole: octet & 0x80 != 0,
            count: (octet & 0x0F) + 1,
        })
    }

    /// The octet; `None` if it has no direction, or a count outside 1 to 16.
    #[must_use]
    pub const fn encode(self) -> Option<u8> {
        if !(self.inputs || self.outputs) || self.count == 0 || self.count > 16 {
            return None;
        }
        Some(
            (self.whole as u8) << 7
                | (self.words as u8) << 6
                | (self.outputs as u8) << 5
                | (self.inputs as u8) << 4
                | (self.count - 1),
        )
    }

    /// Buffer in one direction.
    #[must_use]
    pub const fn octets(self) -> usize {
        self.count as usize * if self.words { 2 } else { 1 }
    }
}

impl fmt::Display for CfgByte {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let direction = match (self.inputs, self.outputs) {
            (true, true) => "inputs and outputs",
            (true, false) => "inputs",
            (false, true) => "outputs",
            (false, false) => "nothing",
        };
        let unit = if self.words { "words" } else { "octets" };
        write!(f, "{} {unit}, {direction}", self.count)?;
        if self.whole {
            f.write_str(", consistent as a whole")?;
        }
        Ok(())
    }
}
