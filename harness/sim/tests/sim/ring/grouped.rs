//! Drives that are advanced together against the same drives, each advanced by itself: the same records, times, remarks, states
//! and cells, on random rings, telegrams, faults, silences, cuts and looks (ND21 9.1-9.9).

use super::against_reference::{fault, telegram};
use super::common::{Random, repeat, seed};
use harness_proto::line::{Rate, Received};
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::{bits, ee, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE};
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::{BusSetting, Properties};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::Span;
use harness_sim::fault::{DriveFault, LinkFault};
use harness_sim::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory};
use harness_sim::novobus::device::Device;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

/// Drives of which rings are made here.
trait Tried: Device {
    /// A drive that monitors time-outs or not.
    fn make(random: &mut Random, monitored: bool) -> Self;

    /// Lets something happen to it from outside the bus; the same with the same number.
    fn touch(&mut self, number: u64);

    /// All of it that can be seen.
    fn seen(&self) -> String;
}

impl Tried for PlainDrive {
    fn make(_random: &mut Random, monitored: bool) -> Self {
        let mut eeprom = [0; 256];
        eeprom[usize::from(ee::SELFTEST)] = if monitored { 0x80 } else { 0 };
        Self::new(Properties::default(), eeprom)
    }

    fn touch(&mut self, number: u64) {
        assert!(self.memory_mut().poke(0xFF36, number as u8));
    }

    fn seen(&self) -> String {
        format!("{:?} {:?}", self.bus_end(), self.memory())
    }
}

impl Tried for Nd21Drive {
    /// Most drives move, each a little differently; some blocked ones stand still.
    fn make(random: &mut Random, monitored: bool) -> Self {
        let mut eeprom = factory::eeprom();
        if monitored {
            eeprom[usize::from(ee::SELFTEST)] |= 0x80;
        }
        let mut properties = Nd21Properties::default();
        let deaf = ["answered", "silent"][random.below(2) as usize];
        assert!(properties.set("self-test-bus", BusSetting::Word(deaf)));
        let mut drive = Self::new(Properties::default(), properties, eeprom);
        drive.stimulate(Stimulus::Input(Input::Gpin3, true));
        drive.stimulate(Stimulus::Input(Input::Gpin5, random.below(3) > 0));
        let program = drive.program_mut();
        program.write(ram::SW_VERSION, 0x43 | bits::sw_version::REVERSING);
        program.write(ram::REVERS_TAKT, 1 + random.below(16) as u8);
        program.write(ram::NSOLL, random.below(24) as u8);
        drive
    }

    fn touch(&mut self, number: u64) {
        let value = (number / 13) as i32;
        let stimulus = match number % 13 {
            0..=2 => Stimulus::Input(Input::Gpin5, value % 2 == 0),
            3 => Stimulus::Input(Input::Gpin3, value % 2 == 0),
            4 => Stimulus::Load(value * 100),
            5 => Stimulus::Jammed(value % 2 == 0),
            6 => Stimulus::Cooler(value * 40),
            7 => Stimulus::Cam(Input::Gpin4, 0, 30_000),
            8 => Stimulus::Error(ErrorCode::OverTempKk),
            9 => {
                let program = self.program_mut();
                program.write(ram::SCOPE_SIGNAL1, ram::BUS_ADDR as u8);
                program.write(ram::SCOPE_SIGNAL2, ram::FLAGS2 as u8);
                return program.write(ram::SCOPE_STATUS, 0);
            }
            10 => return self.program_mut().write(ram::EEPROM_CONTROL, 0x82),
            11 => return Memory::reset(self.program_mut()),
            _ => return self.program_mut().write(ram::NSOLL, value as u8),
        };
        self.stimulate(stimulus);
    }

    fn seen(&self) -> String {
        let program = self.program();
        let state = (self.in_error(), self.cause(), self.deadline(), self.shown());
        format!("{state:?} {:?}", program.cells())
    }
}

struct Pair<D> {
    grouped: Ring<D>,
    each: Ring<D>,
    drives: u8,
}

impl<D: Tried> Pair<D> {
    fn new(random: &mut Random) -> Self {
        let most = if random.below(8) == 0 { 250 } else { 24 };
        let drives = 1 + random.below(most) as u8;
        let monitored = random.below(10) == 0;
        let size = RingSize::new(u64::from(drives)).expect("1 to 250");
        let mut grouped = Ring::new(size, Rate::Baud38400, |k| {
            D::make(random, monitored || k == 7)
        });
        if random.below(2) == 0 {
            grouped.stop_recording();
        }
        let mut each = grouped.clone();
        each.advance_each();
        Self {
            grouped,
            each,
            drives,
        }
    }

    fn both(&mut self, act: impl Fn(&mut Ring<D>)) {
        act(&mut self.grouped);
        act(&mut self.each);
    }

    fn run(&mut self, random: &mut Random) {
        let now = self.each.now();
        let next = self.each.next_event().unwrap_or(now);
        let until = match random.below(5) {
            0 | 1 => next,
            2 => now + Span::from_units(random.below(5_000_000)),
            3 => now + self.each.byte_time() * random.below(40),
            _ => now + self.each.byte_time() * random.below(2 * u64::from(self.drives) + 30),
        };
        self.both(|ring| ring.run_until(until));
    }

    fn act(&mut self, random: &mut Random) {
        let now = self.each.now();
        let link = random.below(u64::from(self.drives) + 1) as usize;
        let k = random.below(u64::from(self.drives)) as u8;
        let byte = 1 + random.below(60);
        match random.below(40) {
            0..=11 => {
                let bytes: Vec<u8> = (0..1 + random.below(6))
                    .flat_map(|_| telegram(random, self.drives))
                    .collect();
                self.both(|ring| ring.send(now, &bytes));
            }
            12 => self.both(|ring| ring.send(now, &CHECK_SEQUENCE)),
            13 => {
                let bytes = [0; 30]
                    .into_iter()
                    .chain(CHECK_SEQUENCE)
                    .collect::<Vec<_>>();
                self.both(|ring| ring.send(now, &bytes));
            }
            14 => {
                let fault = fault(random).0;
                self.both(|ring| ring.arm_link(link, byte, fault));
            }
            15 => {
                let faults = [
                    LinkFault::Cut,
                    LinkFault::Join,
                    LinkFault::Join,
                    LinkFault::Break(Span::from_micros(700)),
                ];
                let fault = faults[random.below(4) as usize];
                self.both(|ring| ring.suffer_link(link, fault));
            }
            16 => {
                let faults = [
                    DriveFault::Off,
                    DriveFault::On,
                    DriveFault::Stuck(0x80),
                    DriveFault::Unstuck,
                ];
                let fault = faults[random.below(4) as usize];
                if random.below(2) == 0 {
                    self.both(|ring| ring.suffer_drive(k, fault));
                } else {
                    self.both(|ring| ring.arm_drive(k, byte, fault));
                }
            }
            17 if random.below(4) == 0 => self.both(Ring::begin),
            18 | 28..=30 => {
                let number = random.below(1_200);
                self.both(|ring| ring.drive_mut(k).expect("a drive").touch(number));
            }
            19 if random.below(4) == 0 => {
                self.both(|ring| {
                    ring.open_link(link);
                    ring.feed_link(link, Received::good(0x80));
                });
                while let (Some(ours), theirs) =
                    (self.grouped.fetch_link(link), self.each.fetch_link(link))
                {
                    assert_eq!(Some(ours), theirs);
                }
            }
            20 => assert_eq!(self.grouped.take_record(link), self.each.take_record(link)),
            21 => {
                let mut faults = (Vec::new(), Vec::new());
                faults.0.extend(self.grouped.unused_link_faults());
                faults.1.extend(self.each.unused_link_faults());
                assert_eq!(faults.0, faults.1);
            }
            22 => self.look(k),
            23 => self.both(|ring| ring.record_link(link)),
            24 if random.below(4) == 0 => self.same(),
            27 if random.below(4) == 0 => {
                self.both(Ring::record_anew);
                let delivered = |ring: &Ring<D>| ring.delivered(link);
                assert_eq!(delivered(&self.grouped), delivered(&self.each));
            }
            25 if random.below(4) == 0 => {
                let delay = LinkFault::Delay(Span::from_micros(random.below(2_000)));
                self.both(|ring| ring.arm_link(link, byte, delay));
            }
            26 => {
                // A loop's silence, and everything home.
                let until =
                    now + self.each.byte_time() * (u64::from(self.drives) + 60 + random.below(60));
                self.both(|ring| ring.run_until(until));
            }
            27 if random.below(3) == 0 => {
                let bytes = long(random, self.drives);
                self.both(|ring| ring.send(now, &bytes));
            }
            _ => self.run(random),
        }
    }

    fn all_in_error(&self) -> bool {
        let in_error = |k| self.each.drive(k).is_some_and(Device::in_error);
        (0..self.drives).all(in_error)
    }

    fn look(&self, k: u8) {
        let (ours, theirs) = (self.grouped.drive(k), self.each.drive(k));
        let (ours, theirs) = (ours.expect("a drive"), theirs.expect("a drive"));
        assert_eq!(ours.seen(), theirs.seen(), "drive {k}");
    }

    fn same(&mut self) {
        (0..self.drives).for_each(|k| self.look(k));
        assert_eq!(self.grouped.trace(), self.each.trace());
    }

    fn compare(&mut self) {
        assert_eq!(self.grouped.next_event(), self.each.next_event());
        assert_eq!(self.grouped.next_home(), self.each.next_home());
        assert_eq!(self.grouped.busy(), self.each.busy());
        assert_eq!(self.grouped.carried(), self.each.carried());
        let arrived = |ring: &Ring<D>| {
            let links = 0..=usize::from(self.drives);
            links.map(|link| ring.arrived(link)).collect::<Vec<_>>()
        };
        assert_eq!(arrived(&self.grouped), arrived(&self.each));
        assert_eq!(arrived(&self.each).iter().sum::<u64>(), self.each.carried());
        loop {
            let (ours, theirs) = (self.grouped.receive(), self.each.receive());
            assert_eq!(ours, theirs);
            if ours.is_none() {
                return;
            }
        }
    }
}

/// Bytes without a gap, long enough for groups to begin among them: of a ring in normal mode, or in the error mode, with sequences whole
/// and broken (ND21 9.7, 9.8).
fn long(random: &mut Random, drives: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let in_error = random.below(4) > 0;
    if in_error {
        bytes.extend([0; 40]);
    }
    let length = bytes.len() + 100 + random.below(500) as usize;
    while bytes.len() < length {
        let more = 1 + random.below(30) as usize;
        match random.below(6) {
            0 if in_error => bytes.extend(vec![0; more]),
            1 if in_error => bytes.extend(&SEQUENCE[..1 + random.below(5) as usize]),
            2 if in_error => bytes.extend((0..more).map(|_| random.below(256) as u8)),
            // What the first drives add up to FF, 44, 72 or 4C.
            3 if in_error => {
                let places = random.below(u64::from(drives) + 1) as u8;
                let near = |byte: &u8| byte.wrapping_sub(places);
                bytes.extend(SEQUENCE[..4].iter().map(near));
            }
            4 => bytes.extend(vec![SYNCO; more]),
            _ => bytes.extend(telegram(random, drives)),
        }
    }
    bytes
}

fn play<D: Tried>(cases: u64, test: &str) {
    let (mut grouped, mut in_error) = (0, 0);
    for case in 0..cases {
        let mut random = Random(seed().wrapping_mul(cases).wrapping_add(case));
        let mut pair = Pair::<D>::new(&mut random);
        let played = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            for _ in 0..20 + random.below(60) {
                pair.act(&mut random);
                pair.compare();
                let groups = u64::from(pair.grouped.grouped() > 0);
                grouped += groups;
                in_error += groups * u64::from(pair.all_in_error());
                assert_eq!(pair.each.grouped(), 0);
            }
            pair.same();
        }));
        assert!(played.is_ok(), "case {case}; {}", repeat(test));
    }
    // A test without groups would show nothing.
    assert!(grouped > 2 * cases, "{grouped} steps with groups");
    assert!(8 * in_error > cases, "{in_error} steps in the error mode");
}

#[test]
fn grouped_drives_do_what_each_does_by_itself() {
    play::<PlainDrive>(1_000, "grouped_drives_do_what_each_does_by_itself");
}

/// Whole drives do much of their own between two bytes that are for them (ND21 4.1).
#[test]
fn grouped_nd21s_do_what_each_does_by_itself() {
    play::<Nd21Drive>(300, "grouped_nd21s_do_what_each_does_by_itself");
}

#[test]
#[ignore = "takes more than 26 minutes of processor time; .ci/nightly runs it"]
fn grouped_drives_do_what_each_does_in_a_million_rings() {
    let test = "grouped_drives_do_what_each_does_in_a_million_rings -- --ignored";
    play::<PlainDrive>(1_000_000, test);
}
