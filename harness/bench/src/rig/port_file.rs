//! `[port.1]` of a rig file: a port of a bus on which all stations hear each other, on CAN or on a serial line.

use crate::bus_name::BusName;
use crate::file::values::{Hertz, KilobitRate, Percent, Time};
use crate::link::frames::AdapterPlace;
use crate::medium::ErrorMarks;
use crate::port::PortAddress;
use crate::rig::file::Transport;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The buses of `[port.1]` in a rig's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PortBus {
    /// UNITEK DS/BAMOCAR on CAN.
    Unitek,
    /// NORDAC *vector* on PROFIBUS DP.
    Nordac,
}

impl PortBus {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Unitek, Self::Nordac];

    /// The bus of its scenarios.
    #[must_use]
    pub const fn bus(self) -> BusName {
        match self {
            Self::Unitek => BusName::Unitek,
            Self::Nordac => BusName::Nordac,
        }
    }

    /// The name in a rig's file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.bus().name()
    }

    /// The most drives of a simulated bench: node 1 to 127; address 8 to 126.
    #[must_use]
    pub(crate) const fn most_drives(self) -> u8 {
        match self {
            Self::Unitek => 127,
            Self::Nordac => 119,
        }
    }
}

/// The ports of a bench.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ports {
    /// The only port.
    #[serde(rename = "1")]
    pub first: Port,
}

/// The bench's own place on the bus.
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
    /// A CAN interface of the Linux kernel, such as `can0`. Its rate and listen-only are set by `ip link`, and have to be those of this file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub socketcan: Option<String>,
    /// A serial adapter of a line of octets: a device such as `/dev/ttyUSB0`, or a pseudo terminal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// A line of octets behind a TCP connection that carries the octets and nothing else: `host:port`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tcp: Option<String>,
    /// In place of `serial` and `tcp`, what carries the octets: `serial`, `pty`, `tcp`, or `rfc2217` for a serial port behind a network, which
    /// cannot carry the value of a bad octet. It needs `port`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transport: Option<Transport>,
    /// Where `transport` leads: a device such as `/dev/ttyUSB0` (serial, pty), or `host:port` (tcp, rfc2217).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<String>,
    /// Whether line errors stand in the stream itself (a pseudo terminal or `tcp` only); default `none`.
    #[serde(default, skip_serializing_if = "is_unmarked")]
    pub marks: ErrorMarks,
    /// Whether a half-duplex adapter gives back what the bench sends; it is compared, and is no part of the record; default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub echo: bool,
    /// The bit rate in kbit/s; default 500. On CAN 10 to 1000; on a line of octets 9.6, 19.2, 93.75, 187.5, 500 or 1500.
    #[serde(default = "half_a_megabit")]
    pub rate: KilobitRate,
    /// Its drives: on CAN by number or by identifiers, `[{ node = 1 }, { rx = 0x210, tx = 0x190 }]`; on a line of octets by address,
    /// `[{ address = 8, ppo = 1 }]`.
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

    /// Its CAN adapter, if it has one.
    #[must_use]
    pub fn can_adapter(&self) -> Option<AdapterPlace> {
        let slcan = self.slcan.as_deref().map(AdapterPlace::slcan);
        let server = self.socketcand.clone();
        let server = server.map(|address| AdapterPlace::Socketcand {
            address,
            channel: self.channel.clone().unwrap_or_else(|| "can0".to_owned()),
        });
        let interface = self.socketcan.clone();
        let kernel = interface.map(|interface| AdapterPlace::Kernel { interface });
        slcan.or(server).or(kernel)
    }

    /// Its line of octets, if it has one.
    #[must_use]
    pub fn line(&self) -> Option<PortAddress> {
        let serial = |path: &String| match is_pseudo_terminal(path) {
            true => PortAddress::Pty(path.into()),
            false => PortAddress::Serial(path.into()),
        };
        let tcp = |address: &String| PortAddress::Tcp(address.clone());
        let named = self.port.as_ref().zip(self.transport);
        let named = named.and_then(|(port, transport)| match transport {
            Transport::Serial => Some(serial(port)),
            Transport::Pty => Some(PortAddress::Pty(port.into())),
            Transport::Tcp => Some(tcp(port)),
            Transport::Rfc2217 => Some(PortAddress::Rfc2217(port.clone())),
            Transport::Sim => None,
        });
        let given = self.serial.as_ref().map(serial);
        given.or(self.tcp.as_ref().map(tcp)).or(named)
    }

    /// The keys of the adapters that are given, and where these are: one, or none where the drives are simulated.
    pub fn places(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let all = [
            ("slcan", &self.slcan),
            ("socketcand", &self.socketcand),
            ("socketcan", &self.socketcan),
            ("serial", &self.serial),
            ("tcp", &self.tcp),
            ("port", &self.port),
        ];
        let given = all.into_iter();
        given.filter_map(|(key, place)| Some((key, place.as_deref()?)))
    }

    /// The keys of the adapters that are given.
    #[must_use]
    pub(crate) fn adapters(&self) -> Vec<&'static str> {
        self.places().map(|(key, _)| key).collect()
    }

    /// The other keys that are given and that only some buses have.
    #[must_use]
    pub(crate) fn more(&self) -> Vec<&'static str> {
        let all = [
            ("channel", self.channel.is_some()),
            ("transport", self.transport.is_some()),
            ("marks", self.marks != ErrorMarks::None),
            ("echo", self.echo),
        ];
        let given = all.into_iter().filter(|(_, given)| *given);
        given.map(|(key, _)| key).collect()
    }
}

/// Whether a device is the end of a pseudo terminal, behind links such as those that `sim --pty` makes.
fn is_pseudo_terminal(path: &str) -> bool {
    let real = std::fs::canonicalize(path);
    real.is_ok_and(|path| path.starts_with("/dev/pts"))
}

/// A drive on a bus: on CAN its number or its identifiers, on a line of octets its address.
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
    /// Its address, 1 to 126.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 126))]
    pub address: Option<u8>,
    /// The PPO type that it is set to, 1 to 4; without it the bench asks the drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 4))]
    pub ppo: Option<u8>,
}

/// What only benches with `[port.1]` permit, in `[limits]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(default)]
pub struct PortLimits {
    /// Whether what drives are reached by may be changed; default false. On CAN: identifiers, bit rate, width of replies and time-out. On
    /// a line of octets: address, PPO type, bus mode and interface, Unlock, and commands to all slaves.
    #[serde(skip_serializing_if = "is_false")]
    pub allow_bus_settings: bool,
    /// Whether data of the motor and of its protection may be written, such as ramps, current limits and time-outs; default false.
    #[serde(skip_serializing_if = "is_false")]
    pub allow_motor_data: bool,
    /// Whether stations that the file does not list may be sent more than requests that read; default false.
    #[serde(skip_serializing_if = "is_false")]
    pub allow_other_stations: bool,
    /// Whether a motor may be enabled with nothing to stop it if the bench fails, and the exchange may end while it runs; default false.
    #[serde(skip_serializing_if = "is_false")]
    pub allow_unsupervised: bool,
    /// The highest setpoint, such as `50%` of the maximum frequency; default no limit but the drives' own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_setpoint: Option<Percent>,
    /// The highest frequency, such as `35Hz`, in place of `max_setpoint`; default no limit but the drives' own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_frequency: Option<Hertz>,
    /// The most parameters that a session writes to EEPROMs; default no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_eeprom_writes: Option<u32>,
    /// Whether frames may be sent that no drive of the file receives; default false.
    #[serde(skip_serializing_if = "is_false")]
    pub allow_other_identifiers: bool,
    /// Special registers that may be written, by name or number, such as `["0x85"]`; default none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 16))]
    pub allow_registers: Vec<String>,
    /// The values that may be written to registers; default all of them. A qualification writes both ends of a range.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 256))]
    pub ranges: Vec<RegisterRange>,
    /// How a drive with another bit rate is reached again, in a sentence. Without it the bit rate cannot be changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit_rate_way_back: Option<String>,
    /// Confirms that changed bus settings may be stored in the EEPROM. It must read
    /// `the drive may then be reachable by RS232 only`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub store_bus_settings: Option<String>,
}

impl PortLimits {
    /// The keys that are given.
    #[must_use]
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            ("allow_bus_settings", self.allow_bus_settings),
            ("allow_motor_data", self.allow_motor_data),
            ("allow_other_stations", self.allow_other_stations),
            ("allow_unsupervised", self.allow_unsupervised),
            ("max_setpoint", self.max_setpoint.is_some()),
            ("max_frequency", self.max_frequency.is_some()),
            ("max_eeprom_writes", self.max_eeprom_writes.is_some()),
            ("allow_other_identifiers", self.allow_other_identifiers),
            ("allow_registers", !self.allow_registers.is_empty()),
            ("ranges", !self.ranges.is_empty()),
            ("bit_rate_way_back", self.bit_rate_way_back.is_some()),
            ("store_bus_settings", self.store_bus_settings.is_some()),
        ];
        let given = all.into_iter().filter(|(_, given)| *given);
        given.map(|(key, _)| key).collect()
    }
}

/// The values that may be written to a register, as whole numbers with its sign.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegisterRange {
    /// The register, by name or number, such as `SPEED_KP` or `0x2C`.
    pub register: String,
    /// The lowest value; default the lowest that the register has room for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<i64>,
    /// The highest value; default the highest that the register has room for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<i64>,
}

/// What [`PortLimits::store_bus_settings`] must read.
pub const CONFIRMATION: &str = "the drive may then be reachable by RS232 only";

const fn half_a_megabit() -> KilobitRate {
    KilobitRate(500.0)
}

fn twenty_milliseconds() -> Time {
    Time(std::time::Duration::from_millis(20))
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn is_unmarked(marks: &ErrorMarks) -> bool {
    *marks == ErrorMarks::None
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
const fn is_false(value: &bool) -> bool {
    !*value
}
