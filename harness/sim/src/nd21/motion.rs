//! Motion at the 432 us cycle: ramp, position regulator, speed regulator, limit of the torque, actual
//! values (ND21 4.1, 14.5, 14.6).
//!
//! The cells are the truth: what the bus writes to `umdrsoll`, `lagesoll`, `nIntegrator` or `dLage` counts
//! from the next cycle on. The manual gives no units for the regulators' gains; here, in raw units of the
//! cells, named choices:
//!
//! * position regulator: speed += `LKp` / 32 x slip + `LKd` / 16 x change of the slip (in increments);
//! * speed regulator: torque = 4 x `nKp` x deviation + integral of `nKi` / 4 x deviation, both in units of
//!   `msoll`; the integral stands still while the torque is limited (anti-wind-up switch, 4.1);
//! * deviations of half an increment and less are none, for that is the resolver's resolution;
//! * i2t: above `i0` the square of the current is summed up in `i2`; the time that `imax` may last is the
//!   property `i2t-time`. Then `i0` is the limit until half the sum is gone.

use super::plant::{Plant, THOUSAND_RPM};
use super::wave;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{flags, status, sw_version, sw_version2};
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{RAMP_OFF, SLIPPING_OFF};

/// What the motor is to do in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Demand {
    /// Nothing: the regulator is blocked.
    Free,
    /// To reach this speed on the ramps.
    Speed(i16),
    /// To have this speed now: a profile has worked it out.
    Exact(i16),
}

/// What `imax` adds in one cycle to the sum at which i2t limits.
fn i2t_step(imax: u8, i0: u8) -> i64 {
    i64::from(imax).pow(2) - i64::from(i0).pow(2)
}

/// The nearest whole number, as a float and its low 32 bits. Adding 1.5 x 2^52 leaves no room behind the
/// point: two additions where `f64::round` is a call on many processors. For |x| < 2^51.
#[inline]
fn round(x: f64) -> (f64, i32) {
    const BIG: f64 = 6_755_399_441_055_744.0;
    let sum = x + BIG;
    let [a, b, c, d, ..] = sum.to_bits().to_le_bytes();
    (sum - BIG, i32::from_le_bytes([a, b, c, d]))
}

/// 1, or -1 where `SwVersion` bit 3 turns the direction round (14.3.1).
#[inline]
fn direction(cells: &Cells) -> f64 {
    if cells.byte(ram::SW_VERSION) & sw_version::REVERSED == 0 {
        1.0
    } else {
        -1.0
    }
}

/// The nearest whole number, for |x| < 2^15.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "clamped by every caller")]
fn word(x: f64) -> i16 {
    round(x).1 as i16
}

/// The regulators' inner values.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    /// The part of `nIntegrator` below one unit.
    integral: f64,
    /// `nist` before it is rounded.
    filtered: f64,
    /// The slip of the cycle before.
    slip: f64,
    /// The rotor angle as the drive counts it, `SwVersion` bit 3 regarded, in increments.
    seen: f64,
    /// `lageist` of the cycle before.
    old: u16,
    limited: bool,
    i2t: bool,
    /// The regulator was blocked in the cycle before.
    free: bool,
}

/// What the caller has to know of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MotionStep {
    /// The slip is more than `Slipping error` allows (14.5.6).
    pub(super) slipped: bool,
    /// Nothing turned and nothing changed.
    pub(super) at_rest: bool,
    /// The bits of `Flags` that belong to the motion.
    pub(super) flags: u8,
}

/// What stands between the drive and its motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outside {
    /// The greatest current limit of the device (14.5.1.2).
    pub(super) most: u8,
    /// Aeff for one unit of `msoll` (14.5.2).
    pub(super) amperes: f64,
    /// The load in Aeff.
    pub(super) load: f64,
    /// The rotor is held.
    pub(super) jammed: bool,
    /// Half the number of poles, and where phase A is (14.6.6, 14.6.7).
    pub(super) pole_pairs: u16,
    /// How many cycles `imax` may last.
    pub(super) i2t_cycles: u32,
    /// The torque limit that the analogue input sets while stepping, of 256 (13.1.4).
    pub(super) torque_share: u16,
}

impl Motion {
    /// As after power-up or reset: the position is that of the resolver, less than a turn (13.1.1).
    pub(super) fn start(&mut self, plant: &Plant, cells: &mut Cells) {
        let sign = direction(cells);
        *self = Self {
            seen: (plant.position * sign).rem_euclid(65_536.0),
            filtered: plant.speed * sign,
            free: true,
            ..Self::default()
        };
        self.old = self.angle().0.wrapping_add(cells.word(ram::D_LAGE));
        cells.put_word(ram::UMDRIST, 0);
        cells.put_word(ram::LAGEIST, self.old);
        cells.put_word(ram::LAGE0, self.old);
        self.follow(cells);
    }

    /// The rotor angle, and how far the rotor is behind it, in increments: the resolver shows whole ones.
    #[inline]
    fn angle(&self) -> (u16, f64) {
        let (whole, bits) = round(self.seen);
        let [low, high, ..] = bits.to_le_bytes();
        (u16::from_le_bytes([low, high]), self.seen - whole)
    }

    /// The nominal position becomes the actual one.
    fn follow(&self, cells: &mut Cells) {
        cells.put_long(ram::UMDRSOLL, cells.long(ram::UMDRIST));
        cells.put(ram::LAGESOLL_L, 0);
    }

    /// One cycle.
    pub(super) fn cycle(
        &mut self,
        demand: Demand,
        outside: Outside,
        plant: &mut Plant,
        cells: &mut Cells,
    ) -> MotionStep {
        let eighths = if cells.byte(ram::SW_VERSION2) & sw_version2::TO_8000 == 0 {
            2
        } else {
            1
        };
        let before = (cells.word(ram::MSOLL), cells.word(ram::NSOLLRAMPE));
        let regulated = cells.byte(ram::SW_VERSION) & sw_version::POSITION_REGULATOR != 0;
        // Both positions are those of the end of the last cycle.
        let slip = if regulated && demand != Demand::Free {
            self.slip(cells)
        } else {
            0.0
        };
        let slipped = Self::too_far(slip, cells);
        let demand = if slipped { Demand::Free } else { demand };
        if self.free && demand != Demand::Free {
            // A motor that still turns is taken over at its speed: from there it is led on the ramps (11.8).
            cells.put_word(ram::NSOLLRAMPE, cells.word(ram::NIST));
        }
        self.free = demand == Demand::Free;
        let nominal = Self::ramp(demand, cells);
        let limit = self.limit(outside, cells);
        let torque = if demand == Demand::Free {
            self.integral = 0.0;
            self.slip = 0.0;
            self.limited = false;
            cells.put_word(ram::N_INTEGRATOR, 0);
            0.0
        } else {
            let mut speed = f64::from(i32::from(nominal) * eighths);
            if regulated {
                self.advance_nominal(nominal, eighths, cells);
                let slip = if slip.abs() <= 0.5 { 0.0 } else { slip };
                speed += f64::from(cells.byte(ram::LKP)) / 32.0 * slip;
                speed += f64::from(cells.byte(ram::LKD)) / 16.0 * (slip - self.slip);
                self.slip = slip;
            }
            self.regulate(speed - self.filtered, limit, cells)
        };
        let at_rest = plant.speed == 0.0;
        self.turn(torque, outside, plant, cells);
        if demand == Demand::Free || !regulated {
            self.follow(cells);
        }
        let torque = word(torque);
        self.show(torque, eighths, outside, cells);
        MotionStep {
            slipped,
            at_rest: at_rest
                && plant.speed == 0.0
                && self.filtered == 0.0
                && nominal == 0
                && self.slip == 0.0
                && before == (torque.cast_unsigned(), 0)
                && cells.long(ram::I2) == 0,
            flags: self.flags(),
        }
    }

    /// The nominal speed after the ramp generator (14.5.4).
    fn ramp(demand: Demand, cells: &mut Cells) -> i16 {
        let now = i32::from(cells.signed(ram::NSOLLRAMPE));
        let next = match demand {
            Demand::Free => 0,
            Demand::Exact(speed) => speed,
            Demand::Speed(target) => {
                let target = i32::from(target);
                let away = now == 0 || (target > now) == (now > 0);
                let ramp = cells.word(if away {
                    ram::N_RAMPE_PLUS
                } else {
                    ram::N_RAMPE_MINUS
                });
                let step = if ramp == RAMP_OFF {
                    i32::from(u16::MAX)
                } else {
                    i32::from(ramp)
                };
                // Braking ends at 0; what lies beyond is accelerated to.
                let goal = if !away && now.signum() * target.signum() < 0 {
                    0
                } else {
                    target
                };
                let next = now + (goal - now).clamp(-step, step);
                next.clamp(-0x7FFF, 0x7FFF) as i16
            }
        };
        cells.put_word(ram::NSOLLRAMPE, next.cast_unsigned());
        next
    }

    /// The nominal position goes on by the nominal speed.
    fn advance_nominal(&self, nominal: i16, eighths: i32, cells: &mut Cells) {
        // In 256ths of an increment: an eighth is 32 of them.
        let parts = i64::from(i32::from(nominal) * eighths) * 32;
        let position = i64::from(cells.long(ram::UMDRSOLL)) << 8;
        let [low, rest @ ..] =
            (position + i64::from(cells.byte(ram::LAGESOLL_L)) + parts).to_le_bytes();
        let [a, b, c, d, ..] = rest;
        cells.put_long(ram::UMDRSOLL, u32::from_le_bytes([a, b, c, d]));
        cells.put(ram::LAGESOLL_L, low);
    }

    /// How far the actual position is behind the nominal one, in increments.
    fn slip(&self, cells: &Cells) -> f64 {
        let whole = cells
            .long(ram::UMDRSOLL)
            .wrapping_sub(cells.long(ram::UMDRIST));
        f64::from(whole.cast_signed()) + f64::from(cells.byte(ram::LAGESOLL_L)) / 256.0
            - self.angle().1
    }

    fn too_far(slip: f64, cells: &Cells) -> bool {
        let allowed = cells.word(ram::SLIPPING_ERROR);
        allowed != SLIPPING_OFF && slip.abs() > f64::from(u32::from(allowed) * 256)
    }

    /// The torque limit: `imax`, or `i0` when that lasted too long.
    fn limit(&mut self, outside: Outside, cells: &mut Cells) -> u8 {
        let (imax, i0) = (cells.byte(ram::IMAX), cells.byte(ram::I0));
        let current = i64::from(cells.signed(ram::MSOLL)).abs() / 256;
        let sum = i64::from(cells.long(ram::I2)) + current * current - i64::from(i0).pow(2);
        // Without a current there is nothing to limit: it takes a cycle at least.
        let full = i2t_step(imax, i0) * i64::from(outside.i2t_cycles.max(1));
        let sum = sum.clamp(0, full.clamp(0, i64::from(u32::MAX)));
        cells.put_long(ram::I2, u32::try_from(sum).unwrap_or(u32::MAX));
        self.i2t = full > 0 && (sum >= full || self.i2t && sum > full / 2);
        let limit = if self.i2t { i0.min(imax) } else { imax }.min(outside.most);
        let share = u16::from(limit) * outside.torque_share / 256;
        let limit = u8::try_from(share).unwrap_or(limit);
        cells.put(ram::MMAX, limit);
        limit
    }

    /// The speed regulator (14.6.4).
    fn regulate(&mut self, deviation: f64, limit: u8, cells: &mut Cells) -> f64 {
        let most = f64::from(u32::from(limit) * 256);
        let proportional = f64::from(cells.byte(ram::NKP)) * 4.0 * deviation;
        let integral = f64::from(cells.signed(ram::N_INTEGRATOR)) + self.integral;
        let step = f64::from(cells.byte(ram::NKI)) / 4.0 * deviation;
        let torque = proportional + integral + step;
        self.limited = torque.abs() >= most && (torque != 0.0 || most == 0.0);
        let integral = if self.limited && step * torque > 0.0 {
            integral
        } else {
            (integral + step).clamp(-most, most)
        };
        let whole = word(integral);
        self.integral = integral - f64::from(whole);
        cells.put_word(ram::N_INTEGRATOR, whole.cast_unsigned());
        torque.clamp(-most, most)
    }

    /// The motor turns, and the resolver sees it.
    fn turn(&mut self, torque: f64, outside: Outside, plant: &mut Plant, cells: &mut Cells) {
        let sign = direction(cells);
        let current = torque * (outside.amperes * sign);
        let way = plant.step(current, outside.load * sign, outside.jammed);
        self.seen += way * sign;
        let measured = plant.speed * sign;
        // ND21 14.6.3: the time constant is 432 us / (1 - nFilter / 128).
        let filter = cells.byte(ram::N_FILTER).min(0x7F);
        if filter == 0 {
            self.filtered = measured;
        } else {
            self.filtered += (measured - self.filtered) * f64::from(128 - filter) / 128.0;
            if measured == 0.0 && self.filtered.abs() < 0.01 {
                self.filtered = 0.0;
            }
        }
        let angle = self.angle().0.wrapping_add(cells.word(ram::D_LAGE));
        let change = angle.wrapping_sub(self.old).cast_signed();
        let turns = cells.word(ram::UMDRIST);
        let position =
            (u32::from(turns) << 16 | u32::from(self.old)).wrapping_add_signed(i32::from(change));
        cells.put_word(ram::LAGE0, self.old);
        cells.put_long(ram::UMDRIST, position);
        self.old = angle;
    }

    fn flags(&self) -> u8 {
        // 700 rpm: from there on the resolver has less than 16 bit (4.1).
        let fast = self.filtered.abs() > 0.7 * THOUSAND_RPM;
        (if fast { flags::RESOLVER } else { 0 }) | if self.i2t { flags::I2T } else { 0 }
    }

    /// The actual values in the cells.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "clamped to a word, or a quotient of one byte"
    )]
    fn show(&self, torque: i16, eighths: i32, outside: Outside, cells: &mut Cells) {
        let speed = if eighths == 1 {
            self.filtered
        } else {
            self.filtered / 2.0
        };
        let speed = word(speed.clamp(-32_767.0, 32_767.0));
        cells.put_word(ram::NIST, speed.cast_unsigned());
        cells.put_word(ram::MSOLL, torque.cast_unsigned());
        cells.set_bits(ram::STATUS, status::CURRENT_LIMIT, self.limited);
        let emf = (i32::from(speed) * i32::from(cells.byte(ram::EMK0))) >> 15;
        cells.put(ram::EMK, emf as i8 as u8);
        if torque == 0 {
            for current in [ram::IASOLL, ram::IBSOLL, ram::IAIST, ram::IBIST] {
                cells.put(current, 0);
            }
            return;
        }
        let angle = self.angle().0.wrapping_sub(cells.word(ram::D_RESOLVER));
        let electrical = angle.wrapping_mul(outside.pole_pairs);
        let third = 0x1_0000_u32 / 3;
        let phases = [electrical, electrical.wrapping_sub(third as u16)];
        for (angle, nominal, actual) in [
            (phases[0], ram::IASOLL, ram::IAIST),
            (phases[1], ram::IBSOLL, ram::IBIST),
        ] {
            let current = (i32::from(torque) * wave::sine(angle)) >> 22;
            let byte = current.clamp(-128, 127) as i8 as u8;
            cells.put(nominal, byte);
            cells.put(actual, byte);
        }
    }

    /// Shifts the count of the position so that the present nominal position is `position`, and the actual
    /// one with it (13.1.1 step 7).
    pub(super) fn set_position(&mut self, position: u32, cells: &mut Cells) {
        let shift = position.wrapping_sub(cells.long(ram::UMDRSOLL));
        let [_, _, high, low] = shift.to_be_bytes();
        let turn = u16::from_be_bytes([high, low]);
        self.old = self.old.wrapping_add(turn);
        cells.put_word(ram::D_LAGE, cells.word(ram::D_LAGE).wrapping_add(turn));
        cells.put_long(ram::UMDRIST, cells.long(ram::UMDRIST).wrapping_add(shift));
        cells.put_long(ram::UMDRSOLL, position);
    }
}
