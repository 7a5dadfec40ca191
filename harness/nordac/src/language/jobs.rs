//! Jobs of the master: telegrams made from the codec, and what their replies must be.

use super::Nordac;
use super::parse::word_name;
use super::plan::{MASTER, PlannedJob, PlannedParameter, PlannedWanted, PlannedWord, SentTelegram};
use super::syntax::WordName;
use harness_bench::counted::counted;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::outcome::Stop;
use harness_bench::scenario::run::player::Runner;
use harness_proto::decode::Decoded;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Answer, IDENT, Image, Pkw, PpoType, Task};
use harness_proto::profibus::dp::{Diagnosis, Service, SetPrm};
use harness_proto::profibus::fdl::{FcFunction, FcStatus, FrameControl, Sequence};
use harness_proto::profibus::{Buffer, Pdu, Telegram};
use harness_proto::time::{Instant, Span};
use std::collections::BTreeMap;

/// How long a drive may need for a state that it reaches at once.
const PATIENCE: Span = Span::from_millis(1000);
/// How long it may need for one after a ramp.
const RAMP: Span = Span::from_millis(600_000);
/// The time between two exchanges while a job waits for a state.
const POLL: Span = Span::from_millis(10);
/// The exchange whose reply shows a task's answer: two after the one that carries the task (3.4.1). A slower drive may need more.
const MOST_EXCHANGES: usize = 32;

/// PZD valid, OFF2 and OFF3 not active, enable, setpoint enabled, and OFF1: the drive gets ready (3.2.1).
const READY: u16 = 0x047E;
/// `READY` with ON.
const ENABLED: u16 = 0x047F;
/// `ENABLED` with OFF3.
const QUICK_STOP: u16 = 0x047B;
/// The states that ZSW shows in bits 6 and 3 to 0 (3.3).
const STATE: u16 = 0x004F;
const READY_TO_START: u16 = 0x0001;
const OPERATION_ENABLED: u16 = 0x0004;
const FAULT: u16 = 0x0008;

/// What the master keeps of its slaves while a scenario is played.
#[derive(Debug, Default)]
pub(crate) struct KnownSlaves {
    slaves: BTreeMap<u8, SlaveMemory>,
}

#[derive(Clone, Copy, Debug, Default)]
struct SlaveMemory {
    sequence: Sequence,
    ppo: Option<PpoType>,
    /// The words that were sent last.
    sent: Image,
}

pub(super) fn play(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    job: &PlannedJob,
) -> Result<(), Stop> {
    match job {
        PlannedJob::Start { ppo, watchdog } => start(runner, span, slave, *ppo, *watchdog),
        PlannedJob::Exchange { send, expect } => {
            let known = known(runner, slave);
            known.sent.pkw = Pkw::default();
            for (name, word) in send {
                known.put(*name, word);
            }
            let reply = exchange(runner, span, slave)?;
            judge(span, slave, &reply, expect)
        }
        PlannedJob::Read(parameter, None) => {
            task(runner, span, slave, parameter.read()).map(|_| ())
        }
        PlannedJob::Read(parameter, Some(PlannedWanted::Value(raw))) => {
            read(runner, span, slave, *parameter, Some(*raw))
        }
        PlannedJob::Read(parameter, Some(PlannedWanted::Error(error))) => {
            let answer = task(runner, span, slave, parameter.read())?;
            refused(span, parameter, answer, *error)
        }
        PlannedJob::Write(parameter, raw, error) => {
            let answer = task(runner, span, slave, parameter.change(*raw))?;
            match error {
                Some(error) => refused(span, parameter, answer, *error),
                None => {
                    let found = value(span, parameter, answer)?;
                    parameter.compare(span, found, *raw)
                }
            }
        }
        PlannedJob::On => on(runner, span, slave),
        PlannedJob::Off => reach(runner, span, slave, READY, RAMP, "off", is_off),
        PlannedJob::QuickStop => {
            let done = |zsw| is_off(zsw) && zsw & STATE == 0x40;
            reach(
                runner,
                span,
                slave,
                QUICK_STOP,
                RAMP,
                "start-disabled",
                done,
            )
        }
        PlannedJob::Acknowledge => {
            reach(runner, span, slave, READY, PATIENCE, "seen", |_| true)?;
            let word = READY | stw::ACKNOWLEDGE;
            let done = |zsw| zsw & FAULT == 0;
            reach(runner, span, slave, word, PATIENCE, "without a fault", done)
        }
    }
}

fn is_off(zsw: u16) -> bool {
    zsw & OPERATION_ENABLED == 0
}

/// What is kept of a slave; as the header says, where no job has started it.
fn known<'r>(runner: &'r mut Runner<'_, Nordac>, slave: u8) -> &'r mut SlaveMemory {
    let setup = &runner.plan.setup;
    let ppo = setup.slaves.iter().find(|setup| setup.address == slave);
    let ppo = ppo.map(|setup| setup.ppo);
    let known = runner.own.slaves.entry(slave).or_default();
    known.ppo = known.ppo.or(ppo);
    known
}

impl SlaveMemory {
    /// Puts a word into what is sent next.
    fn put(&mut self, name: WordName, word: &PlannedWord) {
        let bytes: Vec<u8> = word.iter().map(|byte| byte.unwrap_or(0)).collect();
        match (place(name), <[u8; 2]>::try_from(&bytes[..])) {
            (Some(place), Ok(pair)) => self.sent.words[place] = u16::from_be_bytes(pair),
            _ => self.sent.pkw = bytes.try_into().map(Pkw::decode).unwrap_or_default(),
        }
    }
}

/// The place of a word among the process words; `None` for the parameter channel.
const fn place(name: WordName) -> Option<usize> {
    match name {
        WordName::Control => Some(0),
        WordName::Main => Some(1),
        WordName::Third => Some(2),
        WordName::Fourth => Some(3),
        WordName::Pkw => None,
    }
}

/// The bytes of a word of a reply.
fn bytes(image: &Image, name: WordName) -> Vec<u8> {
    match place(name) {
        Some(place) => image.words[place].to_be_bytes().to_vec(),
        None => image.pkw.encode().to_vec(),
    }
}

/// Compares the words of a reply.
fn judge(
    span: TextSpan,
    slave: u8,
    reply: &Image,
    expect: &[(WordName, PlannedWord)],
) -> Result<(), Stop> {
    let text = |bytes: &[Option<u8>]| {
        let digits = bytes.iter().map(|cell| match cell {
            Some(byte) => format!("{byte:02X}"),
            None => "xx".to_owned(),
        });
        digits.collect::<String>()
    };
    for (name, word) in expect {
        let found = bytes(reply, *name);
        let same = word
            .iter()
            .zip(&found)
            .all(|(wanted, byte)| wanted.is_none_or(|wanted| wanted == *byte));
        if !same {
            let found: Vec<_> = found.into_iter().map(Some).collect();
            let name = word_name(*name, false);
            let (found, wanted) = (text(&found), text(word));
            let message = format!("{name} of slave {slave} is {found} where {wanted} is expected");
            return Err(Stop::failed(span, message));
        }
    }
    Ok(())
}

/// Sends a request, and waits for its reply. The frame count bit changes with each request.
fn ask(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    function: FcFunction,
    service: Service,
    data: &[u8],
) -> Result<Telegram, Stop> {
    let known = known(runner, slave);
    known.sequence = known.sequence.next();
    let control = FrameControl::request(function, known.sequence);
    let saps = (service.sap(), service.master_sap());
    let pdu = Pdu::with_saps(slave, MASTER, control, saps.0, saps.1, data);
    let pdu = pdu.map_err(|bad| Stop::aborted(span, bad.to_string()))?;
    runner.settle();
    runner.nothing_unasked(span)?;
    runner.forget(0);
    let octets = Telegram::Pdu(pdu).encode().to_vec();
    let request = SentTelegram {
        octets,
        bad: Vec::new(),
    };
    let until = runner.transmit(0, &[request]) + runner.plan.deadline;
    let what = format!("slave {slave} to {}", service.name());
    reply(runner, span, until, &what)
}

/// The next telegram that is received.
fn reply(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    until: Instant,
    what: &str,
) -> Result<Telegram, Stop> {
    let mut octets = Buffer::new();
    loop {
        while let Some((at, octet)) = runner.take_next(0) {
            runner.line_before = runner.line_before.max(at);
            if let Some(error) = octet.error {
                let message = format!("the reply of {what} has a {error} error");
                return Err(Stop::failed(span, message));
            }
            let fits = octets.push(octet.byte);
            match Telegram::decode(&octets) {
                Decoded::Value { value, .. } => return Ok(value),
                Decoded::NeedMore if fits => {}
                Decoded::NeedMore => {
                    let message = format!("the reply of {what} does not end");
                    return Err(Stop::failed(span, message));
                }
                Decoded::Bad { reason, .. } => {
                    let message =
                        format!("the reply of {what} is no telegram ({octets}): {reason}");
                    return Err(Stop::failed(span, message));
                }
            }
        }
        if runner.link.now() >= until || !runner.wait(until) && !unread(runner) {
            let now = runner.link.now();
            let message = format!("no reply of {what} has come up to {now}");
            return Err(Stop::failed(span, message));
        }
    }
}

/// Whether an octet has come that nothing has taken.
fn unread(runner: &Runner<'_, Nordac>) -> bool {
    let mut ports = runner.ports.iter();
    ports.any(|port| port.next < port.received.len())
}

fn data(span: TextSpan, slave: u8, telegram: Telegram, what: &str) -> Result<Buffer, Stop> {
    let wrong = |found: String| {
        let message = format!("slave {slave} answers {what} with {found}");
        Err(Stop::failed(span, message))
    };
    let Telegram::Pdu(pdu) = telegram else {
        return wrong(format!("{}, where data are expected", telegram.encode()));
    };
    if (pdu.sa(), pdu.da()) != (slave, MASTER) {
        return wrong(format!("a telegram from {} to {}", pdu.sa(), pdu.da()));
    }
    match pdu.fc().status() {
        Some(FcStatus::DataLow | FcStatus::DataHigh) => {
            Ok(Buffer::of(pdu.data()).unwrap_or_default())
        }
        Some(status) => wrong(format!("{} (FC {:02X})", status.name(), pdu.fc().0)),
        None => wrong(format!("FC {:02X}, which is no reply", pdu.fc().0)),
    }
}

/// Parameters, configuration and diagnosis, up to data exchange.
fn start(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    ppo: PpoType,
    watchdog: Option<[u8; 2]>,
) -> Result<(), Stop> {
    *known(runner, slave) = SlaveMemory {
        ppo: Some(ppo),
        ..SlaveMemory::default()
    };
    let mut parameters = SetPrm::lock(IDENT);
    if let Some(factors) = watchdog {
        parameters.status |= SetPrm::WATCHDOG;
        parameters.watchdog = factors;
    }
    let parameters = parameters.encode().unwrap_or_default();
    let steps = [
        (Service::SetPrm, &*parameters),
        (Service::ChkCfg, ppo.cfg()),
    ];
    diagnose(runner, span, slave)?;
    for (service, octets) in steps {
        let reply = ask(runner, span, slave, FcFunction::SrdLow, service, octets)?;
        if reply != Telegram::Confirmation {
            let found = reply.encode();
            let name = service.name();
            let message = format!("slave {slave} answers {name} with {found}, E5 is expected");
            return Err(Stop::failed(span, message));
        }
    }
    let diagnosis = diagnose(runner, span, slave)?;
    if diagnosis.has(Diagnosis::NOT_READY) {
        let names: Vec<_> = diagnosis.names().collect();
        let names = names.join(", ");
        let message = format!("slave {slave} is not in data exchange: its diagnosis says {names}");
        return Err(Stop::failed(span, message));
    }
    Ok(())
}

fn diagnose(runner: &mut Runner<'_, Nordac>, span: TextSpan, slave: u8) -> Result<Diagnosis, Stop> {
    let service = Service::SlaveDiag;
    let reply = ask(runner, span, slave, FcFunction::SrdLow, service, &[])?;
    let octets = data(span, slave, reply, service.name())?;
    Diagnosis::decode(&octets).ok_or_else(|| {
        let message = format!("slave {slave} sends a diagnosis of a wrong form: {octets}");
        Stop::failed(span, message)
    })
}

/// One Data_Exchange with the words in force.
fn exchange(runner: &mut Runner<'_, Nordac>, span: TextSpan, slave: u8) -> Result<Image, Stop> {
    let known = known(runner, slave);
    let ppo = known.ppo.unwrap_or_default();
    let octets = known.sent.encode(ppo);
    let service = Service::DataExchange;
    let reply = ask(runner, span, slave, FcFunction::SrdHigh, service, &octets)?;
    let octets = data(span, slave, reply, service.name())?;
    Image::decode(ppo, &octets).ok_or_else(|| {
        let (found, wanted) = (octets.len(), ppo.octets());
        let message = format!(
            "slave {slave} sends {} of inputs, {ppo} has {wanted}",
            counted(found, "byte")
        );
        Stop::failed(span, message)
    })
}

/// Exchanges with a control word until the status word is as wanted. The reply to an exchange shows the drive as it was before.
fn reach(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    control: u16,
    patience: Span,
    wanted: &str,
    done: impl Fn(u16) -> bool,
) -> Result<(), Stop> {
    let known = known(runner, slave);
    known.sent.pkw = Pkw::default();
    known.sent.words[0] = control;
    exchange(runner, span, slave)?;
    let until = runner.link.now() + patience;
    loop {
        let zsw = exchange(runner, span, slave)?.first();
        if done(zsw) {
            return Ok(());
        }
        let now = runner.link.now();
        if now >= until {
            let message = format!(
                "slave {slave} is not {wanted} up to {now}: its status word is {zsw:04X} after STW {control:04X} \
                 (the bus controls it only where parameter 1621 is 2, 3, 5 or 6)"
            );
            return Err(Stop::failed(span, message));
        }
        runner.pass_until(now + POLL);
    }
}

/// Enables operation from any state without a fault.
fn on(runner: &mut Runner<'_, Nordac>, span: TextSpan, slave: u8) -> Result<(), Stop> {
    known(runner, slave).sent.pkw = Pkw::default();
    let zsw = exchange(runner, span, slave)?.first();
    if zsw & FAULT != 0 {
        let message = format!(
            "slave {slave} has a fault: its status word is {zsw:04X}; acknowledge it first"
        );
        return Err(Stop::failed(span, message));
    }
    if is_off(zsw) {
        let done = |zsw| zsw & STATE == READY_TO_START;
        reach(runner, span, slave, READY, PATIENCE, "ready to start", done)?;
    }
    let done = |zsw| !is_off(zsw);
    reach(runner, span, slave, ENABLED, PATIENCE, "enabled", done)
}

impl PlannedParameter {
    fn read(&self) -> Pkw {
        let task = self.known.map_or(Task::Request, Task::read);
        Pkw::of(task.ak(), self.number, self.ind(), 0)
    }

    fn change(&self, raw: u32) -> Pkw {
        let task = self.known.map_or(Task::ChangeWord, Task::change);
        Pkw::of(task.ak(), self.number, self.ind(), raw)
    }
}

/// Reads a parameter, and compares it with what it must be.
pub(super) fn read(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    parameter: PlannedParameter,
    wanted: Option<u32>,
) -> Result<(), Stop> {
    let answer = task(runner, span, slave, parameter.read())?;
    let found = value(span, &parameter, answer)?;
    wanted.map_or(Ok(()), |wanted| parameter.compare(span, found, wanted))
}

/// Sends a task until its answer has come. The words in force stay.
fn task(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    task: Pkw,
) -> Result<Answer, Stop> {
    let ppo = known(runner, slave).ppo.unwrap_or_default();
    if !ppo.has_pkw() {
        let message = format!("{ppo} has no parameter channel (NORDAC 3.1)");
        return Err(Stop::aborted(span, message));
    }
    // A task that equals the one before is not new. Without a task the answer is zero, and it stands until the next one has come.
    settled(runner, span, slave, Pkw::default(), |pkw| pkw.pke == 0)?;
    let last = settled(runner, span, slave, task, |pkw| pkw.pke != 0)?;
    known(runner, slave).sent.pkw = Pkw::default();
    let same = (last.number(), last.ind) == (task.number(), task.ind);
    match Answer::of(last).filter(|answer| same && *answer != Answer::None) {
        Some(answer) => Ok(answer),
        None => {
            let message = format!("slave {slave} answers the task {task} with {last}");
            Err(Stop::failed(span, message))
        }
    }
}

/// Exchanges with a task until the answer is as wanted, or until it would have come. Gives the last answer.
fn settled(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    task: Pkw,
    done: impl Fn(Pkw) -> bool,
) -> Result<Pkw, Stop> {
    known(runner, slave).sent.pkw = task;
    let mut last = Pkw::default();
    for _ in 0..MOST_EXCHANGES {
        last = exchange(runner, span, slave)?.pkw;
        if done(last) {
            break;
        }
    }
    Ok(last)
}

fn value(span: TextSpan, parameter: &PlannedParameter, answer: Answer) -> Result<u32, Stop> {
    match answer {
        Answer::Error(error) => {
            let (name, code, about) = (parameter.name(), error.code(), error.about());
            let message = format!("the task for {name} is refused with error {code}: {about}");
            Err(Stop::failed(span, message))
        }
        answer => Ok(answer.pwe()),
    }
}

fn refused(
    span: TextSpan,
    parameter: &PlannedParameter,
    answer: Answer,
    wanted: u16,
) -> Result<(), Stop> {
    let found = match answer {
        Answer::Error(error) if error.code() == wanted => return Ok(()),
        Answer::Error(error) => format!("error {} ({})", error.code(), error.about()),
        answer => parameter.shown(answer.pwe()),
    };
    let name = parameter.name();
    let message =
        format!("the task for {name} is answered with {found} where error {wanted} is expected");
    Err(Stop::failed(span, message))
}
