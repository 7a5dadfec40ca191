//! Wrong drives and wrong masters: named deviations from the manual, for tests that must find them.
//!
//! A [`Deviant`] wraps a right [`Drive`] and is the only place that injects deviations: it changes the frames before the drive hears
//! them and those that it sends. The drive itself is unchanged. [`DEVIATIONS`] is the table. [`DeviantCanMaster`] and
//! [`MASTER_DEVIATIONS`] do the same for the master.

mod hears;
mod master;
mod sends;

pub use master::{DeviantCanMaster, MASTER_DEVIATIONS, MasterDeviation};

use super::drive::Drive;
use super::outbox::Waiting;
use crate::deviation::{self, DeviationTable};
use crate::segment::Station;
use harness_proto::can::Frame;
use harness_proto::time::Instant;
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::{Data, Reply, Request};
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

/// A way in which a drive breaks the manual.
pub type Deviation = deviation::Deviation<CanInjection>;

/// How a drive is made to deviate.
#[derive(Clone, Copy)]
pub struct CanInjection(How);

/// Where it deviates.
#[derive(Clone, Copy)]
enum How {
    /// The drive hears these frames in place of the one on the bus.
    Hears(fn(&Hearing<'_>) -> Vec<Frame>),
    /// The drive sends these frames in place of its own.
    Sends(fn(&SentFrame<'_>) -> Vec<Frame>),
}

/// The deviations of a drive: those of what it hears, then those of what it sends.
pub static DEVIATIONS: DeviationTable<CanInjection> =
    DeviationTable(&[hears::DEVIATIONS, sends::DEVIATIONS]);

/// Those that depend on how many frames were heard and sent before, and the one that depends on what was first sent.
const COUNTING: [&str; 2] = ["loses-each-fifth-frame", "loses-each-fifth-reply"];
const REPEATING: &str = "cyclic-frames-never-change";

impl Deviation {
    /// Whether it depends on how many frames were heard and sent before: it shows in each fifth one.
    #[must_use]
    pub fn counts(&self) -> bool {
        COUNTING.contains(&self.name)
    }
}

/// What a deviant drive remembers.
#[derive(Clone, Debug, Default)]
struct DriveMemory {
    /// Frames heard, the present one included.
    heard: u64,
    /// Frames sent.
    sent: u64,
    /// What was first sent of a register.
    first: BTreeMap<u8, Data>,
}

/// A frame that a deviant drive hears.
struct Hearing<'a> {
    drive: &'a Drive,
    memory: &'a DriveMemory,
    frame: Frame,
    /// The identifier to which the drive listens.
    rx: u16,
    /// What a right drive reads out of it.
    request: Option<Request>,
}

impl Hearing<'_> {
    /// The frame as it is.
    fn as_it_is(&self) -> Vec<Frame> {
        vec![self.frame]
    }

    /// Another request in its place.
    fn instead(&self, request: Request) -> Vec<Frame> {
        request.encode(self.rx).into_iter().collect()
    }

    /// The same data bytes with the drive's own identifier.
    fn addressed(&self) -> Vec<Frame> {
        Frame::base(self.rx, self.frame.data())
            .into_iter()
            .collect()
    }

    /// The register and the lower half of what is written, if it is a write.
    fn written(&self) -> Option<(u8, u16)> {
        match self.request? {
            Request::Write { register, data } => Some((register, (data.bits() & 0xFFFF) as u16)),
            _ => None,
        }
    }

    /// Writes this in place of what is written to `register`; other frames stay as they are.
    fn writing(&self, register: u8, value: impl FnOnce(u16) -> u16) -> Vec<Frame> {
        match self.written() {
            Some((written, old)) if written == register => self.instead(Request::Write {
                register,
                data: Data::Short(value(old)),
            }),
            _ => self.as_it_is(),
        }
    }

    /// Does not hear writes to `register`.
    fn without_writes(&self, register: u8) -> Vec<Frame> {
        match self.written() {
            Some((written, _)) if written == register => Vec::new(),
            _ => self.as_it_is(),
        }
    }

    /// The interval of a cycle changed.
    fn with_interval(&self, interval: impl FnOnce(u8) -> u8) -> Vec<Frame> {
        match self.request {
            Some(Request::Cycle { register, every }) => self.instead(Request::Cycle {
                register,
                every: interval(every).clamp(1, 254),
            }),
            _ => self.as_it_is(),
        }
    }
}

/// A frame that a deviant drive sends.
struct SentFrame<'a> {
    drive: &'a Drive,
    memory: &'a DriveMemory,
    waiting: &'a Waiting,
    reply: Reply,
    tx: u16,
}

impl SentFrame<'_> {
    fn as_it_is(&self) -> Vec<Frame> {
        vec![self.waiting.frame]
    }

    /// Another reply in its place.
    fn instead(&self, reply: Reply) -> Vec<Frame> {
        reply.encode(self.tx).into_iter().collect()
    }

    /// Other contents, in the same width.
    fn contents(&self, of: impl FnOnce(u32) -> u32) -> Vec<Frame> {
        let bits = of(self.reply.data.bits());
        let data = match self.reply.data {
            Data::Short(_) => Data::Short((bits & 0xFFFF) as u16),
            Data::Long(_) => Data::Long(bits),
        };
        self.instead(Reply { data, ..self.reply })
    }

    /// Other contents of one register; other frames stay as they are.
    fn register(&self, number: u8, of: impl FnOnce(u32) -> u32) -> Vec<Frame> {
        if self.reply.register == number {
            self.contents(of)
        } else {
            self.as_it_is()
        }
    }

    /// Other data bytes.
    fn bytes(&self, of: impl FnOnce(&[u8]) -> Vec<u8>) -> Vec<Frame> {
        let bytes = of(self.waiting.frame.data());
        Frame::base(self.tx, &bytes).into_iter().collect()
    }
}

/// A drive with one deviation, or none.
#[derive(Clone, Debug)]
pub struct Deviant {
    drive: Drive,
    deviation: Option<&'static Deviation>,
    memory: DriveMemory,
    /// Frames already sent of those that stand for the drive's next one.
    part: usize,
}

impl Deviant {
    /// Wraps a drive.
    #[must_use]
    pub fn new(drive: Drive, deviation: Option<&'static Deviation>) -> Self {
        Self {
            drive,
            deviation,
            memory: DriveMemory::default(),
            part: 0,
        }
    }

    /// The right drive inside.
    #[must_use]
    pub const fn drive(&self) -> &Drive {
        &self.drive
    }

    /// See [`Drive::state`].
    #[must_use]
    pub fn state(&self) -> u64 {
        let of_drive = self.drive.state();
        match self.deviation {
            None => of_drive,
            Some(deviation) => {
                let mut state = DefaultHasher::new();
                (of_drive, self.part).hash(&mut state);
                if deviation.counts() {
                    (self.memory.heard % 5, self.memory.sent % 5).hash(&mut state);
                }
                if deviation.name == REPEATING {
                    self.memory.first.hash(&mut state);
                }
                state.finish()
            }
        }
    }

    /// The right drive inside.
    pub fn drive_mut(&mut self) -> &mut Drive {
        &mut self.drive
    }

    /// What stands for the drive's next frame.
    fn next(&self) -> Option<(Instant, Vec<Frame>)> {
        let waiting = self.drive.wants()?;
        let tx = self.drive.identifiers().1;
        let frames = match (
            self.deviation.map(|deviation| deviation.injection.0),
            Reply::decode(&waiting.frame, tx),
        ) {
            (Some(How::Sends(sends)), Ok(reply)) => sends(&SentFrame {
                drive: &self.drive,
                memory: &self.memory,
                waiting,
                reply,
                tx,
            }),
            _ => vec![waiting.frame],
        };
        Some((waiting.ready, frames))
    }

    /// Drops frames in place of which nothing is sent.
    fn settle(&mut self) {
        while let Some((_, frames)) = self.next() {
            if self.part < frames.len() {
                return;
            }
            self.part = 0;
            self.take();
        }
    }

    fn take(&mut self) {
        let tx = self.drive.identifiers().1;
        let Some(waiting) = self.drive.sent() else {
            return;
        };
        self.memory.sent += 1;
        if self
            .deviation
            .is_some_and(|deviation| deviation.name == REPEATING)
            && let Ok(reply) = Reply::decode(&waiting.frame, tx)
        {
            self.memory
                .first
                .entry(reply.register)
                .or_insert(reply.data);
        }
    }
}

impl Station for Deviant {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        self.memory.heard += 1;
        let rx = self.drive.identifiers().0;
        let frames = match self.deviation.map(|deviation| deviation.injection.0) {
            Some(How::Hears(hears)) => {
                self.drive.advance(at);
                hears(&Hearing {
                    drive: &self.drive,
                    memory: &self.memory,
                    frame: *frame,
                    rx,
                    request: Request::decode(frame, rx, Dlc4::As3).ok(),
                })
            }
            _ => vec![*frame],
        };
        for frame in frames {
            self.drive.hear(at, &frame);
        }
        self.settle();
    }

    fn wants(&self) -> Option<(Instant, Frame)> {
        let (ready, frames) = self.next()?;
        Some((ready, *frames.get(self.part)?))
    }

    fn sent(&mut self, _at: Instant) {
        self.part += 1;
        if self
            .next()
            .is_none_or(|(_, frames)| self.part >= frames.len())
        {
            self.part = 0;
            self.take();
        }
        self.settle();
    }

    fn next_action(&self) -> Option<Instant> {
        self.drive.next_action()
    }

    fn advance(&mut self, to: Instant) {
        Station::advance(&mut self.drive, to);
        self.settle();
    }

    fn acknowledges(&self) -> bool {
        self.drive.acknowledges()
    }
}
