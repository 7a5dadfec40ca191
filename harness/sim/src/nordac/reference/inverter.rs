//! The inverter once more, in the plainest way, from the text of sections 3, 5 and 6 alone: the model that the simulated inverter is compared with.
//!
//! It has the state machine, the ramps and the parameter channel without PosiCon and with the defaults of all open properties. It shares the list
//! of parameters with the simulated inverter and nothing else.

use harness_proto::nordac::PARAMETERS;
use harness_proto::nordac::parameter::{Flag, Parameter};
use std::collections::BTreeMap;

/// Units of time in a second.
const SECOND: i128 = 3_000_000_000;

/// A fraction; the denominator is positive.
#[derive(Clone, Copy, Debug)]
struct Fraction(i128, i128);

impl Fraction {
    const ZERO: Self = Self(0, 1);

    fn new(numerator: i128, denominator: i128) -> Self {
        let (mut a, mut b) = (numerator.abs(), denominator.abs());
        while b != 0 {
            (a, b) = (b, a % b);
        }
        let divisor = a.max(1) * denominator.signum();
        Self(numerator / divisor, denominator / divisor)
    }

    fn plus(self, other: Self) -> Self {
        Self::new(self.0 * other.1 + other.0 * self.1, self.1 * other.1)
    }

    fn times(self, factor: Self) -> Self {
        Self::new(self.0 * factor.0, self.1 * factor.1)
    }

    fn less(self, other: Self) -> bool {
        self.0 * other.1 < other.0 * self.1
    }

    fn same(self, other: Self) -> bool {
        self.0 * other.1 == other.0 * self.1
    }

    fn abs(self) -> Self {
        Self(self.0.abs(), self.1)
    }

    fn minus(self) -> Self {
        Self(-self.0, self.1)
    }

    fn cut(self) -> i128 {
        self.0 / self.1
    }

    fn rounded(self) -> i128 {
        (self.0.abs() * 2 + self.1) / (self.1 * 2) * self.0.signum()
    }
}

/// The states of section 3.3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum At {
    StartDisable,
    ReadyToStart,
    Ready,
    Enabled,
    QuickStop,
    Reaction,
    Fault,
}

/// An inverter. Times are units of a third of a nanosecond, and never go back.
#[derive(Clone, Debug)]
pub struct ReferenceInverter {
    now: i128,
    at: At,
    stw: u16,
    hsw: i16,
    pzd4: i16,
    /// The frequency in 0.1 Hz when the present ramp began, and when that was.
    from: Fraction,
    since: i128,
    /// When 1625 expires.
    timeout: Option<i128>,
    cause: Option<i64>,
    /// 1800, and the codes of 1801 to 1805.
    fault: i64,
    past: [i64; 5],
    counters: [i64; 25],
    /// Values that are not the factory setting: number, element, set.
    values: BTreeMap<(u16, u16, u16), i64>,
}

impl ReferenceInverter {
    /// An inverter after power-up, with these values of parameters (number, value) in all sets.
    #[must_use]
    pub fn new(parameters: &[(u16, i64)]) -> Self {
        let sets = |&(number, value): &(u16, i64)| (0..4).map(move |set| ((number, 0, set), value));
        Self {
            now: 0,
            at: At::StartDisable,
            stw: 6,
            hsw: 0,
            pzd4: 0,
            from: Fraction::ZERO,
            since: 0,
            timeout: None,
            cause: None,
            fault: 0,
            past: [0; 5],
            counters: [0; 25],
            values: parameters.iter().flat_map(sets).collect(),
        }
    }

    /// Lets the time pass.
    pub fn advance(&mut self, to: u64) {
        let to = i128::from(to);
        loop {
            let rest = self.rest_at().filter(|at| *at <= to);
            let timeout = self.timeout.filter(|at| *at <= to);
            match (rest, timeout) {
                (Some(rest), timeout) if timeout.is_none_or(|timeout| rest <= timeout) => {
                    self.now = rest;
                    self.stop();
                    self.at = match self.at {
                        At::Enabled => At::ReadyToStart,
                        At::QuickStop => At::StartDisable,
                        _ => At::Fault,
                    };
                }
                (_, Some(timeout)) => {
                    self.now = timeout;
                    self.timeout = None;
                    self.fail(10);
                }
                _ => break,
            }
        }
        self.now = to;
    }

    /// A cause of a fault comes, or goes.
    pub fn cause(&mut self, code: Option<u8>) {
        self.cause = code.map(i64::from);
        if let Some(code) = self.cause {
            self.fail(code);
        }
    }

    /// The words of an exchange come.
    pub fn take(&mut self, stw: u16, hsw: u16, pzd4: u16) {
        let interface = self.value(1621);
        if stw & 0x0400 == 0 || interface == 0 {
            return;
        }
        let timeout = self.value(1625);
        self.timeout = (timeout > 0).then(|| self.now + i128::from(timeout) * SECOND / 10);
        self.anchor();
        self.hsw = hsw.cast_signed();
        if interface == 3 || interface == 6 {
            self.pzd4 = pzd4.cast_signed();
        }
        if interface == 1 || interface == 4 {
            return;
        }
        let edge = !self.stw & stw & 0x80 != 0;
        self.stw = stw;
        if self.at == At::Fault {
            if edge && self.cause.is_none() {
                self.at = At::StartDisable;
                self.fault = 0;
            }
            return;
        }
        while let Some(next) = self.rule() {
            self.at = next;
            if !self.is_on() {
                self.stop();
            }
        }
    }

    /// Where the control word leads from here; `None` where it leads nowhere.
    fn rule(&self) -> Option<At> {
        let bit = |number: u32| self.stw >> number & 1 == 1;
        let rests = self.frequency().same(Fraction::ZERO);
        match self.at {
            At::Fault => None,
            At::Reaction => (!bit(1)).then_some(At::Fault),
            At::StartDisable => (self.stw & 7 == 6).then_some(At::ReadyToStart),
            _ if !bit(1) => Some(At::StartDisable),
            At::QuickStop => None,
            At::Enabled if !bit(2) && !rests => Some(At::QuickStop),
            _ if !bit(2) => Some(At::StartDisable),
            At::ReadyToStart => bit(0).then_some(At::Ready),
            At::Ready if !bit(0) => Some(At::ReadyToStart),
            At::Ready => bit(3).then_some(At::Enabled),
            At::Enabled if !bit(0) => rests.then_some(At::ReadyToStart),
            At::Enabled => (!bit(3)).then_some(At::ReadyToStart),
        }
    }

    fn fail(&mut self, code: i64) {
        if self.at == At::Fault {
            return;
        }
        self.anchor();
        self.fault = code;
        self.past.rotate_right(1);
        self.past[0] = code;
        if let Some(counter) = usize::try_from(code - 1)
            .ok()
            .and_then(|at| self.counters.get_mut(at))
        {
            *counter += 1;
        }
        if self.value(1614) == 1 && !self.from.same(Fraction::ZERO) {
            self.at = At::Reaction;
        } else {
            self.at = At::Fault;
            self.stop();
        }
    }

    fn is_on(&self) -> bool {
        matches!(self.at, At::Enabled | At::QuickStop | At::Reaction)
    }

    fn stop(&mut self) {
        self.from = Fraction::ZERO;
        self.since = self.now;
    }

    /// A new ramp begins from here.
    fn anchor(&mut self) {
        self.from = self.frequency();
        self.since = self.now;
    }

    /// The active set, 0 to 3.
    fn set(&self) -> u16 {
        self.stw >> 14
    }

    fn value(&self, number: u16) -> i64 {
        self.value_at(number, 0, self.set())
    }

    fn value_at(&self, number: u16, element: u16, set: u16) -> i64 {
        let parameter = PARAMETERS.iter().find(|row| row.number == number);
        let set = if parameter.is_some_and(|row| row.has(Flag::Set)) {
            set
        } else {
            0
        };
        let default = parameter.map_or(0, |row| i64::from(row.default));
        self.values
            .get(&(number, element, set))
            .copied()
            .unwrap_or(default)
    }

    /// The frequency that is wanted: 0.1 Hz.
    fn wanted(&self) -> Fraction {
        if self.stw & 0x0050 != 0x0050 {
            return Fraction::ZERO;
        }
        let interface = self.value(1621);
        let mut main = i128::from(self.hsw);
        if interface >= 4 {
            main = main.clamp(0, 16_384);
        }
        let most = Fraction::new(self.value(1205).into(), 1);
        let mut all = most.times(Fraction::new(main, 16_384));
        if interface == 3 || interface == 6 {
            let part = Fraction::new(
                i128::from(self.pzd4) * i128::from(self.value(1509)) * 10,
                16_384,
            );
            match self.value(1504) {
                1 => all = all.plus(part),
                2 => all = all.plus(part.minus()),
                _ => {}
            }
        }
        if self.stw & 0x1800 == 0x1000 {
            all = all.minus();
        }
        if most.less(all) {
            most
        } else if all.less(most.minus()) {
            most.minus()
        } else {
            all
        }
    }

    /// 0.1 Hz in a unit of time, for the ramp time of this parameter.
    fn slope(&self, number: u16) -> Fraction {
        Fraction::new(
            i128::from(self.value(1205)) * 20,
            i128::from(self.value(number)) * SECOND,
        )
    }

    /// Where the ramp goes, and the parameters of its times: up and down.
    fn course(&self) -> Option<(Fraction, u16, u16)> {
        let bit = |number: u32| self.stw >> number & 1 == 1;
        match self.at {
            At::QuickStop | At::Reaction => Some((Fraction::ZERO, 1615, 1615)),
            At::Enabled if !bit(0) => Some((Fraction::ZERO, 1202, 1203)),
            At::Enabled if !bit(4) => Some((Fraction::ZERO, 1202, 1615)),
            At::Enabled if !bit(5) => None,
            At::Enabled if !bit(6) => Some((Fraction::ZERO, 1202, 1203)),
            At::Enabled => Some((self.wanted(), 1202, 1203)),
            _ => None,
        }
    }

    /// The frequency now.
    fn frequency(&self) -> Fraction {
        let Some((target, up, down)) = self.course() else {
            return self.from;
        };
        let past = Fraction::new(self.now - self.since, 1);
        let sign = Fraction::new(if self.from.0 < 0 { -1 } else { 1 }, 1);
        // Seen from the side on which it begins.
        let (from, to) = (self.from.times(sign), target.times(sign));
        if from.less(to) {
            let f = from.plus(self.slope(up).times(past));
            return if f.less(to) { f } else { to }.times(sign);
        }
        let f = from.plus(self.slope(down).times(past).minus());
        let turn = if to.0 < 0 { Fraction::ZERO } else { to };
        if turn.less(f) {
            return f.times(sign);
        }
        if to.0 >= 0 {
            return target;
        }
        // It has turned at 0.
        let falling = from.times(Fraction::new(self.slope(down).1, self.slope(down).0));
        let rising = past.plus(falling.minus());
        let f = self.slope(up).times(rising).minus();
        if to.less(f) { f } else { to }.times(sign)
    }

    /// When the motor rests, if that ends the state.
    fn rest_at(&self) -> Option<i128> {
        let ends = match self.at {
            At::Enabled => self.stw & 1 == 0,
            At::QuickStop | At::Reaction => true,
            _ => false,
        };
        let (_, _, down) = self.course().filter(|_| ends)?;
        let slope = self.slope(down);
        let time = self.from.abs().times(Fraction::new(slope.1, slope.0));
        Some(self.since + (time.0 + time.1 - 1) / time.1)
    }

    /// The status word.
    #[must_use]
    pub fn zsw(&self) -> u16 {
        let state = match self.at {
            At::StartDisable => 0x40,
            At::ReadyToStart => 0x01,
            At::Ready => 0x03,
            At::Enabled | At::QuickStop => 0x07,
            At::Reaction => 0x0F,
            At::Fault => 0x08,
        };
        let f = self.frequency();
        let reached = self.is_on() && !f.abs().less(Fraction::new(self.value(1617).into(), 1));
        let bits = [
            (4, self.stw & 2 != 0),
            (5, self.stw & 4 != 0 && self.at != At::QuickStop),
            (8, f.same(self.wanted())),
            (9, matches!(self.value(1621), 2 | 3 | 5 | 6)),
            (10, reached),
            (11, f.0 >= 0),
            (12, f.0 < 0),
        ];
        let set = bits.iter().filter(|(_, is)| *is);
        set.fold(state | self.stw & 0xC000, |word, (bit, _)| word | 1 << bit)
    }

    /// The main actual value.
    #[must_use]
    pub fn hiw(&self) -> u16 {
        let most = i128::from(self.value(1205)).max(1);
        let full = self.frequency().times(Fraction::new(16_384, most));
        word(full.rounded())
    }

    /// The second actual value.
    #[must_use]
    pub fn actual_2(&self) -> u16 {
        let f = self.frequency();
        let nominal = i128::from(self.value(1301));
        let on = i64::from(self.is_on());
        let share = |number: u16| {
            let scale = i128::from(self.value(number));
            let all = (nominal > 0).then(|| f.times(Fraction::new(scale, nominal)).cut());
            all.unwrap_or(0)
        };
        match self.value(1517) {
            1 => word(f.abs().cut()),
            2 => word(f.cut()),
            3 => word((self.value(1309) * on).into()),
            4 => word(share(1304).abs().min(self.value(1304).into())),
            6 => word((self.value(1306) * on).into()),
            9 => word(share(1302).abs()),
            10 => word(share(1302)),
            _ => 0,
        }
    }

    /// Executes a task of the parameter channel under PPO1 or PPO2; gives AK and PWE of the answer.
    pub fn task(&mut self, pke: u16, ind: u16, pwe: u32, ppo1: bool) -> (u8, u32) {
        let task = pke >> 12;
        if task == 0 {
            return (0, 0);
        }
        if task > 9 {
            return (7, 201);
        }
        let found = PARAMETERS.iter().find(|row| row.number == pke & 0x7FF);
        let Some(parameter) = found.filter(|row| row.section != "5.6") else {
            return (7, 0);
        };
        match self.execute(task, parameter, ind, pwe, ppo1) {
            Ok(answer) => answer,
            Err(error) => (7, error),
        }
    }

    fn execute(
        &mut self,
        task: u16,
        parameter: &Parameter,
        ind: u16,
        pwe: u32,
        ppo1: bool,
    ) -> Result<(u8, u32), u32> {
        let array = parameter.count > 1 || parameter.has(Flag::Array);
        let long = parameter.has(Flag::Long);
        let change = matches!(task, 2 | 3 | 7 | 8);
        let (element, set) = if parameter.has(Flag::Set) {
            (ind >> 10, ind >> 8 & 3)
        } else {
            (ind >> 8, 0)
        };
        let refuse = |when: bool, error: u32| if when { Err(error) } else { Ok(()) };
        refuse(task == 4, 9)?;
        refuse(task == 5, 7)?;
        refuse(task >= 6 && !array, 4)?;
        if task == 9 {
            return Ok((6, parameter.count.into()));
        }
        refuse(element >= parameter.count.into(), 3)?;
        refuse(change && parameter.has(Flag::ReadOnly), 1)?;
        refuse(change && long != matches!(task, 3 | 8), 201)?;
        refuse(long && ppo1, if change { 201 } else { 202 })?;
        refuse(change && self.is_on() && !parameter.has(Flag::Online), 1)?;
        if change {
            let signed = parameter.is_signed();
            let value = match (long, signed) {
                (true, _) => i64::from(pwe.cast_signed()),
                (false, true) => i64::from(((pwe & 0xFFFF) as u16).cast_signed()),
                (false, false) => i64::from(pwe & 0xFFFF),
            };
            let least = parameter
                .least
                .resolve(|number| self.value_at(number, 0, set));
            let most = parameter
                .most
                .resolve(|number| self.value_at(number, 0, set));
            refuse(!(least..=most).contains(&value), 2)?;
            self.anchor();
            self.values.insert((parameter.number, element, set), value);
        }
        let value = self.shown(parameter.number, element, set);
        let kind = 1 + u8::from(long) + if task >= 6 { 3 } else { 0 };
        let bits = value.cast_unsigned();
        let mask = if long { 0xFFFF_FFFF } else { 0xFFFF };
        Ok((kind, u32::try_from(bits & mask).unwrap_or(0)))
    }

    /// What a parameter reads.
    fn shown(&self, number: u16, element: u16, set: u16) -> i64 {
        match (number, element) {
            (918, _) => self.value(1624),
            (947, _) if self.fault != 0 => self.fault,
            (947, _) => self.past[0],
            (967, _) => self.stw.into(),
            (968, _) => self.zsw().into(),
            (1800, _) => self.fault,
            (1801..=1805, 0) => self.past[usize::from(number - 1801)],
            (1806, _) => self.counters[usize::from(element)],
            (1811, _) => i64::from(self.zsw() >> 10 & 1),
            (1813, 0) => i64::try_from(self.frequency().abs().cut()).unwrap_or(0),
            (1825, 0) => 25,
            (1825, 1) => self.value(1609),
            (1825, _) => 540,
            _ => self.value_at(number, element, set),
        }
    }
}

/// A signed value as a word; what does not fit is cut.
fn word(value: i128) -> u16 {
    let cut = value.clamp(-0x8000, 0x7FFF);
    i16::try_from(cut).unwrap_or(0).cast_unsigned()
}
