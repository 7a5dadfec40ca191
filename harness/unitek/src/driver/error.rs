//! Why a call to a drive came to nothing.

use crate::rig::Axis;
use harness_bench::counted::counted;
use harness_bench::link::Trouble;
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::{Data, Reply};
use harness_proto::unitek::master::{JobRefusal, Outcome};

/// Why a call to a drive came to nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Error {
    #[error(
        "drive {node} does not answer for register {register:02X} ({}): {}, no reply; check its identifiers, the bit rate and its power",
        name(*.register),
        counted(*.tries, "request")
    )]
    NoReply {
        node: u8,
        register: u8,
        /// How often it was asked.
        tries: u8,
    },
    #[error(
        "drive {node}, register {register:02X} ({}): wrote {}, reads {}",
        name(*.register), hex(*.wrote), hex(.reads.data)
    )]
    Differs {
        node: u8,
        register: u8,
        wrote: Data,
        reads: Reply,
    },
    #[error(
        "drive {node} was not released: register {:02X} ({}) reads {}, 1 expected{}",
        .reads.register, name(.reads.register), hex(.reads.data), hint(.reads.register)
    )]
    NotReady { node: u8, reads: Reply },
    /// A drive behaves in another way than the profile of the rig's file says.
    #[error(
        "drive {node} has {property} = {shows}, and the profile of the rig's file says {says}: the profile is of another drive; qualify this one, or take `profile` out of the file"
    )]
    OtherThanProfile {
        node: u8,
        property: &'static str,
        says: String,
        shows: String,
    },
    #[error(
        "drive {node}: its BUS-TIMEOUT stays: neither 8E (FUN_ERRCANCEL) nor a lock and its release clears it (UNITEK dump)"
    )]
    TimeOutStays { node: u8 },
    #[error("{0}")]
    Refused(JobRefusal),
    #[error("the bench has no drive {0}")]
    NoSuchDrive(u8),
    #[error("{0}")]
    Link(Trouble),
}

impl Error {
    /// The error of an outcome that is none of success.
    pub(super) fn of(axis: Axis, register: u8, outcome: Outcome) -> Self {
        let node = axis.node;
        match outcome {
            Outcome::Differs { wrote, reads } => Self::Differs {
                node,
                register: reads.register,
                wrote,
                reads,
            },
            Outcome::NotReady(reads) => Self::NotReady { node, reads },
            Outcome::NoReply { tries } => Self::NoReply {
                node,
                register,
                tries,
            },
            Outcome::Read(_)
            | Outcome::Written(_)
            | Outcome::Sent
            | Outcome::Started(_)
            | Outcome::Released => Self::NoReply {
                node,
                register,
                tries: 0,
            },
        }
    }
}

fn name(register: u8) -> &'static str {
    Register::of(register).name
}

fn hint(register: u8) -> &'static str {
    match register {
        0xE2 => ": look at its errors (8F) and its power",
        0xE8 => ": close the hardware enable (FRG)",
        _ => "",
    }
}

/// The digits of a value as wide as it was sent.
pub(crate) fn hex(data: Data) -> String {
    match data {
        Data::Short(value) => format!("{value:04X}"),
        Data::Long(value) => format!("{value:08X}"),
    }
}
