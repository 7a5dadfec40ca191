//! Scenarios of this bus as written: header lines, messages and steps.

use harness_bench::scenario::expression::Located;
use harness_bench::scenario::pattern::Pattern;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::times::Duration;
use harness_proto::can::{BitRate, Id};
use harness_proto::unitek::Register;
use harness_proto::unitek::properties::UnitekProperty;
use harness_proto::unitek::units::{Decimal, Given};
use harness_sim::unitek::Control;
use harness_sim::unitek::deviation::{Deviation, MasterDeviation};

#[derive(Clone, Debug, Default)]
pub(crate) struct Header {
    /// `rate 500`, in kbit/s.
    pub(crate) rate: Option<BitRate>,
    /// Lines about drives, in order.
    pub(crate) drives: Vec<DriveLine>,
    /// `master deviates NAME`.
    pub(crate) master: Option<&'static MasterDeviation>,
}

#[derive(Clone, Debug)]
pub(crate) struct DriveLine {
    pub(crate) drive: Located,
    pub(crate) what: SetupKind,
    pub(crate) span: TextSpan,
}

/// What a header line says about a drive.
#[derive(Clone, Debug)]
pub(crate) enum SetupKind {
    /// `drive 3`, `drive 3 rx 210 tx 190`: it is there.
    There {
        /// The identifier on which it receives.
        rx: Option<u16>,
        /// The identifier on which it sends.
        tx: Option<u16>,
    },
    /// `profile fw472`.
    Profile(&'static str),
    /// `property map-reply = native`.
    Property(&'static UnitekProperty, PropertyValue),
    /// `mode position`.
    Mode(Control),
    /// `deviates NAME`.
    Deviates(&'static Deviation),
    /// What can also be a step.
    Outside(Outside),
}

#[derive(Clone, Debug)]
pub(crate) enum PropertyValue {
    /// A word, or the two digits of a byte.
    Word(String),
    Time(Duration),
}

/// What happens to a drive from outside its bus.
#[derive(Clone, Debug)]
pub(crate) enum Outside {
    /// `register 52 = 3000`.
    Register(RegisterName, WrittenValue),
    /// `input run low`.
    Input(&'static str, bool),
    /// `force tol = 1`, or `force tol off`.
    Force(&'static str, Option<WrittenValue>),
    /// `restart`: off and on. A step only.
    Restart,
}

#[derive(Clone, Debug)]
pub(crate) enum RegisterName {
    /// By its number or name.
    Known {
        register: &'static Register,
        /// Whether it was given by a name.
        by_name: bool,
    },
    /// `(k)`: by a number that a loop counts.
    Counted(Located),
}

/// Contents of a register as written.
#[derive(Clone, Debug)]
pub(crate) struct WrittenValue {
    pub(crate) kind: ValueKind,
    pub(crate) span: TextSpan,
}

/// A raw number, or a number with a unit.
#[derive(Clone, Debug)]
pub(crate) enum ValueKind {
    /// `0CCD`: hexadecimal digits, and how many.
    Raw(u32, usize),
    /// `10%`.
    Given(Decimal, Given),
    /// `(k*256)`.
    Counted(Located),
}

#[derive(Clone, Debug)]
pub(crate) struct Expect {
    pub(crate) value: WrittenValue,
    /// `+-1%`: how far it may be off.
    pub(crate) tolerance: Option<WrittenValue>,
}

/// A frame after `>` or `<`.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub(crate) id: Id,
    /// The data, or the length of a remote frame.
    pub(crate) content: Content,
    pub(crate) span: TextSpan,
}

#[derive(Clone, Debug)]
pub(crate) enum Content {
    /// No data bytes.
    Empty,
    Data(Pattern),
    /// `rtr 3`.
    Remote(u8),
}

#[derive(Clone, Debug)]
pub(crate) enum FrameStep {
    /// `! frame 3: lost`.
    Frame(Located, FrameHarm),
    /// `! drive 1: off`.
    Drive(Located, DriveHarm),
    /// `drive 1 input run low`.
    Outside(Located, Outside),
    /// `? quiet`.
    Quiet,
    /// `? drive 1 register 6E = 11E1CA10`.
    Register(Located, RegisterName, Expect),
    /// `read 1 SPEED_ACTUAL = 50%`.
    Job(JobStep),
    /// `master start-up 1`: a job of the driver.
    Master(JobStep),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FrameHarm {
    Lost,
    Doubled,
    /// `delay 3ms`.
    Delay(Duration),
    Corrupt,
    NoAcknowledge,
    BusOff,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DriveHarm {
    Off,
    On,
    BusOff,
}

#[derive(Clone, Debug)]
pub(crate) struct JobStep {
    pub(crate) drive: Located,
    pub(crate) what: JobKind,
}

#[derive(Clone, Debug)]
pub(crate) enum JobKind {
    /// `read 1 STATUS = 0181`.
    Read(RegisterName, Option<Expect>),
    /// `write 1 SPEED_CMD = 10%`.
    Write(RegisterName, WrittenValue),
    /// `every 1 SPEED_ACTUAL 100ms`.
    Every(RegisterName, Duration),
    /// `stop-every 1 SPEED_ACTUAL`.
    StopEvery(RegisterName),
    /// `lock 1`.
    Lock,
    /// `release 1`.
    Release,
    /// `start-up 1`: a job of the driver only. With `= not-ready`, which is true here, it must end without a release.
    StartUp(bool),
}
