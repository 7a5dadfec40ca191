//! What is noted of a link to UNITEK drives: what is written, and how fast replies come.

use harness_bench::counted::counted;
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::rig::playing::observed::{LinkNotes, ReceivedSum};
use harness_proto::can::{self, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Request;
use harness_proto::unitek::frame::READ;
use harness_proto::unitek::properties::Dlc4;
use std::collections::{BTreeMap, BTreeSet};

const MOST_KEPT: usize = 100_000;

/// The time of a frame of eight bytes at 100 kbit/s, and some more (UNITEK 3.1).
const LONGEST_FRAME: Span = Span::from_micros(1_500);

/// A link to drives, observed.
pub(super) type Observed<'l> = harness_bench::rig::playing::observed::Observed<'l, FrameNotes>;

/// A drive, by the identifier that it had before the first frame.
type FirstIdentifier = u16;

/// Registers that may have been written, with the drives.
pub(super) type WrittenRegisters = BTreeSet<(FirstIdentifier, u8)>;

/// An identifier that was written to this register of a drive.
pub(super) type GivenIdentifier = (u8, u16, FirstIdentifier);

#[derive(Debug, Default)]
pub(super) struct FrameNotes {
    /// The registers that frames may have written.
    pub(super) written: WrittenRegisters,
    /// The levels of the EEPROM that frames may have stored (84), with the drives.
    stored: BTreeSet<(FirstIdentifier, u16)>,
    /// The identifiers that were written to 68, 69 and 88.
    pub(super) given: Vec<GivenIdentifier>,
    /// The last request, by register, and when it had left.
    asked: Option<(u8, Instant)>,
    /// The registers of the requests of this conversation without a reply: one that was late is answered again where it was repeated.
    awaited: Vec<u8>,
    /// The shortest time from the end of a request to the end of its reply.
    pub(super) shortest: Option<Span>,
    /// The longest time from the end of a request until the bench had read its reply: what the way to the drive and back takes.
    pub(super) longest: Span,
    /// How many frames were received, and their checksum.
    heard: ReceivedSum,
    /// The frames that were received, and how many of them before the last conversation began, all of them if none has; `None` where they are
    /// not kept.
    kept: Option<(Vec<Frame>, usize)>,
    /// The conversation, from the first frame that makes the drives ready.
    pub(super) exchange: Exchange,
}

/// The frames of a conversation and their times, on one clock through all of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Exchange {
    /// What the clock of the link is behind that of the conversation; `None` before it begins.
    behind: Option<Span>,
    /// How many frames had come when the clock of the link began again.
    came_before: usize,
    /// What was sent, and when its last bit had left at the earliest.
    pub(super) sent: Vec<(Instant, Frame)>,
    /// What came: when it was on the bus by its stamp, and when it was read.
    pub(super) came: Vec<(Instant, Instant, Frame)>,
    /// Up to when all that came was read.
    pub(super) read: Instant,
}

impl Exchange {
    /// Begins the conversation; or begins the clock of the link again, at `now` of the one before.
    pub(super) fn begin(&mut self, now: Instant) {
        self.behind = Some(
            self.behind
                .map_or(Span::ZERO, |behind| behind + now.since_start()),
        );
        self.came_before = self.came.len();
    }

    /// Whether a register was asked for last before the clock of the link began again: while the drives were made ready.
    pub(super) fn asks_before_it_began(&self, register: u8) -> bool {
        let began = Instant::START + self.behind.unwrap_or_default();
        let mut sent = self.sent.iter();
        let asks = |sent: &&(Instant, Frame)| sent.1.data().starts_with(&[READ, register]);
        sent.rfind(asks).is_some_and(|sent| sent.0 < began)
    }

    /// What came since the clock of the link began again.
    pub(super) fn came_since_it_began(&self) -> impl Iterator<Item = &Frame> {
        self.came.iter().skip(self.came_before).map(|came| &came.2)
    }

    /// Whether something came after the last frame that was sent.
    pub(super) fn answers_last(&self) -> bool {
        let sent = self.sent.last().map(|sent| sent.0);
        let came = self.came.last().map(|came| came.1);
        came >= sent
    }

    /// How long after its stamp the last frame was read: the others of an adapter that stood still are still to come.
    pub(super) fn last_late(&self) -> Span {
        let last = self.came.last();
        last.map_or(Span::ZERO, |(at, read, _)| read.since(*at))
    }

    /// The longest time for which something stood still: nothing came of a register that comes by itself, more often before or afterwards, or
    /// a frame was read after its stamp.
    pub(super) fn longest_standstill(&self) -> Span {
        let mut streams: BTreeMap<_, Vec<Instant>> = BTreeMap::new();
        for (at, _, frame) in &self.came {
            let register = frame.data().first().copied();
            let stream = streams.entry((frame.id(), register)).or_default();
            stream.push(*at);
        }
        let asked = |register, from, until| {
            let mut sent = self.sent.iter();
            sent.any(|(at, frame)| {
                let read = frame.data().first() == Some(&READ);
                (from..until).contains(at) && read && frame.data().get(1).copied() == register
            })
        };
        let breaks = streams.iter().flat_map(|((_, register), times)| {
            let gap = |place: usize| Some(times.get(place + 1)?.since(*times.get(place)?));
            (0..times.len()).filter_map(move |place| {
                let between = gap(place)?;
                let near = [place.checked_sub(1).and_then(gap), gap(place + 1)];
                let often = near.into_iter().flatten().any(|other| other * 2 <= between);
                let by_itself = || !asked(*register, times[place], times[place + 1]);
                (often && by_itself()).then_some(between)
            })
        });
        let held_up = self.came.iter().map(|(at, read, _)| read.since(*at));
        let all = breaks.chain(held_up).chain(self.replies_held_up());
        all.max().unwrap_or_default()
    }

    /// For how long nothing came while several requests were sent that were all answered then: a drive that loses replies does not send them later.
    fn replies_held_up(&self) -> impl Iterator<Item = Span> {
        let came = self.came.iter().map(|came| came.0);
        let begins = std::iter::once(Instant::START).chain(came.clone());
        begins.zip(came).filter_map(|(begin, end)| {
            let waiting = self.sent.iter().filter(|(at, frame)| {
                let read = frame.data().first() == Some(&READ);
                read && (begin..end).contains(at)
            });
            let first = waiting.clone().nth(1).and(waiting.clone().next())?.0;
            let mut registers = waiting.filter_map(|sent| sent.1.data().get(1));
            let answered = |register: &u8| {
                let sent = self.sent.iter().filter(|sent| sent.0 >= first);
                let sent = sent.filter(|sent| sent.1.data().starts_with(&[READ, *register]));
                let came = self.came.iter().filter(|came| came.0 >= first);
                let came = came.filter(|came| came.2.data().first() == Some(register));
                came.count() >= sent.count()
            };
            registers.all(answered).then(|| end.since(first))
        })
    }

    /// A time of the link.
    fn at(&self, at: Instant) -> Option<Instant> {
        self.behind.map(|behind| at + behind)
    }
}

impl FrameNotes {
    /// Keeps the frames that are received from now on.
    pub(super) fn keep(&mut self) {
        self.kept = Some((Vec::new(), usize::MAX));
    }

    /// The frames that were kept: those before the last conversation, and those in it.
    pub(super) fn kept(&self) -> [&[Frame]; 2] {
        let kept = self.kept.as_ref();
        kept.map_or([&[]; 2], |(frames, begun)| {
            <[_; 2]>::from(frames.split_at(frames.len().min(*begun)))
        })
    }

    /// The drive to which a frame with this identifier goes.
    fn addressed(&self, id: u16) -> FirstIdentifier {
        let mut given = self.given.iter().rev();
        let found = given.find(|given| given.0 != 0x69 && given.1 == id);
        found.map_or(id, |given| given.2)
    }

    /// The levels of the EEPROM that may have been stored, with the drives.
    pub(super) fn stored(&self) -> impl Iterator<Item = (u16, u16)> {
        self.stored.iter().copied()
    }

    /// Whether a request of this conversation has no reply yet.
    pub(super) fn awaits(&self) -> bool {
        !self.awaited.is_empty()
    }

    /// What was received so far, in words.
    pub(super) fn received(&self) -> String {
        let ReceivedSum { pieces, sum } = self.heard;
        format!(
            "{} from the drives, checksum {sum:08X}",
            counted(pieces, "frame")
        )
    }
}

impl LinkNotes for FrameNotes {
    fn sent(&mut self, what: Out<'_>, end: Instant) {
        let frames = what.frames();
        for (behind, frame) in (0..frames.len() as u64).rev().zip(frames) {
            if let Some(at) = self.exchange.at(end - LONGEST_FRAME * behind) {
                self.exchange.sent.push((at, *frame));
            }
            let Ok(rx) = u16::try_from(frame.id().number()) else {
                continue;
            };
            match Request::decode(frame, rx, Dlc4::As3) {
                Ok(Request::Write { register, data }) => {
                    let (drive, value) = (self.addressed(rx), (data.bits() & 0xFFFF) as u16);
                    self.written.insert((drive, register));
                    match register {
                        0x68 | 0x69 | 0x88 if value != drive => {
                            self.given.push((register, value, drive));
                        }
                        0x84 => {
                            self.stored.insert((drive, value));
                        }
                        _ => {}
                    }
                }
                Ok(Request::Read { register }) => {
                    // One that is repeated may get the reply to the first.
                    let first = self.asked.filter(|asked| asked.0 == register);
                    self.asked = first.or(Some((register, end)));
                    self.awaited.push(register);
                }
                Ok(Request::Cycle { .. } | Request::Stop { .. }) | Err(_) => {}
            }
        }
    }

    fn quiet(&mut self, until: Instant) {
        if let Some(until) = self.exchange.at(until) {
            self.exchange.read = self.exchange.read.max(until);
        }
    }

    fn heard(&mut self, _: Medium, at: Instant, now: Instant, heard: HeardPiece) {
        let HeardPiece::Frame(can::CanEvent::Frame(frame)) = heard else {
            return;
        };
        self.heard.pieces += 1;
        if let (Some(at), Some(now)) = (self.exchange.at(at), self.exchange.at(now)) {
            self.exchange.came.push((at, now, frame));
        }
        if let Some((frames, _)) = self.kept.as_mut().filter(|kept| kept.0.len() < MOST_KEPT) {
            frames.push(frame);
        }
        for byte in frame.to_string().bytes() {
            self.heard.add(u32::from(byte));
        }
        let answers = |register: &u8| frame.data().first() == Some(register);
        if let Some(place) = self.awaited.iter().position(answers) {
            self.awaited.remove(place);
        }
        if let Some((register, end)) = self.asked
            && frame.data().first() == Some(&register)
        {
            let took = at.since(end);
            self.longest = self.longest.max(now.since(end));
            self.shortest = Some(self.shortest.map_or(took, |shortest| shortest.min(took)));
            self.asked = None;
        }
    }

    fn begin(&mut self, now: Instant) {
        if self.exchange.behind.is_some() {
            self.exchange.begin(now);
        }
        if let Some((frames, begun)) = &mut self.kept {
            *begun = frames.len();
        }
        self.asked = None;
        self.awaited.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: &u64) -> Instant {
        Instant::START + Span::from_millis(*millis)
    }

    fn frame(text: &str) -> Frame {
        text.parse().expect("a frame")
    }

    /// Frames of 30 (N-ACTUAL) at these times in ms, and requests for it.
    fn longest(came: &[u64], asked: &[u64]) -> Span {
        let came = came
            .iter()
            .map(|time| (at(time), at(time), frame("181#300000")));
        let sent = asked.iter().map(|time| (at(time), frame("201#3D3000")));
        let talk = Exchange {
            came: came.collect(),
            sent: sent.collect(),
            ..Exchange::default()
        };
        talk.longest_standstill()
    }

    /// A request that was repeated because its reply was late has two replies.
    #[test]
    fn each_request_awaits_a_reply() {
        let mut notes = FrameNotes::default();
        let asks = |notes: &mut FrameNotes| {
            notes.sent(Out::Frames(&[frame("201#3DEB00")]), Instant::START);
        };
        let comes = |notes: &mut FrameNotes, text: &str| {
            let heard = HeardPiece::Frame(can::CanEvent::Frame(frame(text)));
            notes.heard(Medium::Frames(can::BitRate::K500), at(&1), at(&1), heard);
        };
        asks(&mut notes);
        asks(&mut notes);
        comes(&mut notes, "181#EB102700");
        comes(&mut notes, "181#40010100");
        assert!(notes.awaits());
        comes(&mut notes, "181#EB102700");
        assert!(!notes.awaits());
    }

    /// A request that is repeated may get the reply to the first one, which was late.
    #[test]
    fn a_repeated_request_is_as_late_as_the_first() {
        let mut notes = FrameNotes::default();
        for asked in [0, 20] {
            notes.sent(Out::Frames(&[frame("201#3DEB00")]), at(&asked));
        }
        let heard = HeardPiece::Frame(can::CanEvent::Frame(frame("181#EB102700")));
        notes.heard(Medium::Frames(can::BitRate::K500), at(&30), at(&30), heard);
        assert_eq!(notes.longest, Span::from_millis(30));
    }

    /// A cycle in which a pause stands, one that has ended before a request, and requests that are far apart (UNITEK 5.2).
    #[test]
    fn a_break_is_one_of_frames_that_come_by_themselves() {
        assert_eq!(
            longest(&[10, 20, 30, 330, 331], &[]),
            Span::from_millis(300)
        );
        assert_eq!(longest(&[10, 310, 320], &[]), Span::from_millis(300));
        assert_eq!(longest(&[10, 20, 30, 40], &[]), Span::ZERO);
        assert_eq!(longest(&[10, 20, 30, 331], &[330]), Span::ZERO);
        assert_eq!(longest(&[10, 311, 611], &[9, 310, 610]), Span::ZERO);
        let late = Exchange {
            came: vec![(at(&10), at(&400), frame("181#300000"))],
            ..Exchange::default()
        };
        assert_eq!(late.longest_standstill(), Span::from_millis(390));
    }

    /// Requests that were repeated meanwhile are all answered after a pause; a drive that has lost a reply does not send it later.
    #[test]
    fn a_pause_in_which_requests_are_repeated_is_one() {
        let pause = longest(&[5, 300, 300, 301], &[4, 20, 40, 60]);
        assert_eq!(pause, Span::from_millis(280));
        assert_eq!(longest(&[5, 300, 300], &[4, 20, 40, 60]), Span::ZERO);
        assert_eq!(longest(&[5, 300], &[4, 20]), Span::ZERO);
    }
}
