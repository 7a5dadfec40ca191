//! Scenarios of this bus as written: header lines, telegrams and steps.

use harness_bench::scenario::expression::Located;
use harness_bench::scenario::pattern::Pattern;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::times::Duration;
use harness_proto::nordac::properties::NordacProperty;
use harness_proto::nordac::{Parameter, PpoType};
use harness_proto::profibus::BusRate;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::nordac::deviation::{Deviation, MasterDeviation};
use harness_sim::octet_segment::TelegramFault;

#[derive(Clone, Debug, Default)]
pub(crate) struct Header {
    /// `rate 500`, in kbit/s.
    pub(crate) rate: Option<BusRate>,
    /// `master deviates NAME`.
    pub(crate) master: Option<&'static MasterDeviation>,
    /// Lines about slaves, in order.
    pub(crate) slaves: Vec<SlaveLine>,
}

#[derive(Clone, Debug)]
pub(crate) struct SlaveLine {
    pub(crate) slave: Located,
    pub(crate) what: SetupKind,
    pub(crate) span: TextSpan,
}

/// What a header line says about a slave.
#[derive(Clone, Debug)]
pub(crate) enum SetupKind {
    /// `slave 8`, `slave 8 ppo 2`, `slave 8 posicon`: it is there.
    There {
        /// The PPO type that it is set to.
        ppo: Option<PpoType>,
        posicon: bool,
    },
    /// `property pzd-invalid = hold`.
    Property(&'static NordacProperty, String),
    /// `parameter 1205 = 70.0Hz`.
    Parameter(ParameterName, WrittenValue),
    /// `deviates NAME`.
    Deviates(&'static Deviation),
}

#[derive(Clone, Debug)]
pub(crate) struct ParameterName {
    pub(crate) which: ParameterChoice,
    /// What stands after it: `.3` is set 3 or sub-index 3, `.5.2` element 5 in set 2.
    pub(crate) index: Vec<Located>,
    pub(crate) span: TextSpan,
}

/// How a parameter is given.
#[derive(Clone, Debug)]
pub(crate) enum ParameterChoice {
    /// `1205`.
    Numbered(u16),
    /// `"Maximum frequ."`: one of the table.
    Named(&'static Parameter),
    /// `(k)`: by a number that a loop counts.
    Counted(Located),
}

#[derive(Clone, Debug)]
pub(crate) struct WrittenValue {
    pub(crate) kind: ValueKind,
    pub(crate) span: TextSpan,
}

/// A raw number, or a number with a unit.
#[derive(Clone, Debug)]
pub(crate) enum ValueKind {
    /// `700`: a raw decimal number.
    Raw(i64),
    /// `70.0Hz`: a number with its unit, as written.
    Given(String),
    /// `(k*10)`.
    Counted(Located),
}

/// A telegram after `>` or `<`.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub(crate) octets: Pattern,
    pub(crate) bad: Vec<Bad>,
}

/// `bad 3`: an octet of a telegram that goes out damaged.
#[derive(Clone, Debug)]
pub(crate) struct Bad {
    /// Which octet, counted from 1.
    pub(crate) octet: Located,
    pub(crate) how: Damage,
}

/// What is wrong with an octet of a telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Damage {
    /// `bad 3`: its parity bit is wrong.
    Parity,
    /// `bad 3 stop`: its stop bit is 0.
    Stop,
    /// `bad 3 flip 0 4`: these bits of it are inverted.
    Flip(Flips),
    /// `bad 3 gap 2bytes`: the line is idle for this time in front of it.
    Gap(Duration),
}

#[derive(Clone, Debug)]
pub(crate) enum TelegramStep {
    /// `! slave 8 byte 3: flip 0`.
    Octet(Sender, Located, OctetHarm),
    /// `! slave 8 telegram 3: lost`.
    Telegram(Sender, Located, TelegramHarm),
    /// `! slave 8: off`.
    Power(Located, bool),
    /// `slave 8 link lost`.
    Outside(Located, Outside),
    /// `? quiet`.
    Quiet,
    /// `? slave 8 parameter 1202 = 100`.
    Parameter(Located, ParameterName, WrittenValue),
    /// `read 8 1202 = 5s`.
    Job(JobStep),
}

/// Whose octets or telegrams are counted.
#[derive(Clone, Debug)]
pub(crate) enum Sender {
    /// The octets or telegrams of all stations.
    Any,
    /// `master`.
    Master,
    /// `slave 8`.
    Slave(Located),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OctetHarm {
    /// A fault that needs no value.
    Plain(LinkFault),
    /// `delay 3ms`: it leaves later, and those after it too.
    Delay(Duration),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TelegramHarm {
    /// `lost`, `doubled` or `former`.
    Plain(TelegramFault),
    /// `delay 3ms`: it begins later.
    Delay(Duration),
}

/// What happens to a slave from outside its bus.
#[derive(Clone, Debug)]
pub(crate) enum Outside {
    /// `link lost`, `link found`: whether inverter and module have each other.
    Link(bool),
    /// `fault on`, `fault 3 on`, `fault off`: a cause of a fault comes or goes.
    Fault {
        /// The number of the fault; 3 (overcurrent) where none is given.
        number: Option<Located>,
        /// Whether the cause is there.
        on: bool,
    },
    /// `restart`: power off and on.
    Restart,
}

#[derive(Clone, Debug)]
pub(crate) struct JobStep {
    pub(crate) slave: Located,
    pub(crate) what: JobKind,
}

#[derive(Clone, Debug)]
pub(crate) enum JobKind {
    /// `start 8 ppo 1 watchdog 300ms`.
    Start {
        /// The PPO type that the master configures; that of the slave where it is left out.
        ppo: Option<PpoType>,
        /// The DP watchdog; off where it is left out.
        watchdog: Option<Duration>,
    },
    /// `exchange 8 STW=047F HSW=50% -> ZSW=0F37 HIW=50%`.
    Exchange {
        /// What is sent; words that are left out stay as they are.
        send: Vec<(WordName, WordValue)>,
        expect: Vec<(WordName, WordValue)>,
    },
    /// `read 8 1202 = 5s`.
    Read(ParameterName, Option<WantedAnswer>),
    /// `write 8 1205.3 = 50.0Hz`, with `error 2` after it where it must be refused.
    Write(ParameterName, WrittenValue, Option<Located>),
    /// `on 8`.
    On,
    /// `off 8`.
    Off,
    /// `quick-stop 8`.
    QuickStop,
    /// `acknowledge 8`.
    Acknowledge,
}

#[derive(Clone, Debug)]
pub(crate) enum WantedAnswer {
    /// `= 5s`.
    Value(WrittenValue),
    /// `error 3`: the number of the error.
    Error(Located),
}

/// A word of the process data, or the parameter channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WordName {
    /// STW or ZSW.
    Control,
    /// HSW or HIW.
    Main,
    /// PZD3.
    Third,
    /// PZD4.
    Fourth,
    /// The eight bytes of the parameter channel.
    Pkw,
}

#[derive(Clone, Debug)]
pub(crate) struct WordValue {
    pub(crate) kind: WordKind,
    pub(crate) span: TextSpan,
}

#[derive(Clone, Debug)]
pub(crate) enum WordKind {
    /// `047F`, `0Fxx`: hexadecimal digits, `xx` for any byte.
    Bytes(Vec<Option<u8>>),
    /// `50%` of 4000h, as its digits and how many of them stand after the point.
    Percent(i64, u32),
    /// `(k*256)`.
    Counted(Located),
}
