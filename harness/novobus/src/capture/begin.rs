//! Where a capture begins: one that begins in mid-conversation is judged from where the ring was first silent.
//!
//! What may have been set in a ring before the first byte of a capture, although no byte travels, and from when on it does not matter:
//!
//! | before the first byte | until |
//! |---|---|
//! | a drive is in the error mode, or spells out an address (ND21 9.7); it has timed out and waits, or sends zeros (9.9) | the ring passes on a telegram, SYNCO or a check sequence ([`shown`]) |
//! | a drive tests itself and is silent (10.5, 11.8), or is off; a link is broken | the same |
//! | a telegram has begun, and the master made a pause in it (9.1) | an address comes back counted |
//! | the drive of a short address (9.2) | an address comes back counted |
//! | a command has begun in an earlier telegram (9.5) | an address comes back counted behind it |
//! | contents of cells, enable, process data, EEPROM (14.2) | their first answers (`stimuli`) |
//! | time-out monitoring (14.10.2), whole drives | it explains each byte (`open`) |

use harness_bench::capture::Capture;
use harness_bench::capture::gap::{self, Gap};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::{SequenceProgress, SequenceWatch};
use harness_proto::novobus::role::{Role, roles};
use harness_proto::novobus::sync::{Addressing, MAX_NET_LENGTH, PAUSE, SyncByte};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, LineByte, Trace};

/// Whether bytes travelled in a ring when the capture began: a link carried one earlier than the master's first byte can have come there,
/// since each drive passes a byte on when it has received it (ND21 8.2).
pub(super) fn is_midway(capture: &Capture) -> bool {
    let octet = capture.rate.byte_time();
    // Each byte had left the ring.
    if capture
        .listened
        .is_some_and(|listened| listened.before > flight(capture))
    {
        return false;
    }
    capture.traces.iter().any(|ring| {
        let Some(sent) = ring.channels.iter().find(|link| link.from.is_none()) else {
            return false;
        };
        let Some(first) = sent.octets().first() else {
            return false;
        };
        ring.channels.iter().any(|link| {
            let passed = link
                .from
                .map_or(0, |drive| ring.stations.saturating_sub(drive));
            // A clock that is 10 % wrong is no reason.
            let earliest = first.at + Span::from_units(octet.units() * u64::from(passed) * 9 / 10);
            link.octets().first().is_some_and(|byte| byte.at < earliest)
        })
    })
}

/// The most bytes of a telegram: sync byte, address and net bytes (ND21 9.2).
const MOST_OF_A_TELEGRAM: u64 = 2 + MAX_NET_LENGTH as u64;

/// Whether no more was sent before a time than the end of a telegram takes to leave its ring.
pub(super) fn is_one_telegram(capture: &Capture, start: Instant) -> bool {
    let links = capture.traces.iter().flat_map(|ring| &ring.channels);
    let ends = links.flat_map(|link| link.octets().iter().map(|byte| byte.at));
    let front: Vec<Instant> = ends.filter(|at| *at <= start).collect();
    let most = Span::from_units(capture.rate.byte_time().units() * MOST_OF_A_TELEGRAM * 3 / 2);
    match (front.iter().min(), front.iter().max()) {
        (Some(first), Some(last)) => last.since(*first) <= flight(capture) + most,
        _ => true,
    }
}

/// In this time every byte has left its ring.
fn flight(capture: &Capture) -> Span {
    let most = capture.traces.iter().map(|ring| ring.stations).max();
    let most = u64::from(most.unwrap_or(0));
    Span::from_units(capture.rate.byte_time().units() * (most + 2) * 3 / 2)
}

/// When the master's first bytes after silences began, in each of which every byte has left its ring, as far as something came back later.
/// One that is no sync byte (ND21 9.2) goes on with a telegram.
pub(super) fn after_silences(capture: &Capture) -> Vec<Instant> {
    let octet = capture.rate.byte_time();
    let silence = flight(capture);
    let links = capture.traces.iter().flat_map(|ring| &ring.channels);
    let begins = |byte: &LineByte| {
        let sent = byte.received.filter(|_| byte.error.is_none());
        sent.is_some_and(|byte| SyncByte::decode(byte).is_ok())
    };
    let mut ends: Vec<(Instant, bool)> = links
        .flat_map(|link| {
            let ends = link.octets().iter();
            ends.map(move |byte| (byte.at, link.from.is_none() && begins(byte)))
        })
        .collect();
    ends.sort_unstable();
    let last = |ring: &Trace| {
        let last = ring.channels.iter().find(|link| link.to.is_none());
        last.and_then(|link| Some(link.octets().last()?.at))
    };
    let heard = capture.traces.iter().filter_map(last).min();
    let begins = ends.windows(2).filter_map(|two| match *two {
        [(before, _), (at, true)] if at.since(before) > silence => Some(at),
        _ => None,
    });
    let answered = begins.filter(|at| heard.is_some_and(|heard| *at < heard));
    answered.map(|at| at - octet).collect()
}

/// The gaps of a capture, counted in the bytes of all links in order of time.
pub(super) fn gaps(capture: &Capture) -> Vec<Gap> {
    let octet = capture.rate.byte_time();
    let mut gaps = gap::gaps(ends(capture).into_iter().map(|at| (at - octet, at)));
    gaps.retain(|gap| gap.silence >= MASTER_PAUSE);
    gaps
}

/// A ring may be silent for as long: no drive sends anything by itself.
const MASTER_PAUSE: Span = Span::from_millis(1_000);

/// When the bytes of all links had passed, in order.
fn ends(capture: &Capture) -> Vec<Instant> {
    let links = capture.traces.iter().flat_map(|ring| &ring.channels);
    let ends = links.flat_map(|link| link.octets().iter().map(|byte| byte.at));
    let mut ends: Vec<_> = ends.collect();
    ends.sort_unstable();
    ends
}

/// A capture at times that do not count its gaps.
pub(super) fn without(capture: &Capture, gaps: &[Gap]) -> Capture {
    let ends = ends(capture);
    let mut short = capture.clone();
    // Each byte has left the ring before the next one is sent.
    let pause = flight(capture);
    let gaps = gaps.iter().filter(|gap| gap.silence > pause);
    let gaps: Vec<_> = gaps
        .map(|gap| (ends[gap.piece], gap.silence.saturating_sub(pause)))
        .collect();
    let earlier = |at: Instant| {
        let before = gaps.iter().filter(|gap| gap.0 <= at);
        before.fold(at, |at, gap| at - gap.1)
    };
    for link in short.traces.iter_mut().flat_map(|ring| &mut ring.channels) {
        for byte in link.octets_mut().into_iter().flatten() {
            byte.at = earlier(byte.at);
        }
    }
    if let Some(listened) = &mut short.listened {
        listened.until = earlier(listened.until);
    }
    short
}

/// The parts of a capture between its gaps.
pub(super) fn parts(capture: &Capture, gaps: &[Gap]) -> Vec<Capture> {
    let ends = ends(capture);
    let octet = capture.rate.byte_time();
    let mut begins = vec![Instant::START];
    begins.extend(gaps.iter().map(|gap| ends[gap.piece] - octet));
    let part = |place: usize| {
        let mut part = from(capture, begins[place]);
        part.listened = None;
        let end = begins.get(place + 1).copied().unwrap_or(Instant::NEVER);
        for link in part.traces.iter_mut().flat_map(|ring| &mut ring.channels) {
            if let Some(octets) = link.octets_mut() {
                octets.retain(|byte| byte.at <= end);
            }
        }
        part
    };
    (0..begins.len()).map(part).collect()
}

/// The same from a time on.
pub(super) fn from(capture: &Capture, start: Instant) -> Capture {
    let rest = |link: &Channel| {
        Channel::of_octets(link.from, link.to, later(link.octets(), start).to_vec())
    };
    let rest = |ring: &Trace| Trace {
        channels: ring.channels.iter().map(rest).collect(),
        ..ring.clone()
    };
    Capture {
        traces: capture.traces.iter().map(rest).collect(),
        ..capture.clone()
    }
}

fn later(octets: &[LineByte], start: Instant) -> &[LineByte] {
    octets
        .iter()
        .position(|byte| byte.at > start)
        .map_or(&[], |first| &octets[first..])
}

/// What a capture shows of what was set before its first byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShownBeginning {
    /// At this time every drive was in normal mode, and nothing in front of the capture matters any more.
    From {
        at: Instant,
        /// Bytes that the master sent before had not come back by then.
        lost: bool,
    },
    /// A ring never does, and right drives can send what it sends.
    Never,
    /// A ring never does, and sends bytes that right drives send in no mode.
    Wrong,
}

/// When each ring has shown that its drives are in normal mode.
pub(super) fn shown(capture: &Capture, tolerance: Span) -> ShownBeginning {
    let rings = capture.traces.iter().filter_map(|ring| {
        let find = |is_end: fn(&Channel) -> bool| ring.channels.iter().find(|link| is_end(link));
        let first = find(|link| link.from.is_none())?;
        let last = find(|link| link.to.is_none())?;
        (!first.octets().is_empty())
            .then(|| Beginning::of(capture, tolerance, ring, first, last).shown())
    });
    let nothing = ShownBeginning::From {
        at: Instant::START,
        lost: false,
    };
    rings.fold(nothing, |all, next| match (all, next) {
        (ShownBeginning::Wrong, _) | (_, ShownBeginning::Wrong) => ShownBeginning::Wrong,
        (ShownBeginning::From { at: a, lost: b }, ShownBeginning::From { at, lost }) => {
            ShownBeginning::From {
                at: a.max(at),
                lost: b || lost,
            }
        }
        _ => ShownBeginning::Never,
    })
}

/// What the master sent into a ring and what it received, each without damaged bytes.
struct Beginning {
    sent: Vec<(Instant, u8)>,
    came: Vec<(Instant, u8)>,
    roles: Vec<Role>,
    drives: u8,
    /// In this time a byte passes all drives, at the earliest and at the latest.
    way: (Span, Span),
    /// The largest error of a time.
    tolerance: Span,
}

impl Beginning {
    fn of(
        capture: &Capture,
        tolerance: Span,
        ring: &Trace,
        first: &Channel,
        last: &Channel,
    ) -> Self {
        let good = |link: &Channel| {
            let octets = link.octets().iter().filter(|byte| byte.error.is_none());
            octets
                .filter_map(|byte| Some((byte.at, byte.received?)))
                .collect()
        };
        let sent: Vec<(Instant, u8)> = good(first);
        let bytes: Vec<_> = sent.iter().map(|(_, byte)| (*byte, true)).collect();
        let way = capture.rate.byte_time().units() * u64::from(ring.stations);
        Self {
            roles: RingSize::new(ring.stations.into())
                .map_or_else(|_| Vec::new(), |size| roles(size, &bytes)),
            sent,
            came: good(last),
            drives: ring.stations,
            way: (Span::from_units(way * 9 / 10), flight(capture)),
            tolerance,
        }
    }

    /// Whether a byte that came at a time can be the answer to one that was sent at another.
    fn answers(&self, (sent, came): (Instant, Instant)) -> bool {
        came + self.tolerance >= sent + self.way.0 && came <= sent + self.way.1 + self.tolerance
    }

    /// Whether a telegram begins with the byte at this place, and how its drive is named.
    fn telegram(&self, place: usize) -> Option<Addressing> {
        match SyncByte::decode(self.sent[place].1) {
            Ok(SyncByte::Telegram(header)) => Some(header.addressing()),
            _ => None,
        }
    }

    /// From which of the bytes sent on an address shows that a telegram begins there: behind the rest of a command that no drive takes for
    /// the beginning of one.
    fn behind_a_rest(&self) -> usize {
        let begins = |place: usize| matches!(self.roles[place], Role::Address { .. } | Role::Sync);
        let first = (1..self.roles.len())
            .find(|place| self.roles[*place] == Role::Foreign && begins(place - 1));
        let Some(first) = first.filter(|place| self.sent[*place].1 != 0) else {
            return 0;
        };
        let front = &self.roles[..first];
        let drive = front.iter().rev().find_map(|role| role.drive());
        let whole = |role: &Role| matches!(role, Role::Check { .. }) && role.drive() == drive;
        if front.iter().any(whole) { 0 } else { first }
    }

    fn shown(&self) -> ShownBeginning {
        let pairs = || self.came.windows(2).map(|two| [two[0], two[1]]);
        let counted = |[(at, sync), (end, address)]: &[(Instant, u8); 2]| {
            let asked = |place: usize| {
                self.telegram(place) == Some(Addressing::AddressFollows)
                    && self.sent[place].1 == *sync
                    && self.sent[place + 1].1.wrapping_add(self.drives) == *address
                    && self.answers((self.sent[place].0, *at))
                    && self.answers((self.sent[place + 1].0, *end))
            };
            (self.behind_a_rest()..self.sent.len().saturating_sub(1)).any(asked)
        };
        let address = pairs().find(counted).map(|[_, (end, _)]| end);
        let mut watch = SequenceWatch::default();
        let sequence = self
            .came
            .iter()
            .find(|(_, byte)| watch.see(*byte, true) == SequenceProgress::Complete);
        // Where a short address, or no sync byte, is in front, more than the mode is not known.
        let sync = (0..self.sent.len())
            .find(|place| SyncByte::decode(self.sent[*place].1) != Ok(SyncByte::Synco));
        let idle = sync.unwrap_or(self.sent.len());
        let is_whole = sync.is_none_or(|place| {
            self.telegram(place) == Some(Addressing::AddressFollows) || self.sent[place].1 == 0
        });
        let passed = |(at, byte): &&(Instant, u8)| {
            self.sent[..idle]
                .iter()
                .any(|(sent, first)| first == byte && self.answers((*sent, *at)))
        };
        let synco = self
            .came
            .iter()
            .find(passed)
            .filter(|_| is_whole && self.behind_a_rest() == 0);
        let at = |byte: &(Instant, u8)| byte.0;
        let all = [address, sequence.map(at), synco.map(at)];
        match all.into_iter().flatten().min() {
            Some(at) => ShownBeginning::From {
                at,
                lost: self.is_lost(at),
            },
            None if is_whole && !self.came.iter().all(|byte| self.may_come(*byte)) => {
                ShownBeginning::Wrong
            }
            None => ShownBeginning::Never,
        }
    }

    /// Whether bytes do not come back that were sent long before this time.
    fn is_lost(&self, at: Instant) -> bool {
        let home = |sent: Instant| sent + self.way.1 + self.tolerance;
        let due = |(sent, byte): &&(Instant, u8)| home(*sent) < at && *byte != PAUSE;
        let came = self.came.iter().take_while(|byte| byte.0 < at).count();
        self.sent.iter().filter(due).count() > came
    }

    /// Whether right drives in any mode can send a byte: zeros and numbers of the error mode, and bytes of the master's that drives count on
    /// (ND21 9.7).
    fn may_come(&self, (at, byte): (Instant, u8)) -> bool {
        let counted = |counted_on: u8| byte.wrapping_sub(counted_on) <= self.drives;
        let before = self
            .sent
            .first()
            .is_some_and(|(first, _)| at.since(*first) < self.way.0);
        before
            || counted(0)
            || self
                .sent
                .iter()
                .any(|(sent, first)| self.answers((*sent, at)) && counted(*first))
    }
}
