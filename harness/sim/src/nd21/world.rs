//! Inputs and outputs of a drive outside the bus: plugs X1 to X3, the motor, the
//! display (ND21 5, 11.8).

use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::io::{Input, Inputs};
use harness_proto::nd21::units::INCREMENTS_PER_TURN;
use std::fmt;

/// Digits behind the point of a position in turns: enough to tell one increment from the next.
const TURN_DECIMALS: usize = 6;

/// A change at a drive from outside the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stimulus {
    /// A digital input is at 5 to 24 V (`true`) or at 0 V (5.3.3, 5.3.4).
    Input(Input, bool),
    /// A cam on the shaft holds a digital input high from one position of the rotor up to another, in
    /// increments since power-up, and low elsewhere (the reference switch of 13.1.1, end switches).
    Cam(Input, i64, i64),
    /// The voltage at the analogue input in mV, -10 000 to 10 000 (5.3.1).
    Analogue(i32),
    /// Impulses a second at the frequency input (5.3.4).
    Frequency(u32),
    /// The temperature of the cooler in tenths of a degree Celsius (14.5.7.1).
    Cooler(i32),
    /// The resistance of the motor's temperature sensor in ohms (14.5.7.2).
    MotorSensor(u32),
    /// The DC rail voltage in V (4.2.2).
    Rail(u32),
    /// The resolver's cable is plugged in (5.2).
    Resolver(bool),
    /// What the load takes, as the motor current in mAeff that holds it; positive against positive
    /// rotation.
    Load(i32),
    /// The rotor is held fast.
    Jammed(bool),
    /// A short circuit between the phases of the motor (3.2).
    Short(bool),
    /// The drive's own monitoring reports this error, whatever its reason.
    Error(ErrorCode),
}

impl fmt::Display for Stimulus {
    /// As a scenario writes it: `analogue 500mV`, `error 0504`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let on = |on: bool| if on { "on" } else { "off" };
        match *self {
            Self::Input(input, high) => {
                write!(
                    f,
                    "input {} {}",
                    input.name(),
                    if high { "high" } else { "low" }
                )
            }
            Self::Cam(input, from, to) => {
                write!(f, "cam {} {}..{}", input.name(), turns(from), turns(to))
            }
            Self::Analogue(millivolts) => write!(f, "analogue {millivolts}mV"),
            Self::Frequency(hertz) => write!(f, "frequency {hertz}Hz"),
            Self::Cooler(tenths) => {
                let sign = if tenths < 0 { "-" } else { "" };
                let tenths = tenths.unsigned_abs();
                write!(f, "cooler {sign}{}.{}C", tenths / 10, tenths % 10)
            }
            Self::MotorSensor(ohms) => write!(f, "motor-sensor {ohms}ohm"),
            Self::Rail(volts) => write!(f, "rail {volts}V"),
            Self::Load(milliamperes) => write!(f, "load {milliamperes}mAeff"),
            Self::Resolver(plugged) => write!(f, "resolver {}", on(plugged)),
            Self::Jammed(held) => write!(f, "rotor {}", if held { "jammed" } else { "free" }),
            Self::Short(short) => write!(f, "phases {}", if short { "shorted" } else { "sound" }),
            // A step gives it as a fault; no line of this kind does.
            Self::Error(error) => write!(f, "error {:04X}", error.code()),
        }
    }
}

/// A position in increments as turns.
fn turns(increments: i64) -> String {
    let per_turn = i64::from(INCREMENTS_PER_TURN);
    let unit = 10_i64.pow(6);
    let parts = (increments * unit * 2 + per_turn).div_euclid(per_turn * 2);
    let sign = if parts < 0 { "-" } else { "" };
    let parts = parts.unsigned_abs();
    let unit = unit.unsigned_abs();
    format!(
        "{sign}{}.{:0width$}turns",
        parts / unit,
        parts % unit,
        width = TURN_DECIMALS
    )
}

/// The outputs of a drive outside the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputLevels {
    /// GPO1 is high (5.3.5).
    pub gpo1: bool,
    /// GPO2 is high.
    pub gpo2: bool,
    /// The ready for operation contact is closed (5.3.7).
    pub ready: bool,
    /// The analogue output in mV (5.3.2).
    pub analogue: i32,
    /// Impulses that the encoder emulation has given since power-up, backward ones counted down (5.3.6).
    pub encoder: i64,
    /// The three digits of the 7-segment display; `None` where it shows no error (11.8).
    pub display: Option<[u8; 3]>,
    /// The mode (11.8).
    pub mode: Mode,
}

/// The modes of the drive (ND21 11.8).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The drive starts and tests itself.
    #[default]
    Reset,
    /// An error has blocked the regulator.
    Error,
    /// The regulator is blocked by hardware or software: no torque.
    Block,
    /// The regulator is enabled, the drive stopped by hardware or software.
    Stop,
    /// The drive follows its nominal value.
    Go,
}

impl Mode {
    /// The names in scenarios, with the modes.
    pub const NAMES: [(&'static str, Self); 5] = [
        ("reset", Self::Reset),
        ("error", Self::Error),
        ("block", Self::Block),
        ("stop", Self::Stop),
        ("go", Self::Go),
    ];
}

/// Everything outside the bus that a drive depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct World {
    /// The digital inputs.
    pub(super) inputs: Inputs,
    /// The cams, in order of the inputs.
    cams: [Option<(i64, i64)>; Input::ALL.len()],
    has_cams: bool,
    /// The analogue input in mV.
    pub(super) analogue: i32,
    /// Impulses a second.
    pub(super) frequency: u32,
    /// The cooler in tenths of a degree Celsius.
    pub(super) cooler: i32,
    /// The motor's sensor in ohms.
    pub(super) motor_sensor: u32,
    /// The DC rail voltage in V.
    pub(super) rail: u32,
    /// The resolver is connected.
    pub(super) resolver: bool,
    /// The load in mAeff.
    pub(super) load: i32,
    /// The rotor is held fast.
    pub(super) jammed: bool,
    /// The phases are shorted.
    pub(super) short: bool,
}

impl Default for World {
    /// A drive on the bench: nothing in plug X3, 25 °C, 560 V (4.2.2), a free motor.
    fn default() -> Self {
        Self {
            inputs: Inputs::default(),
            cams: [None; Input::ALL.len()],
            has_cams: false,
            analogue: 0,
            frequency: 0,
            cooler: 250,
            motor_sensor: 1_000,
            rail: 560,
            resolver: true,
            load: 0,
            jammed: false,
            short: false,
        }
    }
}

impl World {
    /// Some inputs depend on where the rotor is.
    #[inline]
    pub(super) fn has_cams(&self) -> bool {
        self.has_cams
    }

    /// The rotor is here: cams switch their inputs. Whether one has.
    pub(super) fn turn_to(&mut self, position: i64) -> bool {
        let before = self.inputs;
        for (input, cam) in Input::ALL.into_iter().zip(self.cams) {
            if let Some((from, to)) = cam {
                self.inputs = self.inputs.with(input, (from..to).contains(&position));
            }
        }
        self.inputs != before
    }

    /// Lets `stimulus` happen; the error is returned if it is one.
    pub(super) fn change(&mut self, stimulus: Stimulus) -> Option<ErrorCode> {
        match stimulus {
            Stimulus::Input(input, high) => {
                self.cams[input as usize] = None;
                self.inputs = self.inputs.with(input, high);
            }
            Stimulus::Cam(input, from, to) => {
                self.cams[input as usize] = Some((from, to));
                self.has_cams = true;
            }
            Stimulus::Analogue(mv) => self.analogue = mv.clamp(-10_000, 10_000),
            Stimulus::Frequency(hz) => self.frequency = hz,
            Stimulus::Cooler(tenths) => self.cooler = tenths,
            Stimulus::MotorSensor(ohm) => self.motor_sensor = ohm,
            Stimulus::Rail(volts) => self.rail = volts,
            Stimulus::Resolver(connected) => self.resolver = connected,
            Stimulus::Load(load) => self.load = load,
            Stimulus::Jammed(jammed) => self.jammed = jammed,
            Stimulus::Short(short) => self.short = short,
            Stimulus::Error(error) => return Some(error),
        }
        None
    }
}
