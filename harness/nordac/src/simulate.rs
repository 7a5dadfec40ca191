//! Simulated NORDAC inverters on one PROFIBUS segment, in virtual time.

use harness_bench::link::bench_clock::BenchClock;
use harness_bench::link::{AnyStimulus, Capability, DriveFault, Line, Link, Moment, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::{Parameter, PpoType, Properties};
use harness_proto::profibus::BusRate;
use harness_proto::time::Instant;
use harness_sim::nordac::deviation::{Deviant, Deviation, MasterDeviation, MasterLine};
use harness_sim::nordac::{self, Drive, History, Member, Stimulus};
use harness_sim::octet_segment::{
    LineFault, LineFaultAt, LineHost, LineStation, OctetSegment, Wish,
};
use harness_sim::record::{Channel, Trace};
use std::any::Any;

/// The bench's own place on its segment.
pub(super) const BENCH: usize = 0;

/// The fault that a cause without a number leads to: overcurrent (5.7).
pub(super) const ANY_FAULT: u8 = 3;

/// PNU of the bus address, and of the PPO type (5.5).
const ADDRESS: u16 = 1624;
const PPO: u16 = 1622;

/// A slave as it is switched on.
#[derive(Clone, Debug)]
pub(crate) struct SlaveSetup {
    /// Its address at first, 1 to 126: by it scenarios and records name the slave, whatever address it is given later.
    pub(crate) address: u8,
    /// The PPO type that it is set to.
    pub(crate) ppo: PpoType,
    pub(crate) posicon: bool,
    pub(crate) properties: Properties,
    /// Parameters that differ from the factory settings, and their values.
    pub(crate) parameters: Vec<(&'static Parameter, Index, i64)>,
    /// The way in which it breaks the bus standard or the manual, if it does.
    pub(crate) deviation: Option<&'static Deviation>,
    /// What it keeps of the time before; nothing where it was just switched on and never had a fault.
    pub(crate) history: History,
}

impl SlaveSetup {
    /// A slave with factory settings but for its address.
    #[must_use]
    pub(crate) fn new(address: u8) -> Self {
        Self {
            address,
            ppo: PpoType::One,
            posicon: false,
            properties: Properties::default(),
            parameters: Vec::new(),
            deviation: None,
            history: History::default(),
        }
    }

    /// The slave, switched on at `power_up`.
    #[must_use]
    pub(crate) fn drive(&self, rate: BusRate, power_up: Instant) -> Deviant {
        let none = Index::default();
        let fixed = [
            (ADDRESS, none, self.address.into()),
            (PPO, none, self.ppo.raw().into()),
        ];
        let more = self.parameters.iter();
        let more = more.map(|(parameter, index, value)| {
            (
                parameter.number,
                *index,
                i32::try_from(*value).unwrap_or(i32::MAX),
            )
        });
        let parameters = fixed.into_iter().chain(more);
        let setup = nordac::InverterSetup {
            properties: self.properties,
            posicon: self.posicon,
            parameters: parameters.collect(),
            history: self.history.clone(),
        };
        Deviant::new(Drive::new(&setup, rate, power_up), self.deviation)
    }
}

/// A segment and its slaves.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    /// The bit rate of all stations.
    pub(crate) rate: BusRate,
    pub(crate) slaves: Vec<SlaveSetup>,
    /// The way in which the bench's own master deviates, if it does.
    pub(crate) master: Option<&'static MasterDeviation>,
}

impl Setup {
    /// These slaves, behind a master that does not deviate.
    pub(crate) const fn new(rate: BusRate, slaves: Vec<SlaveSetup>) -> Self {
        Self {
            rate,
            slaves,
            master: None,
        }
    }
}

/// A station of the segment: a host, or a slave.
pub(crate) type SegmentStation = Member<Box<Deviant>>;

/// A bench on a segment of simulated slaves. Its own host has one port.
#[derive(Debug)]
pub(crate) struct Bench {
    line: OctetSegment<SegmentStation>,
    rate: BusRate,
    /// The slaves as they were set up: slave `k` has place `k + 1` on the line.
    addresses: Vec<u8>,
    clock: BenchClock,
    master: Option<&'static MasterDeviation>,
}

impl Bench {
    pub(crate) const CAPABILITIES: [Capability; 9] = [
        Capability::Interposer,
        Capability::Tap,
        Capability::Memory,
        Capability::Power,
        Capability::Motion,
        Capability::Eeprom,
        Capability::Reset,
        Capability::LineErrors,
        Capability::Simulator,
    ];

    /// A bench with the slaves of a setup, all just switched on.
    #[must_use]
    pub(crate) fn new(setup: &Setup) -> Self {
        Self::with_guests(setup, 0)
    }

    /// A bench with this number of additional hosts after the slaves.
    #[must_use]
    pub(super) fn with_guests(setup: &Setup, guests: usize) -> Self {
        let bench = Member::Host(LineHost::default());
        let guests = (0..guests).map(|_| Member::Host(LineHost::default()));
        let slaves = setup.slaves.iter();
        let slave =
            |slave: &SlaveSetup| Member::Drive(Box::new(slave.drive(setup.rate, Instant::START)));
        let stations = std::iter::once(bench).chain(slaves.map(slave));
        let stations = stations.chain(guests).collect();
        Self {
            line: OctetSegment::new(setup.rate.format(), stations),
            rate: setup.rate,
            addresses: setup.slaves.iter().map(|slave| slave.address).collect(),
            clock: BenchClock::default(),
            master: setup.master,
        }
    }

    /// The line, for what shares it.
    pub(super) const fn line(&mut self) -> &mut OctetSegment<SegmentStation> {
        &mut self.line
    }

    /// A client's host: the first client has the bench's own place, the others are after the slaves.
    pub(super) fn client(&mut self, client: usize) -> Option<&mut LineHost> {
        let place = match client {
            0 => BENCH,
            _ => self.addresses.len() + client,
        };
        self.line.station_mut(place).host_mut()
    }

    /// A fault of the next octet or telegram, if its own has passed.
    pub(super) fn not_passed(&self, placed: LineFaultAt) -> LineFaultAt {
        let so_far = match placed.fault {
            LineFault::Octet(_) => self.line.octets(),
            LineFault::Telegram(_) => self.line.telegrams(),
        };
        if placed.station.is_some() || placed.number > so_far {
            return placed;
        }
        let number = so_far + 1;
        LineFaultAt { number, ..placed }
    }

    /// When something happens next.
    pub(super) fn next_event(&self) -> Option<Instant> {
        let fault = self.clock.next_fault();
        self.line.next_due().into_iter().chain(fault).min()
    }

    /// The time of the segment.
    pub(super) const fn time(&self) -> Instant {
        self.clock.now
    }

    /// A parameter of a slave beside its bus; `None` if the slave does not have it.
    #[must_use]
    pub(crate) fn parameter(
        &self,
        slave: u8,
        parameter: Option<&'static Parameter>,
        index: Index,
    ) -> Option<i64> {
        self.drive(slave)?.inverter().parameter(parameter?, index)
    }

    /// A slave, beside its bus.
    #[must_use]
    pub(crate) fn drive(&self, slave: u8) -> Option<&Drive> {
        let station = self.line.station(self.place(slave)?);
        station.drive().map(|drive| drive.drive())
    }

    fn drive_mut(&mut self, slave: u8) -> Option<&mut Drive> {
        let place = self.place(slave)?;
        let station = self.line.station_mut(place);
        station.drive_mut().map(|drive| drive.drive_mut())
    }

    fn place(&self, slave: u8) -> Option<usize> {
        let mut addresses = self.addresses.iter();
        let place = addresses.position(|address| *address == slave)?;
        Some(place + 1)
    }

    fn host(&mut self) -> Option<&mut LineHost> {
        self.line.station_mut(BENCH).host_mut()
    }

    /// When the oldest octet that is not fetched yet had ended.
    fn heard_at(&self) -> Option<Instant> {
        self.line.station(BENCH).host().and_then(LineHost::heard_at)
    }

    pub(super) fn run_to(&mut self, at: Instant) {
        self.line.run_to(at);
        self.clock.now = self.clock.now.max(at);
        while let Some(fault) = self.clock.due() {
            self.suffer(fault);
        }
    }

    fn suffer(&mut self, fault: PlacedFault) {
        let now = self.clock.now;
        match fault {
            PlacedFault::Drive(slave, fault) => {
                if let Some(drive) = self.drive_mut(slave) {
                    match fault {
                        DriveFault::Off => drive.set_power(now, false),
                        DriveFault::On => drive.set_power(now, true),
                        // Of a ring's transmitter.
                        DriveFault::Stuck(_) | DriveFault::Unstuck => {}
                    }
                }
            }
            PlacedFault::Stimulus(_, AnyStimulus::Line(placed)) => {
                self.line.inject(placed);
            }
            PlacedFault::Stimulus(slave, AnyStimulus::Nordac(stimulus)) => {
                if let Some(drive) = self.drive_mut(slave) {
                    match stimulus {
                        Stimulus::Link(found) => drive.set_link(now, !found),
                        Stimulus::Fault(number, on) => {
                            drive.inverter_mut().set_cause(now, on.then_some(number));
                        }
                    }
                }
            }
            // Of another bus.
            PlacedFault::Frame(_) | PlacedFault::Link(..) | PlacedFault::Stimulus(..) => {}
        }
    }
}

impl Line for Bench {
    fn medium(&self, _port: usize) -> Medium {
        Medium::Octets(self.line.format())
    }

    fn now(&self) -> Instant {
        self.clock.since_origin(self.clock.now)
    }

    /// Sends one telegram: idle time in front of it (T_SYN), and no gap in it.
    fn send(&mut self, _port: usize, what: Out<'_>) -> Instant {
        let MasterLine { idle_bits, octets } = match self.master {
            Some(deviation) => deviation.sends(what.octets()),
            None => MasterLine::of(what.octets()),
        };
        if octets.is_empty() {
            return self.clock.since_origin(self.clock.left.max(self.clock.now));
        }
        let idle = self.rate.bit_time() * idle_bits;
        let free = self.clock.left.max(self.line.busy_until()) + idle;
        let time = self.line.format().octet_time() * octets.len() as u64;
        self.clock.left = free.max(self.clock.now) + time;
        let wish = Wish {
            ready: self.clock.now,
            idle_bits,
        };
        if let Some(host) = self.host() {
            host.send(wish, octets);
        }
        self.clock.since_origin(self.clock.left)
    }

    fn receive(&mut self, _port: usize) -> Option<(Instant, HeardPiece)> {
        let now = self.clock.now;
        self.heard_at().filter(|at| *at <= now)?;
        let (at, octet) = self.host()?.receive()?;
        Some((self.clock.since_origin(at), HeardPiece::Octet(octet)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let until = self.clock.on_bench(until);
        let unread = self.heard_at().is_some();
        let busy = self.busy();
        loop {
            let fault = self.clock.next_fault();
            let event = self.line.next_due();
            let Some(next) = [fault, event].into_iter().flatten().min() else {
                if until != Instant::NEVER {
                    self.run_to(until);
                }
                return false;
            };
            if next >= until {
                self.run_to(until);
                return true;
            }
            self.run_to(next.max(self.clock.now));
            let heard = !unread && self.heard_at().is_some();
            if heard || fault == Some(next) || busy != self.busy() {
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
        self.line.begin();
        if let Some(host) = self.host() {
            host.forget();
        }
    }

    fn busy(&self) -> bool {
        let places = 0..self.line.stations();
        self.line.is_busy()
            || places
                .into_iter()
                .any(|place| self.line.station(place).wants().is_some())
    }

    fn inject(&mut self, _port: usize, fault: PlacedFault, moment: Moment) {
        match moment {
            Moment::Now | Moment::Byte(_) => self.suffer(fault),
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
        let placed = self.line.unused_faults().iter();
        let placed = placed.map(|fault| self.words(fault));
        let scheduled = self.clock.left_over();
        let scheduled = scheduled.map(|(at, fault)| format!("{fault} at {at}"));
        placed.chain(scheduled).collect()
    }

    fn record(&mut self, on: bool) {
        match on {
            true => self.line.record_anew(),
            false => self.line.keep_no_record(),
        }
    }

    fn carried(&self) -> u64 {
        self.line.octets()
    }

    fn drives(&self, _port: usize) -> u8 {
        u8::try_from(self.addresses.len()).unwrap_or(u8::MAX)
    }

    fn trace(&self, port: usize) -> Trace {
        let senders = std::iter::once(None).chain(self.addresses.iter().copied().map(Some));
        let channel = |(place, from): (usize, Option<u8>)| {
            Channel::of_octets(from, None, self.line.record(place).to_vec())
        };
        let mut trace = Trace {
            channels: senders.enumerate().map(channel).collect(),
            ..Trace::empty(self.drives(port))
        };
        trace.count_from(self.clock.origin().since_start());
        trace
    }
}

impl Bench {
    /// A fault on the line, as a scenario writes it.
    fn words(&self, placed: &LineFaultAt) -> String {
        let sender = match placed.station {
            None => String::new(),
            Some(BENCH) => "master ".to_owned(),
            Some(place) => {
                let slave = self.addresses.get(place - 1);
                slave.map_or(String::new(), |slave| format!("slave {slave} "))
            }
        };
        let number = placed.number;
        match placed.fault {
            LineFault::Octet(fault) => format!("{sender}byte {number}: {fault}"),
            LineFault::Telegram(fault) => format!("{sender}telegram {number}: {fault}"),
        }
    }
}
