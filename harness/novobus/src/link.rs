//! A link to simulated rings, in virtual time.

use harness_bench::link::{
    AnyStimulus, Capability, Line, Link, Moment, Octets, PlacedFault, link_name,
};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::line::{Rate, Received};
use harness_proto::nd21::bits::{flags2, selftest};
use harness_proto::nd21::{ee, ram};
use harness_proto::novobus::error::BusError;
use harness_proto::time::{Instant, Span};
use harness_sim::nd21::{Mode, OutputLevels, Stimulus, set_parity};
use harness_sim::novobus::bench::Bench;
use harness_sim::novobus::device::Device;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::ring::Ring;
use harness_sim::novobus::witness::Complaint;
use harness_sim::record::Trace;
use harness_sim::record::{LineByte, Remark};
use std::any::Any;
use std::collections::VecDeque;

/// One or two simulated rings.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedLink {
    bench: Bench,
    rate: Rate,
    /// When the conversation began, on the bench's clock.
    origin: Instant,
    /// Faults that wait for their time, in order of it.
    scheduled: VecDeque<(Instant, usize, PlacedFault)>,
}

/// What a drive without power shows.
const DARK: OutputLevels = OutputLevels {
    gpo1: false,
    gpo2: false,
    ready: false,
    analogue: 0,
    encoder: 0,
    display: None,
    mode: Mode::Reset,
};

impl SimulatedLink {
    /// What a simulated link can do: everything.
    pub(crate) const CAPABILITIES: [Capability; 10] = [
        Capability::Interposer,
        Capability::Tap,
        Capability::Memory,
        Capability::Power,
        Capability::Motion,
        Capability::Eeprom,
        Capability::Reset,
        Capability::LineErrors,
        Capability::TwoRings,
        Capability::Simulator,
    ];

    /// A link to the rings of a bench.
    #[must_use]
    pub(crate) fn new(bench: Bench) -> Self {
        let rate = bench.rings().first().map_or(Rate::default(), Ring::rate);
        Self {
            bench,
            rate,
            origin: Instant::START,
            scheduled: VecDeque::new(),
        }
    }

    /// Keeps no record of what the links carry from now on: for a driver, which may be at work for hours.
    /// Received bytes are received all the same, there is no trace of them.
    pub(crate) fn stop_recording(&mut self) {
        self.record(false);
    }

    /// Makes room for this number of bytes on every link of a ring.
    pub(crate) fn reserve(&mut self, ring: usize, bytes: usize) {
        if let Some(ring) = self.bench.ring_mut(ring) {
            ring.reserve(bytes);
        }
    }

    /// Adds a [witness](harness_sim::novobus::witness) to every drive, before anything is sent. Returns false if a drive is not a whole ND21
    /// and has no witness.
    #[must_use]
    pub(crate) fn witness(&mut self) -> bool {
        let byte_time = self.rate.byte_time();
        let mut all = true;
        self.each_drive(|drive| all &= drive.witness(byte_time));
        all
    }

    /// The first thing that the witnesses of a ring saw: the drive, and what it was. Nothing more comes.
    pub(crate) fn complaint(&mut self, ring: usize) -> Option<(u8, Complaint)> {
        let now = self.bench.now();
        let ring = self.bench.ring_mut(ring)?;
        let drives = 0..ring.size().drives();
        let mut found: Option<(u8, Complaint)> = None;
        for drive in drives.rev() {
            let powered = ring.powered(drive);
            let Some(witness) = ring.drive_mut(drive).and_then(Drive::its_witness) else {
                continue;
            };
            // Without power it does nothing more.
            if powered {
                witness.end(now);
            }
            let complaint = witness.complaint();
            let first =
                |new: &&Complaint| found.as_ref().is_none_or(|(_, other)| new.at < other.at);
            if let Some(complaint) = complaint.filter(first) {
                found = Some((drive, complaint.clone()));
            }
        }
        found
    }

    fn each_drive(&mut self, mut work: impl FnMut(&mut Drive)) {
        for ring in 0..self.bench.rings().len() {
            let drives = 0..self.drives(ring);
            for drive in drives {
                let drive = self
                    .bench
                    .ring_mut(ring)
                    .and_then(|ring| ring.drive_mut(drive));
                drive.into_iter().for_each(&mut work);
            }
        }
    }

    /// A drive, past its bus.
    #[must_use]
    pub(crate) fn drive(&self, ring: usize, drive: u8) -> Option<&Drive> {
        self.ring(ring)?.drive(drive)
    }

    /// Lets a drive monitor time-outs from now on (ND21 14.10.2), and after each reset (14.3.6).
    pub(crate) fn monitor(&mut self, ring: usize, drive: u8) {
        let ring = self.bench.ring_mut(ring);
        if let Some(drive) = ring.and_then(|ring| ring.drive_mut(drive)) {
            let cells = drive.cells_mut();
            let flags = cells.peek(ram::FLAGS2) | flags2::MONITORING;
            let _set = cells.poke(ram::FLAGS2, flags);
            let contents = cells.eeprom_mut();
            contents[usize::from(ee::SELFTEST)] |= selftest::MONITORING;
            set_parity(contents);
        }
    }

    /// The shortest silence after which one of its drives detects a time-out, if it monitors the line (ND21 9.9).
    pub(crate) fn earliest_time_out(&self) -> Span {
        let rings = 0..self.bench.rings().len();
        let drives = rings.flat_map(|ring| (0..self.drives(ring)).map(move |drive| (ring, drive)));
        let drives = drives.filter_map(|(ring, drive)| self.drive(ring, drive));
        let time_outs = drives.map(|drive| drive.bus_end().properties().time_out);
        time_outs.min().unwrap_or(Span::MAX)
    }

    /// Listens on a link from now on, counted from the master's outgoing one: [`Self::fetch`] gives what arrives there.
    pub(crate) fn tap(&mut self, ring: usize, link: usize) {
        if let Some(ring) = self.bench.ring_mut(ring) {
            ring.record_link(link);
        }
    }

    /// Cuts a link open: bytes of the drive in front must be fetched, and the drive behind receives the bytes that are fed.
    pub(crate) fn open(&mut self, ring: usize, link: usize) {
        if let Some(ring) = self.bench.ring_mut(ring) {
            ring.open_link(link);
        }
    }

    /// What has arrived at a tap, or at an open link's near side, since the last call.
    pub(crate) fn fetch(&mut self, ring: usize, link: usize) -> Vec<Received> {
        let Some(ring) = self.bench.ring_mut(ring) else {
            return Vec::new();
        };
        let heard = ring.take_record(link);
        let mut heard: Vec<_> = heard.iter().filter_map(LineByte::arrival).collect();
        while let Some(byte) = ring.fetch_link(link) {
            heard.extend(byte.arrival());
        }
        heard
    }

    /// What a [tapped](Self::tap) link has carried since the last call, with times of the conversation.
    pub(crate) fn take_record(&mut self, ring: usize, link: usize) -> Vec<LineByte> {
        let ring = self.bench.ring_mut(ring);
        let mut record = ring.map_or_else(Vec::new, |ring| ring.take_record(link));
        for byte in &mut record {
            byte.at = self.since_origin(byte.at);
        }
        record
    }

    /// Records what the drives of all rings remark from now on.
    pub(crate) fn record_remarks(&mut self) {
        for ring in 0..self.bench.rings().len() {
            if let Some(ring) = self.bench.ring_mut(ring) {
                ring.record_remarks();
            }
        }
    }

    /// What the drives of a ring have remarked since the last call, with times of the conversation.
    pub(crate) fn take_remarks(&mut self, ring: usize) -> Vec<Remark> {
        let ring = self.bench.ring_mut(ring);
        let mut remarks = ring.map_or_else(Vec::new, Ring::take_remarks);
        for remark in &mut remarks {
            remark.at = self.since_origin(remark.at);
        }
        remarks
    }

    /// Feeds a byte to the drive behind an open link and returns when the line will have carried it.
    pub(crate) fn feed(&mut self, ring: usize, link: usize, byte: Received) -> Instant {
        let now = self.bench.now();
        let ring = self.bench.ring_mut(ring);
        let at = ring.map_or(now, |ring| ring.feed_link(link, byte));
        self.since_origin(at)
    }

    /// When the next byte of an open link can be fetched.
    #[must_use]
    pub(crate) fn next_fetch(&self, ring: usize, link: usize) -> Option<Instant> {
        let next = self.ring(ring)?.next_fetch(link)?;
        Some(self.since_origin(next))
    }

    /// When the byte on the last link of a ring reaches the master; one that is not yet there needs a byte time at least.
    #[must_use]
    pub(crate) fn next_home(&self, ring: usize) -> Option<Instant> {
        let next = self.ring(ring)?.next_home()?;
        Some(self.since_origin(next))
    }

    /// The next byte that the master has received from a ring, its time, and whether it goes back to a byte that the master sent. A byte
    /// that a drive sent unasked after a time-out (ND21 9.9) does not.
    pub(crate) fn receive_with_cause(&mut self, ring: usize) -> Option<(Instant, Received, bool)> {
        let ring = self.bench.ring_mut(ring)?;
        loop {
            let byte = ring.receive()?;
            if let Some(received) = byte.arrival() {
                return Some((self.since_origin(byte.at), received, byte.solicited));
            }
        }
    }

    /// A time on the bench's clock as one of the conversation.
    fn since_origin(&self, at: Instant) -> Instant {
        Instant::START + at.since(self.origin)
    }

    /// A time of the conversation on the bench's clock.
    fn on_bench(&self, at: Instant) -> Instant {
        self.origin + at.since_start()
    }

    /// When something happens next on a ring or by a fault that waits for its time; `None` where nothing ever
    /// will unless the master sends. What drives do behind their bus is not counted: they turn all the time.
    #[must_use]
    pub(crate) fn next_event(&self) -> Option<Instant> {
        self.next_on_bench().map(|at| self.since_origin(at))
    }

    /// Lets everything happen up to and including `until`: the same as many waits, at less cost.
    pub(crate) fn run_until(&mut self, until: Instant) {
        let until = self.on_bench(until);
        while self.bench.now() < until {
            let fault = self.scheduled.front().map(|(at, ..)| *at);
            self.bench.run_until(fault.unwrap_or(until).min(until));
            self.suffer_what_is_due();
        }
    }

    fn next_on_bench(&self) -> Option<Instant> {
        let fault = self.scheduled.front().map(|(at, ..)| *at);
        self.bench.next_event().into_iter().chain(fault).min()
    }

    fn suffer_what_is_due(&mut self) {
        while let Some(&(at, ring, fault)) = self.scheduled.front()
            && at <= self.bench.now()
        {
            self.scheduled.pop_front();
            self.suffer(ring, fault);
        }
    }

    pub(crate) fn ring(&self, ring: usize) -> Option<&Ring<Drive>> {
        self.bench.rings().get(ring)
    }

    /// Where a fault happens, as a scenario writes it: `98->97`, `drive 2:3`.
    fn place(&self, ring: usize, fault: PlacedFault) -> String {
        match fault {
            PlacedFault::Link(link, _) => link_name(ring, self.drives(ring), link),
            PlacedFault::Frame(_) => "frame".to_owned(),
            PlacedFault::Drive(drive, _) | PlacedFault::Stimulus(drive, _) => {
                let prefix = if ring == 0 { "" } else { "2:" };
                format!("drive {prefix}{drive}")
            }
        }
    }

    fn suffer(&mut self, ring: usize, fault: PlacedFault) {
        let Some(ring) = self.bench.ring_mut(ring) else {
            return;
        };
        match fault {
            PlacedFault::Link(link, fault) => ring.suffer_link(link, fault),
            PlacedFault::Drive(drive, fault) => ring.suffer_drive(drive, fault),
            PlacedFault::Stimulus(drive, AnyStimulus::Novobus(stimulus)) => {
                if let Some(drive) = ring.drive_mut(drive) {
                    // Planning has refused drives without an outside.
                    let _happened = drive.stimulate(stimulus);
                }
            }
            // Of another bus.
            PlacedFault::Frame(_) | PlacedFault::Stimulus(..) => {}
        }
    }
}

impl Line for SimulatedLink {
    fn medium(&self, _port: usize) -> Medium {
        self.rate.into()
    }

    fn now(&self) -> Instant {
        self.since_origin(self.bench.now())
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        let now = self.bench.now();
        let sent_by = self.bench.ring_mut(ring).map_or(now, |ring| {
            ring.send(now, what.octets());
            ring.sent_by()
        });
        self.since_origin(sent_by)
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        let (at, received, _) = self.receive_with_cause(ring)?;
        Some((at, HeardPiece::Octet(received)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let next = self.next_on_bench();
        let until = self.on_bench(until);
        self.bench.run_until(next.unwrap_or(until).min(until));
        self.suffer_what_is_due();
        next.is_some()
    }
}

impl Link for SimulatedLink {
    fn capabilities(&self) -> &[Capability] {
        &Self::CAPABILITIES
    }

    fn listens(&self, _: usize, _: usize) -> bool {
        true
    }

    fn begin(&mut self) {
        self.origin = self.bench.now();
        self.scheduled.clear();
        for ring in 0..self.bench.rings().len() {
            if let Some(ring) = self.bench.ring_mut(ring) {
                ring.begin();
            }
        }
    }

    fn busy(&self) -> bool {
        self.bench.busy()
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        match moment {
            Moment::Now => match fault {
                // On the master's own link the next byte is the next one that is sent: a link over a port hands bytes over ahead of the
                // line, and both must damage the same one.
                PlacedFault::Link(0, fault) if fault.takes_a_byte() => {
                    if let Some(ring) = self.bench.ring_mut(ring) {
                        ring.arm_behind_queued(fault);
                    }
                }
                fault => self.suffer(ring, fault),
            },
            Moment::At(at) if self.on_bench(at) <= self.bench.now() => self.suffer(ring, fault),
            Moment::At(at) => {
                let at = self.on_bench(at);
                let place = self.scheduled.partition_point(|(other, ..)| *other <= at);
                self.scheduled.insert(place, (at, ring, fault));
            }
            Moment::Byte(byte) => {
                let Some(ring) = self.bench.ring_mut(ring) else {
                    return;
                };
                match fault {
                    PlacedFault::Link(link, fault) => ring.arm_link(link, byte, fault),
                    PlacedFault::Drive(drive, fault) => ring.arm_drive(drive, byte, fault),
                    // It has no byte; planning has refused one.
                    PlacedFault::Stimulus(..) | PlacedFault::Frame(_) => {}
                }
            }
        }
    }

    fn probe(&mut self, ring: usize, octets: &[u8]) -> Vec<Received> {
        let mut copy = self.clone();
        while copy.receive_octet(ring).is_some() {}
        copy.send_octets(ring, octets);
        let mut came = Vec::new();
        // Once round the ring and the bytes themselves, and as much again for what is delayed.
        let drives = u64::from(self.drives(ring));
        let end = copy.now() + self.rate.byte_time() * (2 * (drives + octets.len() as u64));
        while copy.busy() && copy.now() < end && copy.wait(end) {
            while let Some((_, octet)) = copy.receive_octet(ring) {
                came.push(octet);
            }
        }
        came
    }

    fn beside(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn unused_faults(&self) -> Vec<String> {
        let mut unused = Vec::new();
        for (index, ring) in self.bench.rings().iter().enumerate() {
            for (link, byte, fault) in ring.unused_link_faults() {
                let place = self.place(index, PlacedFault::Link(link, fault));
                unused.push(format!("{place} byte {byte}: {fault}"));
            }
            for (drive, byte, fault) in ring.unused_drive_faults() {
                let place = self.place(index, PlacedFault::Drive(drive, fault));
                unused.push(format!("{place} byte {byte}: {fault}"));
            }
        }
        for (at, ring, fault) in &self.scheduled {
            let place = self.place(*ring, *fault);
            let at = self.since_origin(*at);
            unused.push(match fault {
                PlacedFault::Link(_, fault) => format!("{place} at {at}: {fault}"),
                PlacedFault::Drive(_, fault) => format!("{place} at {at}: {fault}"),
                PlacedFault::Frame(fault) => format!("{place} at {at}: {fault}"),
                PlacedFault::Stimulus(_, AnyStimulus::Novobus(Stimulus::Error(error))) => {
                    format!("{place} at {at}: error {error}")
                }
                PlacedFault::Stimulus(_, stimulus) => format!("{place} at {at}: {stimulus}"),
            });
        }
        unused
    }

    fn record(&mut self, on: bool) {
        for ring in 0..self.bench.rings().len() {
            match self.bench.ring_mut(ring) {
                Some(ring) if on => ring.record_anew(),
                Some(ring) => ring.stop_recording(),
                None => {}
            }
        }
    }

    fn carried(&self) -> u64 {
        self.bench.rings().iter().map(Ring::carried).sum()
    }

    fn drives(&self, ring: usize) -> u8 {
        self.ring(ring).map_or(0, |ring| ring.size().drives())
    }

    fn trace(&self, ring: usize) -> Trace {
        let trace = self.ring(ring).map(Ring::trace);
        let mut trace = trace.unwrap_or_default();
        trace.count_from(self.origin.since_start());
        trace
    }
}

/// What only a simulated ring shows: its drives beside the bus.
pub(crate) trait BesideTheBus {
    /// Whether a drive is in the error mode, and why; `None` where this cannot be seen.
    fn error_of(&self, ring: usize, drive: u8) -> Option<Option<BusError>>;

    /// What a drive shows outside the bus; `None` where this cannot be seen.
    fn shown(&self, ring: usize, drive: u8) -> Option<OutputLevels>;

    /// A drive's cell; `None` where this cannot be seen.
    fn peek(&self, ring: usize, drive: u8, address: u16) -> Option<u8>;

    /// How many bytes have come to the end of a link since the conversation began, counted from the master's outgoing one; `None` where
    /// this cannot be seen.
    fn arrived(&self, ring: usize, link: usize) -> Option<u64>;

    /// See [`Ring::delivered`]; `None` where this cannot be seen.
    fn delivered(&self, ring: usize, link: usize) -> Option<u64>;
}

impl<L: Link + ?Sized> BesideTheBus for L {
    fn error_of(&self, ring: usize, drive: u8) -> Option<Option<BusError>> {
        let device = simulation(self)?.ring(ring)?.drive(drive)?;
        Some(device.cause().filter(|_| device.in_error()))
    }

    fn shown(&self, ring: usize, drive: u8) -> Option<OutputLevels> {
        let ring = simulation(self)?.ring(ring)?;
        let shown = ring.drive(drive)?.shown()?;
        Some(if ring.powered(drive) {
            shown
        } else {
            OutputLevels {
                encoder: shown.encoder,
                ..DARK
            }
        })
    }

    fn peek(&self, ring: usize, drive: u8, address: u16) -> Option<u8> {
        Some(simulation(self)?.ring(ring)?.drive(drive)?.peek(address))
    }

    fn arrived(&self, ring: usize, link: usize) -> Option<u64> {
        Some(simulation(self)?.ring(ring)?.arrived(link))
    }

    fn delivered(&self, ring: usize, link: usize) -> Option<u64> {
        Some(simulation(self)?.ring(ring)?.delivered(link))
    }
}

/// The simulated rings behind a link, if it shows them.
fn simulation(link: &(impl Link + ?Sized)) -> Option<&SimulatedLink> {
    link.beside()?.downcast_ref()
}
