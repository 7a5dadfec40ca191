//! Wrong masters.

use crate::deviation::{Deviation, DeviationTable, rows};
use harness_proto::can::{Frame, Id};
use harness_proto::time::Instant;
use harness_proto::unitek::master::{CanMaster, Job, JobNumber, JobRefusal, MasterEvent, Options};
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::{Data, Reply, Request};
use std::collections::VecDeque;

/// A way in which a master breaks the manual, or what section 5 shows of it.
pub type MasterDeviation = Deviation<CanMasterInjection>;

/// How a master is made to deviate.
#[derive(Clone, Copy)]
pub struct CanMasterInjection(How);

#[derive(Clone, Copy)]
enum How {
    /// It sends these frames in place of one.
    Sends(fn(Frame, Request) -> Vec<Frame>),
    /// It takes this in place of a reply of the drive.
    Takes(fn(Frame, Reply, Option<u8>) -> Option<Frame>),
}

fn frame(frame: Frame, bytes: &[u8]) -> Vec<Frame> {
    Frame::new(frame.id(), bytes).into_iter().collect()
}

fn request(frame: Frame, request: Request) -> Vec<Frame> {
    let id = u16::try_from(frame.id().number());
    id.into_iter()
        .filter_map(|id| request.encode(id).ok())
        .collect()
}

fn write(old: Frame, register: u8, value: u16) -> Vec<Frame> {
    let data = Data::Short(value);
    request(old, Request::Write { register, data })
}

/// The deviations of a master.
pub static MASTER_DEVIATIONS: DeviationTable<CanMasterInjection> = DeviationTable(&[
    rows! { CanMasterInjection:
        "asks-by-remote-frame" "4.4" "A request is sent as a remote frame." Sends |f, r| match r {
            Request::Read { .. } => Frame::remote(f.id(), 3).into_iter().collect(),
            _ => vec![f],
        };
        "sends-29-bits" "4.1" "Frames have identifiers of 29 bits." Sends |f, _| {
            let id = Id::extended(f.id().number());
            id.and_then(|id| Frame::new(id, f.data()).ok()).into_iter().collect()
        };
        "sends-to-the-reply-identifier" "5.4" "Frames have the identifier of the replies." Sends |f, _| {
            Frame::base(0x181, f.data()).into_iter().collect()
        };
        "writes-most-significant-first" "4.1" "The bytes of a value stand in the other order." Sends |f, r| match r {
            Request::Write { register, data: Data::Short(value) } => write(f, register, value.swap_bytes()),
            Request::Write { register, data: Data::Long(value) } => {
                request(f, Request::Write { register, data: Data::Long(value.swap_bytes()) })
            }
            _ => vec![f],
        };
        "writes-16-bits-to-ramps" "App 1" "35 and ED are written with 16 bits, which clears their upper halves." Sends |f, r| match r {
            Request::Write { register: register @ (0x35 | 0xED), data } => write(f, register, (data.bits() & 0xFFFF) as u16),
            _ => vec![f],
        };
        "writes-one-byte" "4.5" "A value below 256 is written with one byte." Sends |f, r| match r {
            Request::Write { register, data } if data.bits() < 256 => frame(f, &[register, (data.bits() & 0xFF) as u8]),
            _ => vec![f],
        };
        "sends-each-frame-twice" "5.3" "Each frame is sent twice." Sends |f, _| vec![f; 2];
        "stops-with-zero" "5.2" "A cycle is stopped with the interval 00." Sends |f, r| match r {
            Request::Stop { register } => request(f, Request::Read { register }),
            _ => vec![f],
        };
        "never-stops" "5.2" "A cycle is never stopped." Sends |f, r| match r {
            Request::Stop { .. } => Vec::new(),
            _ => vec![f],
        };
        "interval-as-digits" "ex 9" "The decimal digits of an interval are written as hexadecimal ones." Sends |f, r| match r {
            Request::Cycle { register, every } => {
                let every = every % 10 + every / 10 % 10 * 16;
                request(f, Request::Cycle { register, every: every.max(1) })
            }
            _ => vec![f],
        };
        "asks-for-cycles-only" "5.2" "A single request is sent as a cycle of 10 ms." Sends |f, r| match r {
            Request::Read { register } => request(f, Request::Cycle { register, every: 10 }),
            _ => vec![f],
        };
        "releases-with-event-sending" "5.2" "The lock is written as 10, which switches event sending on and releases the drive." Sends |f, r| match r {
            Request::Write { register: 0x51, .. } => write(f, 0x51, 0x10),
            _ => vec![f],
        };
        "never-locks" "ex 11" "The lock is not written before the start-up." Sends |f, r| match r {
            Request::Write { register: 0x51, data } if data.bits() & 4 != 0 => Vec::new(),
            _ => vec![f],
        };
        "keeps-the-command" "ex 12" "No command is set to 0 before the lock is released." Sends |f, r| match r {
            Request::Write { register: 0x31 | 0x90, data } if data.bits() == 0 => Vec::new(),
            _ => vec![f],
        };
        "never-releases" "ex 11" "The lock is not released." Sends |f, r| match r {
            Request::Write { register: 0x51, data } if data.bits() & 4 == 0 => Vec::new(),
            _ => vec![f],
        };
        "stores-each-write" "ex 7" "Each write of a value is followed by a write to the EEPROM." Sends |f, r| match r {
            Request::Write { .. } => [vec![f], write(f, 0x84, 0)].concat(),
            _ => vec![f],
        };
        "takes-four-bytes-only" "App 7" "A reply with 6 bytes is not taken." Takes |f, reply, _| match reply.data {
            Data::Long(_) => None,
            Data::Short(_) => Some(f),
        };
        "takes-six-bytes-only" "App 7" "A reply with 4 bytes is not taken." Takes |f, reply, _| match reply.data {
            Data::Short(_) => None,
            Data::Long(_) => Some(f),
        };
        "takes-any-register" "5.2" "Every reply is taken for that of the register asked last." Takes |f, reply, asked| {
            let register = asked.unwrap_or(reply.register);
            let id = u16::try_from(f.id().number()).ok()?;
            Reply { register, ..reply }.encode(id).ok()
        };
        "reads-without-sign" "App 5" "A negative value is taken as the same value forward." Takes |f, reply, _| {
            let id = u16::try_from(f.id().number()).ok()?;
            let data = match reply.data {
                Data::Short(value) => Data::Short(value.cast_signed().unsigned_abs()),
                Data::Long(value) => Data::Long(value.cast_signed().unsigned_abs()),
            };
            Reply { data, ..reply }.encode(id).ok()
        };
    },
]);

/// A master with one deviation, or none. Its interface is that of [`CanMaster`].
#[derive(Debug)]
pub struct DeviantCanMaster {
    master: CanMaster,
    deviation: Option<&'static MasterDeviation>,
    rx: u16,
    tx: u16,
    /// Frames to be sent before the master is asked for the next one.
    ahead: VecDeque<Frame>,
    /// The register that was asked last.
    asked: Option<u8>,
}

impl DeviantCanMaster {
    /// A master of the drive that receives on `rx` and sends on `tx`.
    #[must_use]
    pub fn new(
        rx: u16,
        tx: u16,
        options: Options,
        deviation: Option<&'static MasterDeviation>,
    ) -> Self {
        Self {
            master: CanMaster::new(rx, tx, options),
            deviation,
            rx,
            tx,
            ahead: VecDeque::new(),
            asked: None,
        }
    }

    /// See [`CanMaster::submit`].
    ///
    /// # Errors
    /// [`JobRefusal`].
    pub fn submit(&mut self, job: Job) -> Result<JobNumber, JobRefusal> {
        self.master.submit(job)
    }

    /// See [`CanMaster::poll_transmit`].
    pub fn poll_transmit(&mut self, now: Instant) -> Option<Frame> {
        if self.ahead.is_empty() {
            let frame = self.master.poll_transmit(now)?;
            let request = Request::decode(&frame, self.rx, Dlc4::As3);
            if let Ok(Request::Read { register }) = request {
                self.asked = Some(register);
            }
            self.ahead = match (
                self.deviation.map(|deviation| deviation.injection.0),
                request,
            ) {
                (Some(How::Sends(sends)), Ok(request)) => sends(frame, request).into(),
                _ => [frame].into(),
            };
        }
        self.ahead.pop_front()
    }

    /// See [`CanMaster::handle_frame`].
    pub fn handle_frame(&mut self, now: Instant, frame: &Frame) {
        let taken = match (
            self.deviation.map(|deviation| deviation.injection.0),
            Reply::decode(frame, self.tx),
        ) {
            (Some(How::Takes(takes)), Ok(reply)) => takes(*frame, reply, self.asked),
            _ => Some(*frame),
        };
        if let Some(frame) = taken {
            self.master.handle_frame(now, &frame);
        }
    }

    /// See [`CanMaster::poll_timeout`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.master.poll_timeout()
    }

    /// See [`CanMaster::handle_timeout`].
    pub fn handle_timeout(&mut self, now: Instant) {
        self.master.handle_timeout(now);
    }

    /// See [`CanMaster::identifiers`].
    #[must_use]
    pub const fn identifiers(&self) -> (u16, u16) {
        self.master.identifiers()
    }

    /// See [`CanMaster::poll_event`].
    pub fn poll_event(&mut self) -> Option<MasterEvent> {
        self.master.poll_event()
    }
}
