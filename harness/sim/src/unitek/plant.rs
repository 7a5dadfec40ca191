//! The motor of the simulated drive, in steps of 1 ms and whole numbers; every run has the same numbers.
//!
//! Nothing of this stands in the manual: the model is our choice. It has no load, no friction and no thermal model.

/// Speed at 100 %.
const FULL: i64 = 32_767;
/// Ramp of a drive that is not enabled, in ms for 100 %.
const COASTING: u32 = 2_000;
/// Torque times milliseconds that change the speed by 32767: 100 % torque needs 1000 ms.
const TORQUE_TIME: i64 = 21_845_000;
/// Speed times rpm at 100 % times counts of a turn, for one count a millisecond.
const COUNT: i64 = FULL * 60_000;
/// Counts of a turn (6.1).
const TURN: i64 = 65_536;

/// What the drive controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Control {
    /// The speed follows 31.
    Speed,
    /// The torque is 90.
    Torque,
    /// The position follows 6E.
    Position,
}

/// What the registers say to the plant in one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlantInputs {
    /// Whether the drive is enabled.
    pub enabled: bool,
    /// What it controls.
    pub control: Control,
    /// 31.
    pub speed: i16,
    /// 90.
    pub torque: i16,
    /// 6E.
    pub destination: i32,
    /// 34; its sign does not count.
    pub limit: i16,
    /// C8: rpm at 100 %.
    pub rpm_max: u16,
    /// 35, lower half: ms from 0 to 100 %.
    pub accelerate: u16,
    /// ED, lower half.
    pub decelerate: u16,
    /// C7: where a limit switch stops the axis.
    pub limit_ramp: u16,
    /// Limit switch 1: no positive direction.
    pub limit_plus: bool,
    /// Limit switch 2: no negative direction.
    pub limit_minus: bool,
}

impl PlantInputs {
    fn most(&self) -> i64 {
        i64::from(self.limit).abs()
    }

    /// Whether a limit switch forbids this direction.
    fn forbids(&self, direction: i64) -> bool {
        (direction > 0 && self.limit_plus) || (direction < 0 && self.limit_minus)
    }

    /// Counts that the axis moves in 1 ms at most under position control.
    fn counts(&self) -> i64 {
        i64::from(self.rpm_max) * TURN * self.most() / COUNT
    }
}

/// The motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Motor {
    speed: i64,
    position: i32,
    /// What the ramps have not yet used; one for all of them.
    ramp_rest: i64,
    torque_rest: i64,
    /// 0 to [`COUNT`] - 1.
    position_rest: i64,
}

impl Motor {
    /// A motor that stands.
    #[must_use]
    pub const fn new(position: i32) -> Self {
        Self {
            speed: 0,
            position,
            ramp_rest: 0,
            torque_rest: 0,
            position_rest: 0,
        }
    }

    /// The speed: 32767 is 100 %.
    #[must_use]
    pub const fn speed(&self) -> i64 {
        self.speed
    }

    /// The position: 65536 is a turn; it wraps at 32 bits.
    #[must_use]
    pub const fn position(&self) -> i32 {
        self.position
    }

    /// What decides how it moves on: speed, and what ramps and torque have not yet used.
    #[must_use]
    pub const fn moves(&self) -> (i64, i64, i64) {
        (self.speed, self.ramp_rest, self.torque_rest)
    }

    /// Sets the position (7A).
    pub fn preset(&mut self, position: i32) {
        self.position = position;
    }

    /// The end of homing: the position, without a rest.
    pub fn home(&mut self, position: i32) {
        self.position = position;
        self.position_rest = 0;
    }

    /// A ramp was written.
    pub fn forget_ramp(&mut self) {
        self.ramp_rest = 0;
    }

    /// One millisecond. While homing, the axis stands.
    pub fn step(&mut self, demand: &PlantInputs, homing: bool) {
        match (demand.enabled, demand.control) {
            (false, _) => self.approach(0, 0, COASTING),
            (true, Control::Position) => {
                self.travel(demand, homing);
                return;
            }
            (true, Control::Torque) => self.push(demand),
            (true, Control::Speed) => self.follow(demand),
        }
        self.turn(demand.rpm_max, 1);
    }

    /// Whether the next steps change nothing but the position, by a constant speed.
    #[must_use]
    pub fn is_settled(&self, demand: &PlantInputs, homing: bool) -> bool {
        if homing {
            return false;
        }
        match (demand.enabled, demand.control) {
            (false, _) => self.speed == 0 && self.ramp_rest == 0,
            (true, Control::Position) => self.speed == 0 && self.way(demand, demand.counts()) == 0,
            (true, Control::Torque) => demand.torque == 0 && self.speed.abs() <= demand.most(),
            (true, Control::Speed) => {
                self.speed == target(demand) && self.ramp_rest == 0 && !demand.forbids(self.speed)
            }
        }
    }

    /// `millis` steps at once; only right while [`Motor::is_settled`].
    pub fn skip(&mut self, demand: &PlantInputs, millis: u64) {
        let moves = !(demand.enabled && demand.control == Control::Position);
        if moves && self.speed != 0 && millis > 0 {
            self.turn(demand.rpm_max, millis);
        }
    }

    /// Speed control.
    fn follow(&mut self, demand: &PlantInputs) {
        let target = target(demand);
        if demand.forbids(self.speed) {
            return self.approach(0, target, demand.limit_ramp.into());
        }
        let slower = self.speed.signum() * (target - self.speed) < 0;
        if slower {
            // As far as zero; from there the other ramp, from the next millisecond on.
            let goal = if target.signum() == self.speed.signum() {
                target
            } else {
                0
            };
            self.approach(goal, target, demand.decelerate.into());
        } else {
            self.approach(target, target, demand.accelerate.into());
        }
    }

    /// One step of a ramp towards `goal`; the rest ends where `target` is reached.
    fn approach(&mut self, goal: i64, target: i64, ramp: u32) {
        let ramp = i64::from(ramp);
        let away = goal - self.speed;
        if ramp == 0 {
            self.speed = goal;
        } else if away != 0 {
            self.ramp_rest += FULL;
            let step = self.ramp_rest / ramp;
            self.ramp_rest %= ramp;
            self.speed += away.signum() * step.min(away.abs());
        }
        if self.speed == target {
            self.ramp_rest = 0;
        }
    }

    /// Torque control: no load, no friction.
    fn push(&mut self, demand: &PlantInputs) {
        let sum = self.torque_rest + i64::from(demand.torque) * FULL;
        self.torque_rest = sum.rem_euclid(TORQUE_TIME);
        let most = demand.most();
        self.speed = (self.speed + sum.div_euclid(TORQUE_TIME)).clamp(-most, most);
    }

    /// Position control.
    fn travel(&mut self, demand: &PlantInputs, homing: bool) {
        let step = if homing {
            0
        } else {
            self.way(demand, demand.counts())
        };
        // In range: a step leads no further than the destination.
        self.position = i32::try_from(i64::from(self.position) + step).unwrap_or(self.position);
        let arrived = self.position == demand.destination;
        self.speed = if arrived {
            0
        } else {
            step.signum() * demand.most()
        };
    }

    /// The counts of the next step towards the destination, at most `most`.
    fn way(&self, demand: &PlantInputs, most: i64) -> i64 {
        let away = i64::from(demand.destination) - i64::from(self.position);
        if demand.forbids(away) {
            return 0;
        }
        away.clamp(-most, most)
    }

    fn turn(&mut self, rpm_max: u16, millis: u64) {
        let a_step = i128::from(self.speed) * i128::from(rpm_max) * i128::from(TURN);
        let sum = i128::from(self.position_rest) + a_step * i128::from(millis);
        let counts = sum.div_euclid(COUNT.into());
        self.position_rest = i64::try_from(sum.rem_euclid(COUNT.into())).unwrap_or(0);
        // Wraps at 32 bits.
        let low = (i128::from(self.position) + counts).rem_euclid(1 << 32);
        self.position = u32::try_from(low).unwrap_or(0).cast_signed();
    }
}

/// 31 within the limit, and 0 where a limit switch forbids its direction.
fn target(demand: &PlantInputs) -> i64 {
    let most = demand.most();
    let target = i64::from(demand.speed).clamp(-most, most);
    if demand.forbids(target) { 0 } else { target }
}
