//! Simulated UNITEK drives on one CAN segment, in virtual time.

use harness_bench::link::bench_clock::BenchClock;
use harness_bench::link::{AnyStimulus, Capability, DriveFault, Line, Link, Moment, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::can::BitRate;
use harness_proto::time::Instant;
use harness_proto::unitek::properties::Properties;
use harness_proto::unitek::{DEFAULT_RX, DEFAULT_TX};
use harness_sim::record::{Channel, LineFrame, Trace};
use harness_sim::segment::{Host, Placed, Segment};
use harness_sim::unitek::deviation::{Deviant, Deviation, MasterDeviation};
use harness_sim::unitek::{Cause, Control, Drive, Inputs, Member, Stimulus};
use std::any::Any;

/// A station of the simulated segment: a host or a drive, which may deviate.
pub(crate) type Station = Member<Box<Deviant>>;

/// The bench's own place on its segment.
const BENCH: usize = 0;

/// A drive as it is switched on.
#[derive(Clone, Debug)]
pub(crate) struct DriveSetup {
    /// Its number, 1 to 127: by it scenarios and records name the drive.
    pub(crate) node: u8,
    /// On which it receives (68) and sends (69).
    pub(crate) identifiers: (u16, u16),
    pub(crate) properties: Properties,
    pub(crate) inputs: Inputs,
    /// Registers that differ from the dump, and their contents.
    pub(crate) registers: Vec<(u8, u32)>,
    /// What it controls at first; `None` leaves it to its properties.
    pub(crate) control: Option<Control>,
    /// Whether a lock was released after its power-up (`enable-after-lock`).
    pub(crate) released: bool,
    /// Whether it has the error of a time-out of the bus (D0).
    pub(crate) timed_out: bool,
    pub(crate) deviation: Option<&'static Deviation>,
}

impl DriveSetup {
    /// Node `node` as delivered: identifiers 200 + node and 180 + node (UNITEK 3.1).
    #[must_use]
    pub(crate) fn new(node: u8) -> Self {
        let offset = u16::from(node) - 1;
        Self {
            node,
            identifiers: (DEFAULT_RX + offset, DEFAULT_TX + offset),
            properties: Properties::default(),
            inputs: Inputs::default(),
            registers: Vec::new(),
            control: None,
            released: false,
            timed_out: false,
            deviation: None,
        }
    }

    /// The drive on a bus of this rate, switched on at `power_up`.
    #[must_use]
    pub(crate) fn drive(&self, rate: BitRate, power_up: Instant) -> Deviant {
        let (rx, tx) = self.identifiers;
        let mut registers = vec![(0x68, rx.into()), (0x69, tx.into())];
        registers.extend(&self.registers);
        let mut drive = Drive::new(self.properties, self.inputs, power_up).with_setup(&registers);
        drive = drive.on_bus_of(rate);
        if let Some(control) = self.control {
            drive = drive.with_control(control);
        }
        if self.released {
            drive = drive.with_release();
        }
        if self.timed_out {
            drive = drive.with_time_out();
        }
        Deviant::new(drive, self.deviation)
    }
}

/// A segment and its drives.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    /// The bit rate of all stations.
    pub(crate) rate: BitRate,
    pub(crate) drives: Vec<DriveSetup>,
    /// The way in which the bench's own master deviates, if it does.
    pub(crate) master: Option<&'static MasterDeviation>,
}

impl Setup {
    /// Nodes 1 to `drives` as delivered, at 500 kbit/s.
    #[must_use]
    pub(crate) fn of(drives: u8) -> Self {
        let drives = (1..=drives).map(DriveSetup::new);
        Self::new(BitRate::K500, drives.collect())
    }

    /// These drives, behind a master that does not deviate.
    #[must_use]
    pub(crate) const fn new(rate: BitRate, drives: Vec<DriveSetup>) -> Self {
        Self {
            rate,
            drives,
            master: None,
        }
    }

    /// A segment with the bench's host, after it the drives in their order, and after them hosts for `guests`.
    #[must_use]
    pub(crate) fn segment(&self, guests: usize) -> Segment<Station> {
        let host = || Member::Host(Host::default());
        let drive =
            |setup: &DriveSetup| Member::Drive(Box::new(setup.drive(self.rate, Instant::START)));
        let drives = self.drives.iter().map(drive);
        let guests = (0..guests).map(|_| host());
        let stations = std::iter::once(host()).chain(drives).chain(guests);
        Segment::new(self.rate, stations.collect())
    }
}

/// A bench on a segment of simulated drives. Its own host has one port.
#[derive(Debug)]
pub(crate) struct Bench {
    pub(super) segment: Segment<Station>,
    /// Place `k` is that of the `k`-th drive, counted from 1.
    pub(super) nodes: Vec<u8>,
    pub(super) clock: BenchClock,
}

impl Bench {
    pub(crate) const CAPABILITIES: [Capability; 8] = [
        Capability::Interposer,
        Capability::Tap,
        Capability::Memory,
        Capability::Power,
        Capability::Motion,
        Capability::Eeprom,
        Capability::Reset,
        Capability::Simulator,
    ];

    /// A bench with the drives of a setup, all just switched on.
    #[must_use]
    pub(crate) fn new(setup: &Setup) -> Self {
        Self::with_guests(setup, 0)
    }

    /// A bench with the drives of a setup and hosts for `guests` on the segment.
    #[must_use]
    pub(crate) fn with_guests(setup: &Setup, guests: usize) -> Self {
        Self {
            segment: setup.segment(guests),
            nodes: setup.drives.iter().map(|drive| drive.node).collect(),
            clock: BenchClock::default(),
        }
    }

    /// A drive, beside its bus.
    #[must_use]
    pub(crate) fn drive(&self, node: u8) -> Option<&Drive> {
        let drive = self.segment.station(self.place(node)?).drive()?;
        Some(drive.drive())
    }

    /// How many frames have won the bus so far.
    pub(super) const fn frames(&self) -> u64 {
        self.segment.frames()
    }

    fn place(&self, node: u8) -> Option<usize> {
        let place = self.nodes.iter().position(|other| *other == node)?;
        Some(place + 1)
    }

    pub(super) fn host(&mut self) -> Option<&mut Host> {
        self.segment.station_mut(BENCH).host_mut()
    }

    /// When the next thing that the bench can hear has ended.
    fn heard_at(&self) -> Option<Instant> {
        self.segment.station(BENCH).host().and_then(Host::heard_at)
    }

    fn suffer(&mut self, fault: PlacedFault) {
        let next = self.segment.frames() + 1;
        match fault {
            PlacedFault::Frame(_) => self.arm(next, fault),
            PlacedFault::Drive(node, fault) => self.power(node, fault),
            PlacedFault::Stimulus(node, AnyStimulus::Unitek(stimulus)) => {
                self.stimulate(node, stimulus);
            }
            // Of another bus.
            PlacedFault::Link(..) | PlacedFault::Stimulus(..) => {}
        }
    }

    fn arm(&mut self, frame: u64, fault: PlacedFault) {
        if let PlacedFault::Frame(fault) = fault {
            self.segment.inject(Placed {
                station: None,
                frame,
                fault,
            });
        }
    }

    fn power(&mut self, node: u8, fault: DriveFault) {
        let Some(place) = self.place(node) else {
            return;
        };
        let now = self.clock.now;
        if let Some(drive) = self.segment.station_mut(place).drive_mut() {
            match fault {
                DriveFault::Off => drive.drive_mut().switch_off(now),
                DriveFault::On => drive.drive_mut().restart(now),
                // Of a ring's transmitter.
                DriveFault::Stuck(_) | DriveFault::Unstuck => {}
            }
        }
        if fault == DriveFault::On {
            self.segment.restart(place);
        }
    }

    fn stimulate(&mut self, node: u8, stimulus: Stimulus) {
        let Some(place) = self.place(node) else {
            return;
        };
        if stimulus == Stimulus::BusOff {
            return self.segment.switch_off(place);
        }
        let now = self.clock.now;
        let Some(drive) = self.segment.station_mut(place).drive_mut() else {
            return;
        };
        let drive = drive.drive_mut();
        let mut inputs = *drive.inputs();
        match stimulus {
            Stimulus::Input(name, on) => {
                if let Some(input) = inputs.switch(name) {
                    *input = on;
                }
            }
            Stimulus::Force(name, raw) => {
                let _known = inputs.force(name, raw);
            }
            Stimulus::Register(number, raw) => return drive.poke(number, raw),
            Stimulus::BusOff => {}
        }
        drive.set_inputs(now, inputs);
    }

    /// Whether a drive still has to answer a request.
    fn owes(&self, place: usize) -> bool {
        let drive = self.segment.station(place).drive();
        let waiting = drive.and_then(|drive| drive.drive().wants());
        !self.segment.is_off(place) && waiting.is_some_and(|wish| wish.cause == Cause::Asked)
    }

    pub(super) fn run_to(&mut self, at: Instant) {
        self.segment.run_to(at);
        self.clock.now = self.clock.now.max(at);
        while let Some(fault) = self.clock.due() {
            self.suffer(fault);
        }
    }
}

impl Line for Bench {
    fn medium(&self, _port: usize) -> Medium {
        Medium::Frames(self.segment.rate())
    }

    fn now(&self) -> Instant {
        self.clock.since_origin(self.clock.now)
    }

    fn send(&mut self, _port: usize, what: Out<'_>) -> Instant {
        let rate = self.segment.rate();
        let now = self.clock.now;
        let free = self.segment.free_at();
        self.clock.left = self.clock.left.max(now).max(free);
        for frame in what.frames() {
            self.clock.left += rate.time_of(frame.wire_bits());
            if let Some(host) = self.host() {
                host.send(now, *frame);
            }
        }
        self.clock.since_origin(self.clock.left)
    }

    fn receive(&mut self, _port: usize) -> Option<(Instant, HeardPiece)> {
        let now = self.clock.now;
        self.heard_at().filter(|at| *at <= now)?;
        let (at, heard) = self.host()?.receive()?;
        Some((self.clock.since_origin(at), HeardPiece::Frame(heard)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let until = self.clock.on_bench(until);
        let busy = self.busy();
        loop {
            let heard = self.heard_at().filter(|at| *at > self.clock.now);
            let fault = self.clock.next_fault();
            let event = self.segment.next_due();
            let next = [heard, fault, event].into_iter().flatten().min();
            let Some(next) = next else {
                self.run_to(until);
                return false;
            };
            if next >= until {
                self.run_to(until);
                return true;
            }
            self.run_to(next.max(self.clock.now));
            if heard == Some(next) || fault == Some(next) || busy != self.busy() {
                return true;
            }
        }
    }
}

impl Link for Bench {
    fn capabilities(&self) -> &[Capability] {
        &Self::CAPABILITIES
    }

    fn listens(&self, _: usize, _: usize) -> bool {
        true
    }

    fn begin(&mut self) {
        self.clock.begin();
        self.segment.begin();
        if let Some(host) = self.host() {
            host.forget();
        }
    }

    fn busy(&self) -> bool {
        let host = self.segment.station(BENCH).host();
        let speaks = !self.segment.is_unheard(BENCH) && !self.segment.is_off(BENCH);
        let sends = speaks && host.is_some_and(|host| host.waiting() > 0);
        let hears = self.heard_at().is_some_and(|at| at > self.clock.now);
        sends || (speaks && hears) || (1..=self.nodes.len()).any(|place| self.owes(place))
    }

    fn inject(&mut self, _port: usize, fault: PlacedFault, moment: Moment) {
        match moment {
            Moment::Now => self.suffer(fault),
            Moment::Byte(number) => self.arm(number, fault),
            Moment::At(at) => {
                if let Some(due) = self.clock.schedule(at, fault) {
                    self.suffer(due);
                }
            }
        }
    }

    fn beside(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn unused_faults(&self) -> Vec<String> {
        let placed = self.segment.unused_faults().iter();
        let placed = placed.map(|placed| format!("frame {}: {}", placed.frame, placed.fault));
        let scheduled = self.clock.left_over().map(|(at, fault)| match fault {
            PlacedFault::Frame(fault) => format!("the next frame at {at}: {fault}"),
            PlacedFault::Drive(node, fault) => format!("drive {node} at {at}: {fault}"),
            other => format!("{other} at {at}"),
        });
        placed.chain(scheduled).collect()
    }

    fn record(&mut self, on: bool) {
        match on {
            true => self.segment.record_anew(),
            false => self.segment.keep_no_record(),
        }
    }

    fn carried(&self) -> u64 {
        self.segment.record().len() as u64
    }

    fn drives(&self, _port: usize) -> u8 {
        u8::try_from(self.nodes.len()).unwrap_or(u8::MAX)
    }

    fn trace(&self, port: usize) -> Trace {
        let named = |frame: &LineFrame| {
            let place = frame.from.map_or(BENCH, usize::from);
            let from = place.checked_sub(1).and_then(|place| self.nodes.get(place));
            LineFrame {
                from: from.copied(),
                ..*frame
            }
        };
        let mut trace = Trace {
            channels: vec![Channel::of_frames(
                self.segment.record().iter().map(named).collect(),
            )],
            ..Trace::empty(self.drives(port))
        };
        trace.count_from(self.clock.origin().since_start());
        trace
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_bench::link::FrameFault;
    use harness_proto::can;
    use harness_proto::time::Span;

    fn at(micros: u64) -> Instant {
        Instant::START + Span::from_micros(micros)
    }

    /// Sends a frame, and gives what comes within 10 ms.
    fn ask(bench: &mut Bench, text: &str) -> Vec<(Instant, String)> {
        let frame: can::Frame = text.parse().expect("a frame");
        bench.send(0, Out::Frames(&[frame]));
        wait(bench, 10)
    }

    fn wait(bench: &mut Bench, millis: u64) -> Vec<(Instant, String)> {
        let until = bench.now() + Span::from_millis(millis);
        let mut came = Vec::new();
        while bench.now() < until {
            bench.wait(until);
            came.extend(std::iter::from_fn(|| bench.receive(0)).map(|(at, heard)| {
                let text = match heard.frame() {
                    Some(can::CanEvent::Frame(frame)) => frame.to_string(),
                    other => format!("{other:?}"),
                };
                (at, text)
            }));
        }
        came
    }

    fn frames(came: &[(Instant, String)]) -> Vec<&str> {
        came.iter().map(|(_, text)| text.as_str()).collect()
    }

    /// 77 bits of request without its intermission, and the reply of 82 bits after it (ex 8).
    #[test]
    fn a_request_is_answered_at_once() {
        let mut bench = Bench::new(&Setup::of(1));
        bench.begin();
        let came = ask(&mut bench, "201#3D1B00");
        let bits: u32 = ["201#3D1B00", "181#1BD80100"]
            .iter()
            .map(|text| text.parse::<can::Frame>().expect("a frame").wire_bits())
            .sum();
        let end = Instant::START + BitRate::K500.time_of(bits - 3);
        assert_eq!(came, [(end, "181#1BD80100".to_owned())]);
        assert!(!bench.busy());
        let trace = bench.trace(0);
        let frames = trace.channels[0].frames().iter();
        let from: Vec<_> = frames.map(|frame| frame.from).collect();
        assert_eq!(from, [None, Some(1)]);
    }

    #[test]
    fn drives_do_not_hear_each_other() {
        let mut setup = Setup::of(2);
        setup.drives[1].identifiers = (0x210, 0x190);
        let mut bench = Bench::new(&setup);
        assert_eq!(frames(&ask(&mut bench, "210#3D3100")), ["190#31000000"]);
        assert_eq!(frames(&ask(&mut bench, "201#310010")), Vec::<&str>::new());
        let commands = [1, 2].map(|node| Some(bench.drive(node)?.register(0x31)));
        assert_eq!(commands, [Some(0x1000), Some(0)]);
    }

    /// Inputs at a time, and what the drive sends for them in its next scan (ex 10-1).
    #[test]
    fn an_input_at_a_time() {
        let mut bench = Bench::new(&Setup::of(1));
        ask(&mut bench, "201#520C00");
        ask(&mut bench, "201#511000");
        let limit = Stimulus::Input("limit1", true);
        let fault = PlacedFault::Stimulus(1, AnyStimulus::Unitek(limit));
        bench.inject(0, fault, Moment::At(at(30_500)));
        assert_eq!(bench.unused_faults().len(), 1);
        let came = wait(&mut bench, 20);
        assert_eq!(frames(&came), ["181#400501000000"]);
        assert!(at(31_000) < came[0].0 && came[0].0 < at(31_300));
    }

    #[test]
    fn a_drive_without_power_is_silent() {
        let mut bench = Bench::new(&Setup::of(1));
        bench.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
        assert_eq!(
            frames(&ask(&mut bench, "201#3D1B00"))[0],
            format!(
                "{:?}",
                Some(can::CanEvent::Error(can::CanError::NoAcknowledge))
            )
        );
        // Repeated again and again: nothing more will come of it.
        assert!(!bench.busy());
        bench.inject(0, PlacedFault::Drive(1, DriveFault::On), Moment::Now);
        assert_eq!(frames(&wait(&mut bench, 10)).last(), Some(&"181#1BD80100"));
    }

    #[test]
    fn faults_of_frames() {
        let mut bench = Bench::new(&Setup::of(1));
        bench.begin();
        bench.inject(0, PlacedFault::Frame(FrameFault::Lost), Moment::Byte(1));
        assert_eq!(frames(&ask(&mut bench, "201#3D1B00")), Vec::<&str>::new());
        bench.inject(0, PlacedFault::Frame(FrameFault::Lost), Moment::Now);
        assert_eq!(frames(&ask(&mut bench, "201#3D1B00")), Vec::<&str>::new());
        assert_eq!(frames(&ask(&mut bench, "201#3D1B00")), ["181#1BD80100"]);
        bench.inject(
            0,
            PlacedFault::Drive(1, DriveFault::On),
            Moment::At(at(90_000)),
        );
        assert_eq!(bench.unused_faults(), ["drive 1 at 90.000 ms: on"]);
    }
}
