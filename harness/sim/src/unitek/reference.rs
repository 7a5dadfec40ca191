//! A second, simple model of the drive, written from the rules alone: one function for a frame, one for a millisecond.
//!
//! It shares no code with [`Drive`](super::Drive) but the register table's data and the properties' types. It runs every
//! millisecond, keeps plain numbers, and knows neither instants nor a bus: frames come in and go out at once.

use super::inputs::Inputs;
use harness_proto::can::Frame;
use harness_proto::unitek::REGISTERS;
use harness_proto::unitek::properties::Properties;
use std::sync::Arc;

/// A cyclic entry: register, interval, millisecond of the request, number of the request.
type Entry = (u8, u64, u64, u64);

/// The contents of all registers, by number.
type ModelContents = [u32; 256];

/// The model.
#[derive(Clone, Debug)]
pub struct Reference {
    p: Properties,
    /// What is connected.
    pub inputs: Inputs,
    held: ModelContents,
    store: [Option<Arc<ModelContents>>; 2],
    rx: u32,
    tx: u32,
    second: (u32, u32),
    lost: bool,
    mode: char,
    speed: i64,
    position: i64,
    ramp: i64,
    torque: i64,
    turn: i64,
    homing: i64,
    cal: bool,
    timeout: bool,
    free: bool,
    /// Milliseconds since power-up.
    pub now: u64,
    last: u64,
    table: [Option<Entry>; 8],
    asked: u64,
    before: u32,
    set_up: bool,
}

fn signed(number: u8) -> bool {
    REGISTERS[number as usize].signed
}

fn wide(number: u8) -> bool {
    REGISTERS[number as usize].width.bits() == 32
}

fn access(number: u8) -> &'static str {
    REGISTERS[number as usize].access.name()
}

fn i16_of(raw: u32) -> i64 {
    let low = i64::from(raw % 65_536);
    if low >= 32_768 { low - 65_536 } else { low }
}

fn i32_of(raw: u32) -> i64 {
    let all = i64::from(raw);
    if all >= 1 << 31 { all - (1 << 32) } else { all }
}

fn raw_of(number: i64) -> u32 {
    (number.rem_euclid(1 << 32)) as u32
}

impl Reference {
    /// The model after power-up.
    #[must_use]
    pub fn new(p: Properties, inputs: Inputs) -> Self {
        let held = REGISTERS.map(|register| register.dump);
        let mut new = Self {
            store: [Some(Arc::new(held)), None],
            held,
            inputs,
            rx: 0x201,
            tx: 0x181,
            second: (0, 0),
            lost: false,
            mode: if p.power_up_mode.word() == "position" {
                'p'
            } else {
                's'
            },
            speed: 0,
            position: 0x86B9,
            ramp: 0,
            torque: 0,
            turn: 0,
            homing: 0,
            cal: false,
            timeout: false,
            free: false,
            now: 0,
            last: 0,
            table: [None; 8],
            asked: 0,
            before: 0,
            set_up: false,
            p,
        };
        let mask = u32::from_str_radix(p.event_mask.word(), 16).unwrap_or(0);
        let lock = if p.lock_at_power_up.word() == "yes" {
            4
        } else {
            0
        };
        for (number, value) in [(0x31, 0), (0x6E, 0), (0x90, 0), (0x51, lock), (0x52, mask)] {
            new.held[number] = value;
        }
        new.before = new.read(0x40);
        new
    }

    /// What all registers hold; what a read gives can differ.
    #[must_use]
    pub const fn held(&self) -> &[u32; 256] {
        &self.held
    }

    fn at(&self, number: u8) -> u32 {
        self.held[number as usize]
    }

    fn ready(&self) -> bool {
        self.errors().is_multiple_of(65_536)
    }

    fn errors(&self) -> u32 {
        let time_out = if self.timeout { 8 } else { 0 };
        let no_power = if self.inputs.dc_bus { 0 } else { 32 };
        self.inputs.faults | time_out | no_power
    }

    fn enabled(&self) -> bool {
        let waits = self.p.enable_after_lock.word() == "yes" && !self.free;
        self.inputs.run && self.inputs.rfe && self.ready() && self.at(0x51) & 4 == 0 && !waits
    }

    fn tolerance(&self) -> bool {
        let away = (i32_of(self.at(0x6E)) - self.position).abs();
        let found = self.mode == 'p' && self.homing == 0 && away <= i64::from(self.at(0x79));
        self.inputs.tolerance.unwrap_or(found)
    }

    fn measured(&self) -> i64 {
        self.inputs.speed.map_or(self.speed, i64::from)
    }

    /// What a read gives.
    #[must_use]
    pub fn read(&self, number: u8) -> u32 {
        let i = &self.inputs;
        let bit = |place: u32, on: bool| if on { 1 << place } else { 0 };
        let follows = || self.mode == 'p' && self.enabled();
        let slow = || self.measured().abs() < 328;
        let raw = match number {
            0x20 | 0x27 | 0x5F if self.mode == 't' && self.enabled() => {
                let torque = i16_of(self.at(0x90));
                let size = torque.abs() * i64::from(self.at(0xD9)) / 43_690;
                raw_of(if torque < 0 { -size } else { size })
            }
            0x20 | 0x27 | 0x5F => 0,
            0x30 | 0x32 | 0xA8 => raw_of(self.measured()),
            0x40 => {
                let f = self.p.status_bits.word() == "full";
                bit(0, self.enabled())
                    + bit(2, i.limit1)
                    + bit(3, i.limit2)
                    + bit(4, f && self.ready())
                    + bit(5, i.icns)
                    + bit(6, f && self.mode == 't')
                    + bit(7, self.mode == 'p')
                    + bit(8, self.mode != 't')
                    + bit(9, f && slow())
                    + bit(11, f && self.homing > 0)
                    + bit(12, self.inputs.calibrated.unwrap_or(self.cal))
                    + bit(13, self.tolerance())
                    + bit(14, f && self.ready())
            }
            0x49 => i.motor_temperature.into(),
            0x4A => i.igbt_temperature.into(),
            0x4B => i.air_temperature.into(),
            0x6D => raw_of(self.position),
            0x91 if follows() => self.at(0x6E),
            0x91 => raw_of(self.position),
            0x70 if follows() => raw_of(i32_of(self.at(0x6E)) - self.position),
            0x70 => 0,
            0x8F => self.errors(),
            0xCE => self.at(0xC8),
            0xD8 => {
                bit(0, i.limit1)
                    + bit(1, i.limit2)
                    + bit(2, i.din2)
                    + bit(3, i.din1)
                    + bit(4, i.run)
                    + bit(5, i.rfe)
                    + bit(10, self.ready())
                    + bit(11, self.enabled())
            }
            0xE2 => bit(0, self.ready()),
            0xE3 => bit(0, self.enabled()),
            0xE4 => bit(0, i.limit1),
            0xE5 => bit(0, i.limit2),
            0xE6 => bit(0, i.din1),
            0xE7 => bit(0, i.din2),
            0xE8 => bit(0, i.run),
            0xEB => {
                if i.dc_bus {
                    i.voltage.into()
                } else {
                    1
                }
            }
            0xEF => bit(0, self.errors() & 0xFFDF == 0),
            0xF2 => bit(0, !self.enabled()),
            0xF3 => bit(0, i.icns),
            0xF4 => bit(0, self.tolerance()),
            0xF5 => bit(0, slow()),
            _ => self.at(number),
        };
        if wide(number) { raw } else { raw % 65_536 }
    }

    fn answer(&self, number: u8, event: bool, tx: u32) -> Option<Frame> {
        let p = &self.p;
        if self.lost {
            return None;
        }
        if p.unknown_register.word() == "silent" && REGISTERS[number as usize].dump == 0xFACE {
            return None;
        }
        let raw = self.read(number);
        let map = number == 0x40 || number == 0x8F;
        let cut =
            map && p.map_reply.word() == "short" && !(event && p.event_reply.word() == "native");
        let six = self.at(0xDC) / 256 % 2 == 1;
        let value = if cut {
            raw % 65_536
        } else if !wide(number) && signed(number) && p.wide_replies.word() == "sign" {
            raw_of(i16_of(raw))
        } else {
            raw
        };
        let long = six || (wide(number) && !cut);
        let [a, b, c, d] = value.to_le_bytes();
        let bytes = if long {
            &[number, a, b, c, d, p.stuff][..]
        } else {
            &[number, a, b, p.stuff]
        };
        Frame::base(tx as u16, bytes).ok()
    }

    /// A frame arrives; the frame that answers it.
    pub fn frame(&mut self, frame: &Frame) -> Option<Frame> {
        let d = frame.data();
        let id = frame.id().number();
        let second = id != self.rx && id == self.second.0 && id != 0;
        let deaf = frame.id().is_extended() || frame.is_remote() || (id != self.rx && !second);
        if self.lost || deaf || d.len() < 3 || (d.len() == 4 && self.p.dlc4.word() == "ignore") {
            return None;
        }
        self.last = self.now;
        if d[0] == 0x3D {
            let (first, second_tx) = (self.tx, self.second.1);
            let tx = if second && (1..=0x7FF).contains(&second_tx) {
                second_tx
            } else {
                first
            };
            return self.request(d[1], d[2], tx);
        }
        let low = u32::from(d[1]) + 256 * u32::from(d[2]);
        let value = if d.len() < 5 {
            if !wide(d[0]) {
                low
            } else if self.p.short_write.word() == "keep-high" {
                self.at(d[0]) / 65_536 * 65_536 + low
            } else if signed(d[0]) {
                raw_of(i16_of(low))
            } else {
                low
            }
        } else if wide(d[0]) {
            low + 65_536 * u32::from(d[3]) + 65_536 * 256 * u32::from(d[4])
        } else {
            low
        };
        self.write(d[0], value);
        None
    }

    fn request(&mut self, number: u8, t: u8, tx: u32) -> Option<Frame> {
        let running = self
            .table
            .iter()
            .position(|e| e.is_some_and(|e| e.0 == number));
        let stops = t == 255 || (t == 0 && self.p.oneshot_stops.word() == "yes");
        if let (Some(running), true) = (running, stops) {
            self.table[running] = None;
        }
        if t == 0 {
            return self.answer(number, false, tx);
        }
        if t == 255 {
            return None;
        }
        let mut place = running.or(self.table.iter().position(Option::is_none));
        if place.is_none() && self.p.table_full.word() == "oldest" {
            place = (0..8).min_by_key(|&k| self.table[k].map_or(0, |e| e.3));
        }
        let place = place?;
        self.asked += 1;
        self.table[place] = Some((number, t.into(), self.now, self.asked));
        if self.p.cyclic_first.word() == "at-once" {
            return self.answer(number, false, self.tx);
        }
        None
    }

    fn write(&mut self, number: u8, value: u32) {
        match access(number) {
            "FN" => self.function(number, value),
            "RW" | "SP" => {
                if number == 0x68 || number == 0x69 {
                    let printed = self.p.id_range.word() == "printed";
                    let range = match (printed, number) {
                        (false, _) => 1..=0x7FF,
                        (true, 0x68) => 0x201..=0x27F,
                        (true, _) => 0x181..=0x1FF,
                    };
                    if !range.contains(&value) {
                        return;
                    }
                }
                let before = self.at(number);
                self.held[number as usize] = value;
                match number {
                    0x31 => self.mode = 's',
                    0x90 => self.mode = 't',
                    0x6E => self.mode = 'p',
                    0x7A => self.position = i32_of(value),
                    0x35 | 0xED | 0xC7 => self.ramp = 0,
                    0x51 if value / 16 % 2 == 1 && (before / 16).is_multiple_of(2) => {
                        self.set_up = self.p.event_at_set_up.word() == "at-once";
                    }
                    _ => {}
                }
                if number == 0x51 && before / 4 % 2 == 1 && (value / 4).is_multiple_of(2) {
                    self.timeout &= self.p.time_out_clear.word() == "cancel";
                    self.free = self.ready();
                }
                match number {
                    0x51 if value / 4 % 2 == 1 && self.p.lock_clears_command.word() == "yes" => {
                        self.held[0x31] = 0;
                        self.held[0x90] = 0;
                    }
                    _ => {}
                }
                self.identifiers();
            }
            _ => {}
        }
    }

    fn identifiers(&mut self) {
        if self.p.id_change.word() == "immediate" {
            self.rx = self.at(0x68);
            self.tx = self.at(0x69);
        }
        if self.p.second_identifiers.word() == "immediate" {
            self.second = (self.at(0x88), self.at(0x89));
            if self.second.0 > 0x7FF {
                self.second.0 = 0;
            }
        }
        if self.p.rate_change.word() == "immediate" {
            // A bit of 500 kbit/s is 10 quanta of 200 ns.
            let n = self.at(0x73);
            let quanta = (n / 256 % 64 + 1) * (3 + n % 16 + n / 16 % 8);
            self.lost = quanta != 10;
        }
    }

    fn function(&mut self, number: u8, value: u32) {
        if number == 0x8E && self.p.time_out_clear.word() == "cancel" {
            self.timeout = false;
        }
        if number == 0x84 && value < 2 {
            self.store[value as usize] = Some(Arc::new(self.held));
        }
        if number == 0x83 {
            if let Some(Some(stored)) = self.store.get(value as usize) {
                for n in 0..=255 {
                    if access(n) == "RW" {
                        self.held[n as usize] = stored[n as usize];
                    }
                }
            }
            self.identifiers();
        }
        if number == 0x78 && value == 1 && self.enabled() {
            self.mode = 'p';
            self.held[0x6E] = raw_of(self.position);
            self.homing = (self.p.homing_time.as_nanos() / 1_000_000).max(1) as i64;
        }
    }

    /// A millisecond passes; the frames that the drive sends by itself.
    pub fn millisecond(&mut self) -> Vec<Frame> {
        self.now += 1;
        self.motor();
        let limit = u64::from(self.at(0xD0));
        if limit > 0 && self.now - self.last >= limit {
            self.timeout = true;
        }
        self.free = self.free && self.ready();
        let mut out = Vec::new();
        let status = self.read(0x40);
        let (rises, falls) = (status & !self.before, self.before & !status);
        let mut news = match self.p.event_edges.word() {
            "rising" => rises,
            "falling" => falls,
            _ => rises | falls,
        };
        if self.set_up {
            news |= status;
        }
        if self.at(0x51) / 16 % 2 == 1 && news & self.at(0x52) != 0 {
            out.extend(self.answer(0x40, true, self.tx));
        }
        self.before = status;
        self.set_up = false;
        for place in 0..8 {
            let Some((number, t, since, _)) = self.table[place] else {
                continue;
            };
            if self.is_due(self.now - since, t) {
                out.extend(self.answer(number, false, self.tx));
            }
        }
        out
    }

    /// Whether a cycle of `t` ms sends, `gone` ms after its request.
    fn is_due(&self, gone: u64, t: u64) -> bool {
        if t == 1 || self.p.interval_accuracy.word() == "exact" {
            return gone.is_multiple_of(t);
        }
        // The odd frames are on time; the even ones come 1 ms later.
        let odd = gone.is_multiple_of(t) && gone / t % 2 == 1;
        let late = gone > t && (gone - 1).is_multiple_of(t) && ((gone - 1) / t).is_multiple_of(2);
        odd || late
    }

    fn motor(&mut self) {
        let enabled = self.enabled();
        if !enabled {
            self.homing = 0;
        }
        let limit = i16_of(self.at(0x34)).abs();
        let nmax = i64::from(self.at(0xC8));
        let blocked = |way: i64| (way > 0 && self.inputs.limit1) || (way < 0 && self.inputs.limit2);
        if enabled && self.mode == 'p' {
            let away = i32_of(self.at(0x6E)) - self.position;
            let most = nmax * 65_536 * limit / (32_767 * 60_000);
            let still = self.homing > 0 || blocked(away) || most == 0 || away == 0;
            let step = if still { 0 } else { away.min(most).max(-most) };
            self.position += step;
            self.speed = if step == away || still {
                0
            } else if step > 0 {
                limit
            } else {
                -limit
            };
        } else {
            if !enabled {
                self.ramped(0, 0, 2000);
            } else if self.mode == 't' {
                self.torque += i16_of(self.at(0x90)) * 32_767;
                let whole = self.torque.div_euclid(21_845_000);
                self.torque -= whole * 21_845_000;
                self.speed = (self.speed + whole).min(limit).max(-limit);
            } else {
                let mut target = i16_of(self.at(0x31)).min(limit).max(-limit);
                if blocked(target) {
                    target = 0;
                }
                let times = |n: u8| i64::from(self.at(n) % 65_536);
                let (v, up, down, stop) = (self.speed, times(0x35), times(0xED), times(0xC7));
                if blocked(v) {
                    self.ramped(0, target, stop);
                } else if (v > 0 && target <= 0) || (v < 0 && target >= 0) {
                    self.ramped(0, target, down);
                } else if target.abs() < v.abs() {
                    self.ramped(target, target, down);
                } else {
                    self.ramped(target, target, up);
                }
            }
            // A motor that stands keeps its position, and the rest of a count.
            if self.speed != 0 {
                self.turn += self.speed * nmax * 65_536;
                let counts = self.turn.div_euclid(1_966_020_000);
                self.turn -= counts * 1_966_020_000;
                self.position = i32_of(raw_of(self.position + counts));
            }
        }
        if self.homing > 0 {
            self.homing -= 1;
            if self.homing == 0 {
                self.position = i32_of(self.at(0x72));
                self.turn = 0;
                let home = self.at(0x72);
                self.held[0x6E] = home;
                self.cal = true;
            }
        }
    }

    fn ramped(&mut self, goal: i64, target: i64, ramp: i64) {
        if ramp == 0 {
            self.speed = goal;
        } else if self.speed != goal {
            self.ramp += 32_767;
            let step = self.ramp / ramp;
            self.ramp -= step * ramp;
            self.speed = if self.speed < goal {
                (self.speed + step).min(goal)
            } else {
                (self.speed - step).max(goal)
            };
        }
        if self.speed == target {
            self.ramp = 0;
        }
    }
}
