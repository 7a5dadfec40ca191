//! From the process words to the course of the ramp generator (3.2.1, 3.2.3, 3.2.4; section 7 of the reading).

use super::super::frequency::Frequency;
use super::super::ramp::Course;
use super::Inverter;
use harness_proto::nordac::properties::{Bit4Ramp, BothDirections, Over100};
use harness_proto::nordac::words::{FULL, State, stw};

impl Inverter {
    /// Takes the course that words, state and parameters demand from now on.
    pub(super) fn steer(&mut self) {
        let course = self.course();
        self.ramp.take(self.now, course);
    }

    fn course(&self) -> Course {
        let maximum = self.size(1205);
        if maximum == 0 {
            return Course::STOPPED;
        }
        let down = |number| Course {
            target: Frequency::ZERO,
            up: self.size(1202).max(1),
            down: self.size(number).max(1),
            maximum,
        };
        let word = self.words.stw;
        match self.state {
            State::QuickStop | State::FaultReaction => down(1615),
            State::OperationEnabled if word & stw::ON == 0 => down(1203),
            State::OperationEnabled if word & stw::RAMP == 0 => match self.properties.bit4_ramp {
                Bit4Ramp::QuickStop => down(1615),
                Bit4Ramp::Deceleration => down(1203),
                Bit4Ramp::AtOnce => Course::STOPPED,
            },
            State::OperationEnabled if word & stw::RUN == 0 => Course {
                target: self.ramp.at(self.now),
                ..down(1203)
            },
            State::OperationEnabled => Course {
                target: self.wanted(),
                ..down(1203)
            },
            _ => Course::STOPPED,
        }
    }

    /// What the ramp generator is to reach by the process words: the setpoint, or 0 where bit 4 or 6 of the control word is 0.
    pub(super) fn wanted(&self) -> Frequency {
        let enabled = stw::RAMP | stw::SETPOINT;
        if self.words.stw & enabled == enabled {
            self.setpoint()
        } else {
            Frequency::ZERO
        }
    }

    /// The setpoint within its limits.
    fn setpoint(&self) -> Frequency {
        let maximum = i64::from(self.value(1205));
        let full = i64::from(FULL);
        let interface = self.value(1621);
        let mut hsw = i64::from(self.words.hsw.cast_signed());
        if interface >= 4 {
            hsw = hsw.clamp(0, full);
        }
        // In tenths of a hertz, times 16384.
        let mut scaled = hsw * maximum;
        if matches!(interface, 3 | 6) {
            let second =
                i64::from(self.words.pzd4.cast_signed()) * i64::from(self.value(1509)) * 10;
            match self.value(1504) {
                1 => scaled += second,
                2 => scaled -= second,
                _ => {}
            }
        }
        let both = (
            self.words.stw & stw::CLOCKWISE != 0,
            self.words.stw & stw::ANTICLOCKWISE != 0,
        );
        match (both, self.properties.both_directions) {
            ((false, true), _) | ((true, true), BothDirections::Inverted) => scaled = -scaled,
            ((true, true), BothDirections::Stop) => scaled = 0,
            _ => {}
        }
        if maximum == 0 {
            scaled = 0;
        } else if self.properties.over_100 == Over100::Limited {
            scaled = scaled.clamp(-maximum * full, maximum * full);
        }
        Frequency::new(scaled.into(), full.into())
    }
}
