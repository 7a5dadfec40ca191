//! What the inverter shows: status word, actual values and the parameters of 5.7 and 4.1.3. Values are cut off, not rounded.

use super::super::frequency::Frequency;
use super::super::ramp::Course;
use super::{Inverter, InverterInputs};
use harness_proto::nordac::Parameter;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{
    ErrorElements, InitialZsw45, Off1ZswWhileRamping, PositionWords, Zsw1InQsFr, Zsw8, Zsw9, Zsw10,
    Zsw11AtRest,
};
use harness_proto::nordac::words::{FULL, State, stw, zsw};
use harness_proto::time::{Instant, Span};

/// Temperature of the heat sink in C.
pub(super) const HEAT_SINK: u16 = 25;
/// Voltage of the d.c. link in V.
const DC_LINK: i64 = 540;
/// The value of 1704 at which the position has 32 bits.
const BUS_MODE_32: i32 = 3;

impl Inverter {
    /// The process words of a reply at `at`, to which the time must have advanced.
    #[must_use]
    pub fn inputs(&self, at: Instant) -> InverterInputs {
        let frequency = self.ramp.at(at);
        InverterInputs {
            zsw: self.status(frequency),
            hiw: self.main_actual_value(frequency),
            pzd3: 0,
            pzd4: self.second_actual_value(frequency),
        }
    }

    /// How far main and second actual value, and parameters of a frequency in 0.1 Hz or of a voltage, move in a span at most.
    #[must_use]
    pub fn moves_within(&self, span: Span) -> [u16; 3] {
        let step = match self.ramp.course() {
            // What is shown is of the time before.
            Course { maximum: 0, .. } => Course {
                target: Frequency::ZERO,
                up: self.size(1202).max(1),
                down: self.size(1203).min(self.size(1615)).max(1),
                maximum: self.size(1205),
            },
            course => course,
        }
        .step(span);
        let second = matches!(self.value(1517), 1 | 2 | 4 | 9 | 10);
        let shown = step.cut(1, 1).max(self.voltage(step));
        [
            self.main_actual_value(step),
            u16::from(second) * self.second_actual_value(step),
            u16::try_from(shown).unwrap_or(u16::MAX),
        ]
    }

    /// HIW at the frequency that the process words demand.
    #[must_use]
    pub fn wanted_actual_value(&self) -> u16 {
        self.main_actual_value(self.wanted())
    }

    /// The status word (3.2.2).
    fn status(&self, frequency: Frequency) -> u16 {
        let interface = self.value(1621);
        let on = self.state.output_on();
        let at_setpoint = frequency == self.wanted();
        let (no_off2, no_off3) = if self.controlled {
            (
                self.words.stw & stw::NO_OFF2 != 0,
                self.words.stw & stw::NO_OFF3 != 0,
            )
        } else {
            let one = self.properties.initial_zsw_4_5 == InitialZsw45::One;
            (one, one)
        };
        let at_rest = self.properties.zsw11_at_rest == Zsw11AtRest::One || !frequency.is_zero();
        let bits = [
            (zsw::NO_OFF2, no_off2),
            (zsw::NO_OFF3, no_off3 && self.state != State::QuickStop),
            (
                zsw::AT_SETPOINT,
                at_setpoint && (on || self.properties.zsw8 == Zsw8::Always),
            ),
            (
                zsw::BUS_CONTROL,
                matches!(interface, 2 | 3 | 5 | 6) || self.properties.zsw9 == Zsw9::Always,
            ),
            (zsw::REFERENCE, self.reference_reached(frequency)),
            (zsw::CLOCKWISE, !frequency.is_negative() && at_rest),
            (zsw::ANTICLOCKWISE, frequency.is_negative()),
        ];
        let shown = bits
            .into_iter()
            .map(|(mask, shown)| if shown { mask } else { 0 });
        let set = u16::from(self.set()) << zsw::SET_SHIFT;
        shown.fold(self.state_bits() | set, |all, bit| all | bit)
    }

    /// Bits 6 and 3 to 0.
    fn state_bits(&self) -> u16 {
        let bits = self.state.bits();
        match self.state {
            State::OperationEnabled if self.words.stw & stw::ON == 0 => {
                match self.properties.off1_zsw_while_ramping {
                    Off1ZswWhileRamping::Enabled => bits,
                    Off1ZswWhileRamping::Ready => zsw::READY_TO_START | zsw::READY,
                    Off1ZswWhileRamping::ReadyToStart => zsw::READY_TO_START,
                }
            }
            State::QuickStop | State::FaultReaction
                if self.properties.zsw1_in_qs_fr == Zsw1InQsFr::Zero =>
            {
                bits & !zsw::READY
            }
            _ => bits,
        }
    }

    /// 1811, and bit 10: the output is on, and the frequency has reached 1617.
    fn reference_reached(&self, frequency: Frequency) -> bool {
        let on = self.state.output_on();
        match self.properties.zsw10 {
            Zsw10::Relay2 => on && frequency.abs() >= Frequency::tenths(self.value(1617).into()),
            Zsw10::SetpointReached => on && frequency == self.wanted(),
        }
    }

    /// HIW: 16384 for 1205 (3.2.5).
    fn main_actual_value(&self, frequency: Frequency) -> u16 {
        match self.value(1205) {
            0 => 0,
            maximum => signed_word(frequency.rounded(FULL.into(), maximum.into())),
        }
    }

    /// PZD4, selected by 1517 (3.2.6).
    fn second_actual_value(&self, frequency: Frequency) -> u16 {
        let value = match self.value(1517) {
            1 => frequency.abs().cut(1, 1),
            2 => frequency.cut(1, 1),
            3 => self.output_current().into(),
            4 => self.voltage(frequency),
            6 if self.state.output_on() => self.value(1306).into(),
            9 => self.speed(frequency.abs()),
            10 => self.speed(frequency),
            _ => 0,
        };
        signed_word(value)
    }

    /// The output current in 0.01 A: the no-load current.
    pub(super) fn output_current(&self) -> u16 {
        if self.state.output_on() {
            self.size(1309)
        } else {
            0
        }
    }

    /// The output voltage in V: linear up to the nominal one.
    pub(super) fn output_voltage(&self, at: Instant) -> i128 {
        self.voltage(self.ramp.at(at))
    }

    fn voltage(&self, frequency: Frequency) -> i128 {
        let (nominal, corner) = (self.value(1304), self.value(1301));
        if corner == 0 {
            return 0;
        }
        let voltage = frequency.abs().cut(nominal.into(), corner.into());
        voltage.min(nominal.into())
    }

    /// The speed in min-1, without slip.
    fn speed(&self, frequency: Frequency) -> i128 {
        match self.value(1301) {
            0 => 0,
            corner => frequency.cut(self.value(1302).into(), corner.into()),
        }
    }

    /// What a parameter reads at `at`: what it measures, or what is stored.
    pub(super) fn shown(&self, at: Instant, parameter: &Parameter, index: Index) -> i64 {
        let element = usize::from(index.element);
        let frequency = self.ramp.at(at);
        match parameter.number {
            918 => self.settings.address.into(),
            947 => self.error_number(element).into(),
            967 => self.words.stw.into(),
            968 => self.status(frequency).into(),
            1734 => self.position_setpoint(),
            1800 => self.faults.pending().into(),
            number @ 1801..=1805 => self
                .faults
                .past(usize::from(number - 1801))
                .value(element)
                .into(),
            1806 => self.faults.counter(element).into(),
            1811 => self.reference_reached(frequency).into(),
            1813 => match element {
                0 => word(frequency.abs().cut(1, 1)),
                1 => i64::from(self.output_current() / 10),
                _ => 0,
            },
            1825 => match element {
                0 => HEAT_SINK.into(),
                1 => self.value(1609).into(),
                _ => DC_LINK,
            },
            _ if parameter.has(Flag::ReadOnly) => parameter.default.into(),
            _ => self.parameters.get(parameter, index).into(),
        }
    }

    /// 947: the pending or last fault in each element (4.1.3).
    fn error_number(&self, element: usize) -> u8 {
        match self.properties.error_elements {
            ErrorElements::NewestFirst if element > 0 => self.faults.past(element).code,
            _ => self.faults.last(),
        }
    }

    /// 1734: the position that the bus demands in the mode of 32 bits (3.2.3); 0 in other modes.
    fn position_setpoint(&self) -> i64 {
        if self.value(1704) != BUS_MODE_32 {
            return 0;
        }
        let (hsw, pzd3) = (self.words.hsw, self.words.pzd3);
        let (high, low) = match self.properties.position_words {
            PositionWords::HswHigh => (hsw, pzd3),
            PositionWords::Reversed => (pzd3, hsw),
        };
        i64::from((u32::from(high) << 16 | u32::from(low)).cast_signed())
    }
}

/// A number as a word of the process data; its size is cut at 7FFF.
fn signed_word(number: i128) -> u16 {
    let most = i128::from(i16::MAX);
    i16::try_from(number.clamp(-most, most)).map_or(0, i16::cast_unsigned)
}

/// A number that is not negative, as a word.
fn word(number: i128) -> i64 {
    u16::try_from(number).unwrap_or(u16::MAX).into()
}
