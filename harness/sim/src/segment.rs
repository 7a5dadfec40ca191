//! A CAN segment: stations on one pair of wires, with arbitration by identifier and exact frame times.
//!
//! All stations that want to send when the bus is free begin together, and the frame with the lowest arbitration field goes on. A frame
//! that no other station acknowledges, or that is damaged, ends with an error frame and is repeated. Error counters follow ISO
//! 11898-1 as far as they decide who sends: 8 more for an error, 1 less for a success, passive from 128 on, bus-off at 256.
//!
//! A segment on which no station has anything to do costs nothing.

use crate::participant::Participant;
use crate::record::{FrameEnd, LineFrame};
use harness_proto::can::{BitRate, CanError, CanEvent, ERROR_FRAME_BITS, Frame};
use harness_proto::time::{Instant, Span};
use std::collections::VecDeque;
use std::fmt;

/// Bits that a passive station waits behind its own frame.
const SUSPEND_BITS: u32 = 8;
/// Bits of the intermission: receivers have the frame before them.
const INTERMISSION_BITS: u32 = 3;
/// Error counts from which a station is passive, and from which it is bus-off.
const PASSIVE: u16 = 128;
const BUS_OFF: u16 = 256;

/// What takes part in a segment.
pub trait Station {
    /// A frame of another station has ended at `at`.
    fn hear(&mut self, at: Instant, frame: &Frame);
    /// The next frame that it wants to send, and from when on.
    fn wants(&self) -> Option<(Instant, Frame)>;
    /// The frame that it wants to send was sent, and ended at `at`.
    fn sent(&mut self, at: Instant);
    /// Something went wrong on the bus at `at`.
    fn notice(&mut self, at: Instant, error: CanError) {
        let _ = (at, error);
    }
    /// When it does something by itself; `None` while it only waits for frames.
    fn next_action(&self) -> Option<Instant>;
    /// Does everything that is due up to and including `to`.
    fn advance(&mut self, to: Instant);
    /// Whether it acknowledges what it hears; a listener and a station without power do not.
    fn acknowledges(&self) -> bool {
        true
    }
}

impl<S: Station + ?Sized> Station for Box<S> {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        (**self).hear(at, frame);
    }
    fn wants(&self) -> Option<(Instant, Frame)> {
        (**self).wants()
    }
    fn sent(&mut self, at: Instant) {
        (**self).sent(at);
    }
    fn notice(&mut self, at: Instant, error: CanError) {
        (**self).notice(at, error);
    }
    fn next_action(&self) -> Option<Instant> {
        (**self).next_action()
    }
    fn advance(&mut self, to: Instant) {
        (**self).advance(to);
    }
    fn acknowledges(&self) -> bool {
        (**self).acknowledges()
    }
}

/// What happens to a frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameFault {
    /// No station receives it, and its sender does not notice: every receiver has overrun.
    Lost,
    /// Its sender finds an error in the last bit, where receivers have already taken it, and repeats it.
    Doubled,
    /// Its sender holds it back for this long. Other frames may go first.
    Late(Span),
    /// It is damaged: an error frame, and its sender repeats it.
    Corrupt,
    /// No station acknowledges it: an error frame, and its sender repeats it.
    NoAcknowledge,
    /// It is damaged, and its sender goes to bus-off.
    BusOff,
}

impl fmt::Display for FrameFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lost => f.write_str("lost"),
            Self::Doubled => f.write_str("doubled"),
            Self::Late(span) => write!(f, "delay {span}"),
            Self::Corrupt => f.write_str("corrupt"),
            Self::NoAcknowledge => f.write_str("no-acknowledge"),
            Self::BusOff => f.write_str("bus-off"),
        }
    }
}

/// A fault and the frame that it happens to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placed {
    /// The sender whose frames are counted; `None` where the frames of all stations are.
    pub station: Option<usize>,
    /// Which frame, counted from 1 in the order in which they first win the bus; a repetition is no frame of its own.
    pub frame: u64,
    /// The fault.
    pub fault: FrameFault,
}

/// What the segment keeps of a station.
#[derive(Clone, Copy, Debug, Default)]
struct SegmentMember {
    /// Transmit error counter.
    errors: u16,
    off: bool,
    /// Frames sent, the present one included.
    frames: u64,
    /// The number on the segment of the frame under way, once it was counted.
    counted: Option<u64>,
    /// Not before.
    held_until: Instant,
}

impl SegmentMember {
    fn failed(&mut self, error: CanError) {
        // A passive station alone on a bus does not count on, so that it never goes to bus-off (ISO 11898-1).
        if error == CanError::NoAcknowledge && self.errors >= PASSIVE {
            return;
        }
        self.errors += 8;
        self.off |= self.errors >= BUS_OFF;
    }
}

/// The segment.
#[derive(Debug)]
pub struct Segment<S> {
    rate: BitRate,
    stations: Vec<S>,
    members: Vec<SegmentMember>,
    faults: Vec<Placed>,
    /// Frames of all stations so far.
    frames: u64,
    /// From when on the next frame may begin.
    free_at: Instant,
    now: Instant,
    busy_bits: u64,
    /// The senders of the frame on the wire; kept for its allocation.
    senders: Vec<usize>,
    record: Option<Vec<LineFrame>>,
}

impl<S: Station> Segment<S> {
    /// A segment with these stations. It keeps a record until [`Segment::keep_no_record`].
    #[must_use]
    pub fn new(rate: BitRate, stations: Vec<S>) -> Self {
        Self {
            rate,
            members: vec![SegmentMember::default(); stations.len()],
            stations,
            faults: Vec::new(),
            frames: 0,
            free_at: Instant::START,
            now: Instant::START,
            busy_bits: 0,
            senders: Vec::new(),
            record: Some(Vec::new()),
        }
    }

    /// Keeps no record from now on, for long runs.
    pub fn keep_no_record(&mut self) {
        self.record = None;
    }

    /// Keeps a record again, of what happens from now on.
    pub fn record_anew(&mut self) {
        self.record = Some(Vec::new());
    }

    /// The frames on the wire so far, in order of time. Their senders are the places of stations, from 0 on; of several that sent the
    /// same frame the first.
    #[must_use]
    pub fn record(&self) -> &[LineFrame] {
        self.record.as_deref().unwrap_or_default()
    }

    /// Takes the record out; it goes on empty.
    pub fn take_record(&mut self) -> Vec<LineFrame> {
        self.record.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// The time up to which the segment has run.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// The rate.
    #[must_use]
    pub const fn rate(&self) -> BitRate {
        self.rate
    }

    /// Bits that frames and error frames have taken.
    #[must_use]
    pub const fn busy_bits(&self) -> u64 {
        self.busy_bits
    }

    /// A station.
    #[must_use]
    pub fn station(&self, place: usize) -> &S {
        &self.stations[place]
    }

    /// A station, to be given work or changed.
    pub fn station_mut(&mut self, place: usize) -> &mut S {
        &mut self.stations[place]
    }

    /// Plans a fault.
    pub fn inject(&mut self, placed: Placed) {
        self.faults.push(placed);
    }

    /// Planned faults whose frame was not sent.
    #[must_use]
    pub fn unused_faults(&self) -> &[Placed] {
        &self.faults
    }

    /// How many frames have won the bus so far; a repetition is no frame of its own.
    #[must_use]
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// Whether a station takes no part any more.
    #[must_use]
    pub fn is_off(&self, place: usize) -> bool {
        self.members[place].off
    }

    /// The controller of a station goes to bus-off: it neither hears nor sends until [`Segment::restart`].
    pub fn switch_off(&mut self, place: usize) {
        self.members[place].off = true;
        self.stations[place].notice(self.now, CanError::BusOff);
    }

    /// Restarts the controller of a station after bus-off.
    pub fn restart(&mut self, place: usize) {
        let member = &mut self.members[place];
        member.errors = 0;
        member.off = false;
        member.held_until = member.held_until.max(self.now);
    }

    /// Whether a station repeats a frame that no other station acknowledges.
    #[must_use]
    pub fn is_unheard(&self, place: usize) -> bool {
        self.members[place].errors >= PASSIVE
    }

    /// From when on the bus is free, as far as is known: the end of the last frame.
    #[must_use]
    pub const fn free_at(&self) -> Instant {
        self.free_at
    }

    /// Forgets the record, planned faults and the count of frames: the next frame is the first one.
    pub fn begin(&mut self) {
        self.take_record();
        self.faults.clear();
        self.frames = 0;
        for member in &mut self.members {
            member.frames = 0;
            member.counted = None;
        }
    }

    /// When something happens next: a frame begins, or a station does something by itself. `None` while all stations wait.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        let act = self.stations.iter().filter_map(S::next_action).min();
        self.next_start().into_iter().chain(act).min()
    }

    /// Runs up to and including `to`. A frame that has begun by then is carried to its end.
    pub fn run_until(&mut self, to: Instant) {
        loop {
            let start = self.next_start();
            let act = self.stations.iter().filter_map(S::next_action).min();
            match (start, act) {
                // What happens at the instant of the start bit still takes part.
                (start, Some(act)) if act <= to && start.is_none_or(|start| act <= start) => {
                    for station in &mut self.stations {
                        if station.next_action().is_some_and(|due| due <= act) {
                            station.advance(act);
                        }
                    }
                }
                (Some(start), _) if start <= to => self.carry(start),
                _ => break,
            }
        }
        self.now = self.now.max(to);
        for station in &mut self.stations {
            station.advance(to);
        }
    }

    /// When the next frame begins, as far as the stations know by now.
    fn next_start(&self) -> Option<Instant> {
        let members = self.stations.iter().zip(&self.members);
        let ready = members.filter_map(|(station, member)| wanted(station, member));
        ready
            .map(|(ready, _)| ready)
            .min()
            .map(|ready| ready.max(self.free_at))
    }

    /// Arbitration at `start`, and the frame that wins it.
    fn carry(&mut self, start: Instant) {
        let Some((first, frame)) = self
            .contenders(start)
            .min_by_key(|(_, frame)| frame.arbitration())
        else {
            return;
        };
        let equal = |other: &Frame| other.arbitration() == frame.arbitration();
        let fault = self.fault_of(first);
        if let Some(FrameFault::Late(span)) = fault {
            self.members[first].held_until = start + span;
            return;
        }
        let mut places = std::mem::take(&mut self.senders);
        places.clear();
        let mut differs: Option<u32> = None;
        for (place, other) in self.contenders(start).filter(|(_, other)| equal(other)) {
            places.push(place);
            let bits = if place == first {
                None
            } else {
                frame.bits_to_difference(&other)
            };
            differs = [differs, bits].into_iter().flatten().min();
        }
        let alone = self.is_alone(&places);
        let (bits, error) = match (differs, fault) {
            (Some(bits), _) => (bits, Some(CanError::ErrorFrame)),
            (None, Some(FrameFault::Corrupt | FrameFault::BusOff)) => {
                (frame.bits_to_acknowledge(), Some(CanError::ErrorFrame))
            }
            (None, fault) if alone || fault == Some(FrameFault::NoAcknowledge) => {
                // The error flag begins after the acknowledge slot, in place of its delimiter.
                (
                    frame.bits_to_acknowledge() - 1,
                    Some(CanError::NoAcknowledge),
                )
            }
            (None, Some(FrameFault::Doubled)) => {
                let whole = frame.wire_bits() - INTERMISSION_BITS;
                (whole + ERROR_FRAME_BITS, None)
            }
            (None, _) => (frame.wire_bits(), None),
        };
        match error {
            Some(error) => self.fail(start, frame, bits, &places, error, fault),
            None => self.complete(start, frame, bits, &places, fault),
        }
        self.senders = places;
    }

    /// The stations that begin a frame at `start`.
    fn contenders(&self, start: Instant) -> impl Iterator<Item = (usize, Frame)> {
        let senders = self.stations.iter().zip(&self.members).enumerate();
        senders.filter_map(move |(place, (station, member))| {
            let (ready, frame) = wanted(station, member)?;
            (ready <= start).then_some((place, frame))
        })
    }

    fn fail(
        &mut self,
        start: Instant,
        frame: Frame,
        bits: u32,
        places: &[usize],
        error: CanError,
        fault: Option<FrameFault>,
    ) {
        let bits = bits + ERROR_FRAME_BITS;
        let end = self.occupy(start, bits);
        for &place in places {
            let member = &mut self.members[place];
            member.failed(error);
            if fault == Some(FrameFault::BusOff) {
                member.off = true;
            }
            self.suspend(place);
            self.stations[place].notice(end, error);
            if self.members[place].off {
                self.stations[place].notice(end, CanError::BusOff);
            }
        }
        if error == CanError::ErrorFrame {
            self.all_but(places, |station| station.notice(end, error));
        }
        self.keep(start, end, frame, places[0], FrameEnd::Error(error));
    }

    fn complete(
        &mut self,
        start: Instant,
        frame: Frame,
        bits: u32,
        places: &[usize],
        fault: Option<FrameFault>,
    ) {
        let end = self.occupy(start, bits);
        let lost = fault == Some(FrameFault::Lost);
        if !lost {
            self.all_but(places, |station| station.hear(end, &frame));
        }
        let outcome = if lost { FrameEnd::Lost } else { FrameEnd::Good };
        self.keep(start, end, frame, places[0], outcome);
        if fault == Some(FrameFault::Doubled) {
            // The sender repeats it: it still wants to send it, and counts it as the same frame.
            return;
        }
        for &place in places {
            let member = &mut self.members[place];
            member.errors = member.errors.saturating_sub(1);
            member.counted = None;
            self.suspend(place);
            self.stations[place].sent(end);
        }
    }

    /// The bus is taken for `bits`, intermission included; gives the end without it.
    fn occupy(&mut self, start: Instant, bits: u32) -> Instant {
        self.busy_bits += u64::from(bits);
        self.free_at = start + self.rate.time_of(bits);
        self.now = self.now.max(start);
        self.free_at - self.rate.time_of(INTERMISSION_BITS)
    }

    fn suspend(&mut self, place: usize) {
        let member = &mut self.members[place];
        if member.errors >= PASSIVE {
            member.held_until = self.free_at + self.rate.time_of(SUSPEND_BITS);
        }
    }

    fn all_but(&mut self, places: &[usize], mut act: impl FnMut(&mut S)) {
        for (place, station) in self.stations.iter_mut().enumerate() {
            if !places.contains(&place) && !self.members[place].off {
                act(station);
            }
        }
    }

    fn is_alone(&self, places: &[usize]) -> bool {
        // Of several senders of one frame each acknowledges the other's.
        let others = self.stations.iter().zip(&self.members).enumerate();
        places.len() == 1
            && !others
                .filter(|(place, _)| !places.contains(place))
                .any(|(_, (station, member))| !member.off && station.acknowledges())
    }

    /// Counts the frame that a station begins, and takes out the fault that was planned for it.
    fn fault_of(&mut self, place: usize) -> Option<FrameFault> {
        let member = &mut self.members[place];
        let number = *member.counted.get_or_insert_with(|| {
            member.frames += 1;
            self.frames += 1;
            self.frames
        });
        let of_station = member.frames;
        let found = self.faults.iter().position(|p| match p.station {
            Some(station) => station == place && p.frame == of_station,
            None => p.frame == number,
        })?;
        Some(self.faults.remove(found).fault)
    }

    fn keep(&mut self, start: Instant, at: Instant, frame: Frame, from: usize, ended: FrameEnd) {
        if let Some(record) = &mut self.record {
            record.push(LineFrame {
                from: u8::try_from(from).ok(),
                start,
                at,
                frame,
                ended,
            });
        }
    }
}

/// The next frame of a station that takes part, and from when on it is sent.
fn wanted<S: Station>(station: &S, member: &SegmentMember) -> Option<(Instant, Frame)> {
    if member.off {
        return None;
    }
    let (ready, frame) = station.wants()?;
    Some((ready.max(member.held_until), frame))
}

/// A station that sends what it is given and keeps what it hears: a bench, a client, a tap.
#[derive(Clone, Debug, Default)]
pub struct Host {
    queue: VecDeque<(Instant, Frame)>,
    heard: VecDeque<(Instant, CanEvent)>,
    /// Ends of own frames.
    sent: VecDeque<Instant>,
    /// It hears, and does not even acknowledge.
    silent: bool,
}

impl Host {
    /// A host that only listens.
    #[must_use]
    pub fn listener() -> Self {
        Self {
            silent: true,
            ..Self::default()
        }
    }

    /// Puts a frame after the others, to be sent from `at` on. A listener sends nothing.
    pub fn send(&mut self, at: Instant, frame: Frame) {
        if !self.silent {
            self.queue.push_back((at, frame));
        }
    }

    /// What it has heard, in order of time.
    pub fn receive(&mut self) -> Option<(Instant, CanEvent)> {
        self.heard.pop_front()
    }

    /// When its next frame that was sent had ended.
    pub fn confirmation(&mut self) -> Option<Instant> {
        self.sent.pop_front()
    }

    /// When the oldest of what it has heard had ended.
    #[must_use]
    pub fn heard_at(&self) -> Option<Instant> {
        self.heard.front().map(|(at, _)| *at)
    }

    /// Forgets what it has heard.
    pub fn forget(&mut self) {
        self.heard.clear();
        self.sent.clear();
    }

    /// Frames that wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }
}

impl Station for Host {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        self.heard.push_back((at, CanEvent::Frame(*frame)));
    }

    fn wants(&self) -> Option<(Instant, Frame)> {
        self.queue.front().copied()
    }

    fn sent(&mut self, at: Instant) {
        self.queue.pop_front();
        self.sent.push_back(at);
    }

    fn notice(&mut self, at: Instant, error: CanError) {
        // One that repeats is kept once.
        let again = |last: &(Instant, CanEvent)| last.1 == CanEvent::Error(error);
        if !self.heard.back().is_some_and(again) {
            self.heard.push_back((at, CanEvent::Error(error)));
        }
    }

    fn next_action(&self) -> Option<Instant> {
        None
    }

    fn advance(&mut self, _to: Instant) {}

    fn acknowledges(&self) -> bool {
        !self.silent
    }
}

impl<D: Station> Participant<Host, D> {
    fn station(&self) -> &dyn Station {
        match self {
            Self::Host(host) => host,
            Self::Drive(drive) => drive,
        }
    }

    fn station_mut(&mut self) -> &mut dyn Station {
        match self {
            Self::Host(host) => host,
            Self::Drive(drive) => drive,
        }
    }
}

impl<D: Station> Station for Participant<Host, D> {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        self.station_mut().hear(at, frame);
    }
    fn wants(&self) -> Option<(Instant, Frame)> {
        self.station().wants()
    }
    fn sent(&mut self, at: Instant) {
        self.station_mut().sent(at);
    }
    fn notice(&mut self, at: Instant, error: CanError) {
        self.station_mut().notice(at, error);
    }
    fn next_action(&self) -> Option<Instant> {
        self.station().next_action()
    }
    fn advance(&mut self, to: Instant) {
        self.station_mut().advance(to);
    }
    fn acknowledges(&self) -> bool {
        self.station().acknowledges()
    }
}
