//! The motor and what it turns: a small model with plain parameters, to be replaced at will.
//!
//! Torque is counted as the motor current that makes it, as the manual does (ND21 14.5.2). A speed is in
//! eighths of an increment per cycle of 432 us, which is the raw scale of `nist` in the range to
//! 8000 rpm (14.5.3.1): 0.2649 rpm.

/// What the model depends on. The defaults are those of a motor of the size that ND21 7.1 selects for the
/// 5610, with a load of its own inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantParameters {
    /// Torque in Nm per Aeff.
    pub torque_constant: f64,
    /// Inertia of motor and load in kg m2.
    pub inertia: f64,
    /// Friction that does not depend on the speed, in Nm.
    pub friction: f64,
    /// Friction in Nm at 1000 rpm that grows with the speed.
    pub damping: f64,
}

impl Default for PlantParameters {
    fn default() -> Self {
        Self {
            torque_constant: 2.1,
            inertia: 0.006,
            friction: 0.3,
            damping: 0.2,
        }
    }
}

/// rad/s2 for one raw unit of speed a cycle: 2 pi / 65536 / 8 / (432 us)^2 (ND21 14.5.4, E96).
const RADIANS: f64 = 64.215_9;
/// Raw units of speed at 1000 rpm (ND21 14.5.3.1).
pub(super) const THOUSAND_RPM: f64 = 3_774.873_6;
/// No motor turns faster: 17,000 rpm.
const FASTEST: f64 = 65_000.0;

/// Motor and load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plant {
    /// Units a cycle for one Aeff.
    gain: f64,
    /// Friction in Aeff.
    friction: f64,
    /// Aeff per unit of speed.
    damping: f64,
    /// The speed in eighths of an increment per cycle.
    pub(super) speed: f64,
    /// The rotor's position since power-up in increments, whole turns included.
    pub(super) position: f64,
}

impl Plant {
    pub(super) fn new(parameters: PlantParameters) -> Self {
        let PlantParameters {
            torque_constant,
            inertia,
            friction,
            damping,
        } = parameters;
        Self {
            gain: torque_constant / inertia / RADIANS,
            friction: friction / torque_constant,
            damping: damping / torque_constant / THOUSAND_RPM,
            speed: 0.0,
            position: 0.0,
        }
    }

    /// One cycle with a motor current of `current` Aeff against a load of `load` Aeff; how far the rotor has
    /// turned in it, in increments.
    #[inline]
    pub(super) fn step(&mut self, current: f64, load: f64, jammed: bool) -> f64 {
        if jammed {
            self.speed = 0.0;
            return 0.0;
        }
        let drive = current - load;
        let before = self.speed;
        if before == 0.0 {
            // Friction holds what it can.
            if drive.abs() <= self.friction {
                return 0.0;
            }
            let after = (drive - self.friction.copysign(drive)) * self.gain;
            self.speed = after.clamp(-FASTEST, FASTEST);
        } else {
            let resistance = self.friction.copysign(before) + self.damping * before;
            let after = before + (drive - resistance) * self.gain;
            // Friction brings to rest, it does not turn round.
            let turned = after * before < 0.0;
            self.speed = if turned && drive.abs() <= self.friction {
                0.0
            } else {
                after.clamp(-FASTEST, FASTEST)
            };
        }
        let way = (before + self.speed) / 16.0;
        self.position += way;
        way
    }

    /// The rotor's whole increments since power-up.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "far below 2^63 in any run")]
    pub(super) fn increments(&self) -> i64 {
        self.position.floor() as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 7.1: 14.3 A make 30 Nm; on 0.006 kg m2 that is 5005 rad/s2.
    #[test]
    fn torque_accelerates() {
        let mut plant = Plant::new(PlantParameters {
            friction: 0.0,
            damping: 0.0,
            ..PlantParameters::default()
        });
        let cycles = 231;
        for _ in 0..cycles {
            plant.step(14.3, 0.0, false);
        }
        let seconds = f64::from(cycles) * 432e-6;
        let rpm = plant.speed / THOUSAND_RPM * 1000.0;
        let expected = 14.3 * 2.1 / 0.006 * seconds * 60.0 / (2.0 * core::f64::consts::PI);
        assert!((rpm / expected - 1.0).abs() < 1e-4, "{rpm} {expected}");
        // Half of the way that the speed at the end would have covered.
        let turns = plant.position / 65_536.0;
        assert!((turns / (expected / 60.0 * seconds / 2.0) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn friction_holds_and_brings_to_rest() {
        let mut plant = Plant::new(PlantParameters::default());
        plant.step(0.1, 0.0, false);
        plant.step(0.0, -0.1, false);
        assert!(plant.speed == 0.0 && plant.position == 0.0);
        plant.speed = 1000.0;
        for _ in 0..100_000 {
            plant.step(0.0, 0.0, false);
            assert!(plant.speed >= 0.0);
        }
        assert!(plant.speed == 0.0);
        plant.step(0.0, 5.0, false);
        assert!(plant.speed < 0.0, "a load pulls the rotor backwards");
        plant.step(20.0, 0.0, true);
        assert!(plant.speed == 0.0);
    }
}
