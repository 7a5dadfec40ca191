//! A link that notes what is sent, how fast replies come, and how late the computer is.

use crate::link::{Capability, Lead, Line, Link, Moment, PlacedFault, Trouble};
use crate::medium::{Heard, Medium, Out};
use harness_proto::can::{self, Frame};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Request;
use harness_proto::unitek::properties::Dlc4;
use harness_sim::record::Trace;
use std::any::Any;
use std::collections::BTreeSet;

/// The most frames of an attempt that are kept.
const MOST_KEPT: usize = 100_000;

/// A link to drives, observed. Its notes follow from what the link shows, so that a record gives the same ones.
pub(super) struct Observed<'l> {
    link: &'l mut dyn Link,
    /// By how much a wait has ended late, at most.
    late: Span,
    /// The registers that frames may have written, with the identifiers that the frames had.
    written: BTreeSet<(u16, u8)>,
    /// The last request, by register, and when it had left.
    asked: Option<(u8, Instant)>,
    /// The shortest time from the end of a request to the end of its reply.
    shortest: Option<Span>,
    /// The longest time from the end of a request until the bench had read its reply.
    longest: Span,
    /// How the link is made worse; `None` for the link as it is.
    slow: Option<Slow>,
    /// How often something was sent.
    sent: u32,
    /// How many frames were received, and a checksum of them (FNV-1a).
    heard: (usize, u32),
    /// The frames that were received, and how many of them before the last conversation began, all of them if none has; `None` where they are
    /// not kept.
    kept: Option<(Vec<Frame>, usize)>,
}

/// What an adapter and a busy computer may do to frames.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slow {
    /// How late a frame leaves.
    pub(super) by: Span,
    /// Which of two frames is late: 0 and 1 for one of them, 2 for both.
    pub(super) which: u32,
    /// How exact times are compared.
    pub(super) tolerance: Span,
}

impl<'l> Observed<'l> {
    pub(super) fn new(link: &'l mut dyn Link) -> Self {
        Self {
            link,
            late: Span::ZERO,
            written: BTreeSet::new(),
            asked: None,
            shortest: None,
            longest: Span::ZERO,
            slow: None,
            sent: 0,
            heard: (0, 0x811C_9DC5),
            kept: None,
        }
    }

    /// Keeps the frames that are received.
    pub(super) fn keeping(mut self) -> Self {
        self.kept = Some((Vec::new(), usize::MAX));
        self
    }

    /// The frames that were kept: those before the last conversation, and those in it.
    pub(super) fn kept(&self) -> [&[Frame]; 2] {
        let kept = self.kept.as_ref();
        kept.map_or([&[]; 2], |(frames, begun)| {
            <[_; 2]>::from(frames.split_at(frames.len().min(*begun)))
        })
    }

    /// The link made worse, for a rehearsal.
    pub(super) const fn slowed(mut self, slow: Option<Slow>) -> Self {
        self.slow = slow;
        self
    }

    /// Sends, each frame later than it should be.
    fn send_late(&mut self, port: usize, what: Out<'_>, slow: Slow) -> Instant {
        let mut end = self.link.now();
        for frame in what.frames() {
            self.sent += 1;
            if slow.which > 1 || self.sent % 2 == slow.which {
                let until = self.link.now() + slow.by;
                while self.link.now() < until && self.link.trouble().is_none() {
                    self.link.wait(until);
                }
            }
            end = self.link.send(port, Out::Frames(&[*frame]));
        }
        end
    }

    /// By how much a wait has ended late since the last call, at most.
    pub(super) fn take_late(&mut self) -> Span {
        std::mem::take(&mut self.late)
    }

    /// The registers that may have been written, with the identifiers of the frames.
    pub(super) fn written(&self) -> impl Iterator<Item = (u16, u8)> {
        self.written.iter().copied()
    }

    /// The longest time from the end of a request until the bench had read its reply: what the way to the drive and back takes.
    pub(super) const fn longest(&self) -> Span {
        self.longest
    }

    /// The shortest time from the end of a request to the end of its reply.
    pub(super) const fn shortest(&self) -> Option<Span> {
        self.shortest
    }

    /// What was received so far, in words: how many frames, and their checksum.
    pub(super) fn received(&self) -> String {
        let (frames, sum) = self.heard;
        format!("{frames} frames from the drives, checksum {sum:08X}")
    }

    fn note(&mut self, frame: &Frame, end: Instant) {
        let Ok(rx) = u16::try_from(frame.id().number()) else {
            return;
        };
        match Request::decode(frame, rx, Dlc4::As3) {
            Ok(Request::Write { register, .. }) => {
                self.written.insert((rx, register));
            }
            Ok(Request::Read { register }) => self.asked = Some((register, end)),
            Ok(Request::Cycle { .. } | Request::Stop { .. }) | Err(_) => {}
        }
    }

    fn hear(&mut self, at: Instant, heard: Heard) {
        let Heard::Frame(can::Heard::Frame(frame)) = heard else {
            return;
        };
        self.heard.0 += 1;
        if let Some((frames, _)) = self.kept.as_mut().filter(|own| own.0.len() < MOST_KEPT) {
            frames.push(frame);
        }
        for byte in frame.to_string().bytes() {
            self.heard.1 = (self.heard.1 ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        }
        if let Some((register, end)) = self.asked
            && frame.data().first() == Some(&register)
        {
            let took = at.since(end);
            self.longest = self.longest.max(self.link.now().since(end));
            self.shortest = Some(self.shortest.map_or(took, |own| own.min(took)));
            self.asked = None;
        }
    }
}

impl Line for Observed<'_> {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        let end = match self.slow {
            Some(slow) => self.send_late(port, what, slow),
            None => self.link.send(port, what),
        };
        for frame in what.frames() {
            self.note(frame, end);
        }
        end
    }

    fn permits(&self, port: usize, what: Out<'_>) -> bool {
        self.link.permits(port, what)
    }

    fn denied(&self, port: usize, what: Out<'_>) -> Option<String> {
        self.link.denied(port, what)
    }

    fn refused(&self) -> usize {
        self.link.refused()
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, Heard)> {
        let (at, heard) = self.link.receive(port)?;
        self.hear(at, heard);
        Some((at, heard))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let more = self.link.wait(until);
        self.late = self.late.max(self.link.now().since(until));
        more
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.link.trouble()
    }

    fn pause_due(&self) -> Option<Instant> {
        self.link.pause_due()
    }

    fn pause(&mut self) {
        self.link.pause();
    }

    fn lead(&self) -> Lead {
        self.link.lead()
    }
}

impl Link for Observed<'_> {
    fn capabilities(&self) -> &[Capability] {
        self.link.capabilities()
    }

    fn begin(&mut self) {
        self.link.begin();
        if let Some((frames, begun)) = &mut self.kept {
            *begun = frames.len();
        }
        self.asked = None;
    }

    fn step(&mut self, place: usize) {
        self.link.step(place);
    }

    fn busy(&self) -> bool {
        self.link.busy()
    }

    fn inject(&mut self, port: usize, fault: PlacedFault, moment: Moment) {
        self.link.inject(port, fault, moment);
    }

    fn reaches(&self, port: usize, link: usize) -> bool {
        self.link.reaches(port, link)
    }

    fn listens(&self, port: usize, link: usize) -> bool {
        self.link.listens(port, link)
    }

    fn tapped(&mut self, port: usize, link: usize) -> Option<Vec<Received>> {
        self.link.tapped(port, link)
    }

    fn time_tolerance(&self) -> Span {
        let slow = self.slow.map(|slow| slow.tolerance);
        slow.unwrap_or_else(|| self.link.time_tolerance())
    }

    fn beside(&self) -> Option<&dyn Any> {
        self.link.beside()
    }

    fn unused_faults(&self) -> Vec<String> {
        self.link.unused_faults()
    }

    fn carried(&self) -> u64 {
        self.link.carried()
    }

    fn drives(&self, port: usize) -> u8 {
        self.link.drives(port)
    }

    fn trace(&self, port: usize) -> Trace {
        self.link.trace(port)
    }
}
