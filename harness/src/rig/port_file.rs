//! `[port.1]` of a rig file: a port of a CAN bus, on which all stations hear each other.

use crate::file::values::Time;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::buses::PortBus;

/// The ports of a bench.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ports {
    /// The only port.
    #[serde(rename = "1")]
    pub first: Port,
}

/// The bench's own place on a CAN bus.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Port {
    /// The bus.
    pub bus: PortBus,
    /// An SLCAN adapter: a device such as `/dev/ttyACM0`, or `host:port` of one behind a network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slcan: Option<String>,
    /// A socketcand server: `host:port`, usually port 29536.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub socketcand: Option<String>,
    /// The bus of the socketcand server; default `can0`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    /// A CAN interface of the Linux kernel, such as `can0`, in builds with the feature `socketcan`. Its rate and listen-only are set by
    /// `ip link`. Never tried on a kernel with CAN.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub socketcan: Option<String>,
    /// The bit rate in kbit/s; default 500.
    #[serde(default = "half_a_megabit")]
    #[schemars(range(min = 10, max = 1000))]
    pub rate: u32,
    /// Its drives, by number or by identifiers: `[{ node = 1 }, { rx = 0x210, tx = 0x190 }]`.
    #[schemars(length(min = 1, max = 127))]
    pub drives: Vec<Node>,
    /// Whether nothing is ever sent, not even an acknowledgement where the adapter can do without; default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub listen_only: bool,
    /// How long a reply may take; default 20ms.
    #[serde(default = "twenty_milliseconds")]
    pub patience: Time,
}

impl Port {
    /// Whether its adapter carries remote frames: socketcand has no words for them.
    #[must_use]
    pub const fn carries_remote_frames(&self) -> bool {
        self.socketcand.is_none()
    }

    /// The keys of the adapters that are given: one, or none where the drives are simulated.
    #[must_use]
    pub fn adapters(&self) -> Vec<&'static str> {
        let all = [
            ("slcan", &self.slcan),
            ("socketcand", &self.socketcand),
            ("socketcan", &self.socketcan),
        ];
        let given = all.into_iter().filter(|(_, place)| place.is_some());
        given.map(|(key, _)| key).collect()
    }
}

/// A drive on a bus, by its number or by its identifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// Its number, 1 to 127, from which its identifiers follow; default the place in this list, counted from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 127))]
    pub node: Option<u8>,
    /// The identifier on which it receives, 1 to 0x7FF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 0x7FF))]
    pub rx: Option<u16>,
    /// The identifier on which it sends, 1 to 0x7FF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 0x7FF))]
    pub tx: Option<u16>,
}

/// What only benches with `[port.1]` permit, in `[limits]`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(default)]
pub struct PortLimits {
    /// Whether identifiers, bit rate, width of replies and time-out of drives may be changed; default false.
    #[serde(skip_serializing_if = "is_false")]
    pub allow_bus_settings: bool,
    /// Whether frames may be sent that no drive of the file receives; default false.
    #[serde(skip_serializing_if = "is_false")]
    pub allow_other_identifiers: bool,
    /// Special registers that may be written, by name or number, such as `["0x85"]`; default none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 16))]
    pub allow_registers: Vec<String>,
    /// How a drive with another bit rate is reached again, in a sentence. Without it the bit rate cannot be changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit_rate_way_back: Option<String>,
    /// Confirms that changed bus settings may be stored in the EEPROM. It must read
    /// `the drive may then be reachable by RS232 only`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub store_bus_settings: Option<String>,
}

/// What [`PortLimits::store_bus_settings`] must read.
pub const CONFIRMATION: &str = "the drive may then be reachable by RS232 only";

const fn half_a_megabit() -> u32 {
    500
}

fn twenty_milliseconds() -> Time {
    Time(std::time::Duration::from_millis(20))
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
const fn is_false(value: &bool) -> bool {
    !*value
}
