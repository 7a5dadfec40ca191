//! `drivebench start`, `exchange`, `on`, `off`, `quick-stop` and `acknowledge` on NORDAC inverters, and what other buses have too: `stop`,
//! `block`, and `go` in a session.

use super::bench::driver;
use crate::driver::{Driver, Error, MASTER, ReachedState};
use crate::rig::{Inverters, Session};
use crate::value::{ExchangeStep, percentage, status, steps};
use harness_bench::command::cyclic::{
    AcknowledgeArguments, ExchangeArguments, OnArguments, Setpoint, StartArguments, StayArguments,
};
use harness_bench::command::drive::{MoveArguments, OutputForm, SelectArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::HeldDrives as _;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on as with, select, single};
use harness_bench::command::rig_name::Use;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Image, ParameterRef};
use harness_proto::time::Span;
use serde_json::{Value, json};

/// The maximum frequency of set 1, and the bus time-out.
const MAXIMUM: &str = "1205";
const TIME_OUT: &str = "1625";

/// As long as a rig may be held, in seconds.
const YEAR: u64 = 365 * 24 * 3_600;

fn switch_on(
    driver: &mut Driver<'_>,
    command: &str,
    slaves: &[u8],
    setpoint: Setpoint,
    output: &mut Output,
) -> Result<(), Failure> {
    let mut orders = Vec::new();
    let in_hertz = matches!(setpoint, Setpoint::Tenths(_));
    for slave in slaves {
        driver.join(*slave)?;
        let maximum = supervised(driver, *slave, in_hertz)?;
        let setpoint = word(setpoint, *slave, maximum)?;
        refuse_denied(driver, *slave, [stw::START, setpoint, 0, 0])?;
        orders.push((*slave, setpoint));
    }
    let named = Inverters::named(slaves);
    output.say(&format!("{command}: {named}: motors may turn\n"));
    for (slave, setpoint) in orders {
        let reached = driver.on(slave, setpoint)?;
        output.result(&format!("slave {slave}: {}\n", sent(&reached)))?;
    }
    Ok(())
}

/// Switches slaves on in a session, which goes on exchanging their words: the setpoint is 0 until `exchange` gives another one.
pub(super) fn go(
    bench: PortBench<'_, Inverters>,
    arguments: &MoveArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    if let PortBench::Rig(_) = bench {
        return Err(Failure::refused(
            "an inverter is switched on as long as words are exchanged: use `on` with --for or --hold; `go` is for a session (`shell`)",
        ));
    }
    let as_what = Use::new("go", arguments.leave, false);
    let select = &arguments.select;
    with(bench, &select.rig, as_what, output, |session, output| {
        let slaves = harness_bench::command::port_bench::select(&select.drives, session)?;
        refuse_motion(arguments.leave, "go", &slaves)?;
        let mut driver = driver(session);
        switch_on(&mut driver, "go", &slaves, Setpoint::Raw(0), output)?;
        Ok(Exit::Passed)
    })
}

/// Brings slaves into the exchange.
pub(super) fn start(
    bench: PortBench<'_, Inverters>,
    arguments: &StartArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::look("start");
    let select = &arguments.select;
    with(bench, &select.rig, as_what, output, |session, output| {
        let mut objects = Vec::new();
        let exit = each(session, &select.drives, output, |driver, slave| {
            let started = driver.start(slave, None)?;
            let diagnosis = started.diagnosis.map(|data| data.encode().to_string());
            let diagnosis = diagnosis.unwrap_or_default();
            let (ppo, octets) = (started.ppo, started.ppo.octets());
            let image = started.inputs;
            objects.push(json!({
                "slave": slave, "ppo": ppo.number(), "octets": octets, "diagnosis": diagnosis, "master": MASTER, "reply": object(&image),
            }));
            let text = format!(
                "{ppo} ({octets} octets), diagnosis {diagnosis}, master {MASTER}, {}",
                reply(&image)
            );
            Ok((arguments.format == OutputForm::Text).then_some(text))
        })?;
        if arguments.format == OutputForm::Json {
            output.result(&format!("{}\n", json!({"schema": 1, "slaves": objects})))?;
        }
        Ok(exit)
    })
}

/// Exchanges words with a slave, step by step.
pub(super) fn exchange(
    bench: PortBench<'_, Inverters>,
    arguments: &ExchangeArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let steps = steps(&arguments.words).map_err(Failure::refused)?;
    let as_what = Use::new("exchange", arguments.leave, false);
    with(bench, &arguments.rig, as_what, output, |session, output| {
        let slave = single(&arguments.drive, session)?;
        let longest = longest_hold(session);
        let mut driver = driver(session);
        driver.join(slave)?;
        let hertz = |step: &ExchangeStep| matches!(step.setpoint, Some(Setpoint::Tenths(_)));
        let maximum = supervised(&mut driver, slave, steps.iter().any(hertz))?;
        let mut words = [0; 4];
        let mut all = Vec::new();
        for step in &steps {
            words = next(words, step, slave, maximum)?;
            refuse_denied(&driver, slave, words)?;
            all.push(words);
        }
        if all.iter().any(|words| enables(words[0])) {
            refuse_motion(arguments.leave, "exchange", &[slave])?;
        }
        let last = all.len() - 1;
        let mut objects = Vec::new();
        for (place, words) in all.into_iter().enumerate() {
            let mut image = driver.exchange(slave, words)?;
            if place == last && arguments.stay.length > Span::ZERO {
                driver.run(arguments.stay.length)?;
                image = driver.inputs(slave)?;
            }
            let [control, setpoint, third, fourth] = words;
            objects.push(json!({
                "stw": control, "hsw": setpoint, "pzd3": third, "pzd4": fourth, "reply": object(&image),
            }));
            if arguments.format == OutputForm::Json {
                continue;
            }
            let mut sent = format!("STW {control:04X} HSW {setpoint:04X}");
            if third != 0 || fourth != 0 {
                sent.push_str(&format!(" PZD3 {third:04X} PZD4 {fourth:04X}"));
            }
            output.result(&format!("slave {slave}: {sent} -> {}\n", reply(&image)))?;
        }
        if arguments.format == OutputForm::Json {
            let all = json!({"schema": 1, "slave": slave, "exchanges": objects});
            output.result(&format!("{all}\n"))?;
        }
        hold(&mut driver, arguments.stay, longest, output)?;
        Ok(Exit::Passed)
    })
}

/// How long words of a rig may be held where its `max_run` does not end it before; `None` where its time is virtual, and nothing is there behind
/// the command.
fn longest_hold(session: &Session) -> Option<Span> {
    let simulated = session.rig().is_simulated();
    (!simulated).then(|| Span::from_millis(YEAR * 1_000))
}

/// Goes on exchanging the last words of all slaves until the user ends it, which is an error of the line, or the time is over.
fn hold(
    driver: &mut Driver<'_>,
    stay: StayArguments,
    longest: Option<Span>,
    output: &mut Output,
) -> Result<(), Failure> {
    let Some(longest) = longest.filter(|_| stay.hold) else {
        return Ok(());
    };
    output.say(
        "held: the last words are exchanged until Ctrl-C, which takes the rig to its safe state\n",
    );
    Ok(driver.run(longest)?)
}

/// The words of a step.
fn next(before: [u16; 4], step: &ExchangeStep, slave: u8, maximum: i64) -> Result<[u16; 4], Error> {
    let [control, setpoint, third, fourth] = before;
    let setpoint = match step.setpoint {
        None => setpoint,
        Some(given) => word(given, slave, maximum)?,
    };
    Ok([
        step.control.unwrap_or(control),
        setpoint,
        step.third.unwrap_or(third),
        step.fourth.unwrap_or(fourth),
    ])
}

fn word(given: Setpoint, slave: u8, maximum: i64) -> Result<u16, Error> {
    given.word(maximum).ok_or_else(|| {
        let shown = |tenths: i64| format!("{:.1}", tenths as f64 / 10.0);
        let hertz = match given {
            Setpoint::Tenths(tenths) => shown(tenths.into()),
            Setpoint::Raw(_) => String::new(),
        };
        Error::Setpoint {
            slave,
            hertz,
            maximum: shown(maximum) + " Hz",
        }
    })
}

/// Switches motors on for a time.
pub(super) fn on(
    bench: PortBench<'_, Inverters>,
    arguments: &OnArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::new("on", arguments.leave, false);
    let select = &arguments.select;
    with(bench, &select.rig, as_what, output, |session, output| {
        let slaves = harness_bench::command::port_bench::select(&select.drives, session)?;
        refuse_motion(arguments.leave, "on", &slaves)?;
        let longest = longest_hold(session);
        let mut driver = driver(session);
        switch_on(&mut driver, "on", &slaves, arguments.setpoint, output)?;
        hold(&mut driver, arguments.stay, longest, output)?;
        driver.run(arguments.stay.length)?;
        for slave in &slaves {
            let image = driver.inputs(*slave)?;
            output.result(&format!("slave {slave}: {}\n", reply(&image)))?;
        }
        for slave in &slaves {
            let reached = driver.off(*slave)?;
            output.result(&format!("slave {slave}: {}\n", sent(&reached)))?;
        }
        Ok(Exit::Passed)
    })
}

/// A call that stops a motor.
pub(super) type Stop = fn(&mut Driver<'_>, u8) -> Result<ReachedState, Error>;

/// Stops motors; needs no permission.
pub(super) fn stop(
    bench: PortBench<'_, Inverters>,
    (purpose, call): (&'static str, Stop),
    arguments: &SelectArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::new(purpose, true, true);
    with(bench, &arguments.rig, as_what, output, |session, output| {
        each(session, &arguments.drives, output, |driver, slave| {
            driver.join(slave)?;
            call(driver, slave).map(|reached| Some(sent(&reached)))
        })
    })
}

pub(super) fn acknowledge(
    bench: PortBench<'_, Inverters>,
    arguments: &AcknowledgeArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::new("acknowledge", arguments.leave, true);
    let select = &arguments.select;
    with(bench, &select.rig, as_what, output, |session, output| {
        let slaves = harness_bench::command::port_bench::select(&select.drives, session)?;
        let mut driver = driver(session);
        for slave in &slaves {
            driver.join(*slave)?;
            refuse_denied(&driver, *slave, [stw::SAFE | stw::ACKNOWLEDGE, 0, 0, 0])?;
        }
        drop(driver);
        each(session, &select.drives, output, |driver, slave| {
            driver.join(slave)?;
            let (fault, reached) = driver.acknowledge(slave)?;
            let before = match fault {
                Some(0) => "it had no fault".to_owned(),
                Some(number) => crate::driver::fault_name(number).map_or_else(
                    || format!("fault {number} acknowledged"),
                    |name| format!("fault {number} ({name}) acknowledged"),
                ),
                None => "its fault is acknowledged".to_owned(),
            };
            Ok(Some(format!("{before}; {}", sent(&reached))))
        })
    })
}

/// Does it to every slave, and shows what came of it as far as there is a text. A slave that fails does not keep the others from it.
fn each(
    session: &mut Session,
    wanted: &[harness_bench::command::axes::Axes],
    output: &mut Output,
    mut call: impl FnMut(&mut Driver<'_>, u8) -> Result<Option<String>, Error>,
) -> Result<Exit, Failure> {
    let slaves = select(wanted, session)?;
    let mut driver = driver(session);
    let mut exit = Exit::Passed;
    for slave in slaves {
        match call(&mut driver, slave) {
            Ok(Some(done)) => output.result(&format!("slave {slave}: {done}\n"))?,
            Ok(None) => {}
            Err(error @ Error::Link(_)) => return Err(error.into()),
            Err(error) => exit = exit.max(Failure::from(error).tell(output)),
        }
    }
    Ok(exit)
}

/// Reads what guards a motor, so that the gate knows it too: the bus time-out and the maximum frequency of a slave that has a parameter
/// channel. Returns the maximum frequency in 0.1 Hz; `needed` where a setpoint is in Hz.
fn supervised(driver: &mut Driver<'_>, slave: u8, needed: bool) -> Result<i64, Error> {
    let mut read = |text: &str| {
        let parameter = ParameterRef::parse(text);
        parameter.map_or(Ok(0), |parameter| driver.read(slave, &parameter))
    };
    match read(TIME_OUT).and_then(|_| read(MAXIMUM)) {
        Err(Error::NoChannel { .. }) if !needed => Ok(0),
        other => other,
    }
}

fn refuse_motion(allowed: bool, command: &str, slaves: &[u8]) -> Result<(), Failure> {
    match allowed {
        true => Ok(()),
        false => Err(Failure::refused(format!(
            "{command}: {}: motors may turn; nothing was done, add --move to allow it",
            Inverters::named(slaves)
        ))),
    }
}

/// Sends OFF1 to a slave, without waiting until its motor stands (NORDAC 3.3).
pub(super) fn send_off(session: &mut Session, slave: u8) -> Result<String, Failure> {
    let words = [stw::READY, 0, 0, 0];
    let mut driver = driver(session);
    driver.join(slave)?;
    refuse_denied(&driver, slave, words)?;
    let _before_it_stands = driver.exchange(slave, words)?;
    Ok(format!(
        "STW {:04X}, OFF1: it stops on its ramp",
        stw::READY
    ))
}

/// Refuses words that the line denies, before the first is sent.
fn refuse_denied(driver: &Driver<'_>, slave: u8, words: [u16; 4]) -> Result<(), Failure> {
    let mut image = Image::default();
    image.words[..4].copy_from_slice(&words);
    match driver.denied(slave, &image)? {
        None => Ok(()),
        Some(why) => Err(Failure::refused(format!("nothing was done: {why}"))),
    }
}

/// Whether a control word can switch an output on (guard class "motion").
const fn enables(word: u16) -> bool {
    let needed = stw::VALID | stw::OPERATE;
    word & needed == needed
}

/// The control words that led to a state, and the reply that shows it.
fn sent(reached: &ReachedState) -> String {
    let words: Vec<_> = reached.words().map(|word| format!("{word:04X}")).collect();
    format!("STW {} -> {}", words.join(", "), reply(&reached.inputs))
}

/// What a reply shows.
fn reply(image: &Image) -> String {
    let (zsw, actual) = (image.first(), image.main());
    let mut text = format!(
        "ZSW {zsw:04X} ({}), HIW {actual:04X} ({})",
        status(zsw),
        percentage(actual)
    );
    if image.fourth() != 0 {
        text.push_str(&format!(", PZD4 {:04X}", image.fourth()));
    }
    text
}

/// A reply for tools: words as numbers, and their meaning.
fn object(image: &Image) -> Value {
    let [zsw, hiw, third, fourth, ..] = image.words;
    json!({
        "zsw": zsw, "state": status(zsw), "hiw": hiw, "actual": percentage(hiw), "pzd3": third, "pzd4": fourth,
    })
}
