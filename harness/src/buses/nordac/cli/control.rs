//! `drivebench start`, `exchange`, `on`, `off`, `quick-stop` and `acknowledge` on NORDAC inverters, and their names on other buses: `go`,
//! `stop`, `block` and `delete-error`.

use super::args::{AcknowledgeArguments, ExchangeArguments, OnArguments};
use super::bench::driver;
use crate::buses::commands::{SelectArguments, Use};
use crate::buses::nordac::driver::{Driver, Error, MASTER, Reached};
use crate::buses::nordac::rig::{Inverters, Session};
use crate::buses::nordac::value::{Setpoint, Step, percentage, status, steps};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::cli::port_bench::{on as with, select, single};
use crate::rig::Rig;
use crate::rig::port_session::PortDrives as _;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Image, ParameterRef};

/// The maximum frequency of set 1, and the bus time-out.
const MAXIMUM: &str = "1205";
const TIME_OUT: &str = "1625";

/// Brings slaves into the exchange.
pub(super) fn start(
    rig: &Rig,
    arguments: &SelectArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::look("start");
    with(rig, &arguments.rig, as_what, output, |session, output| {
        each(session, &arguments.drives, output, |driver, slave| {
            let started = driver.start(slave, None)?;
            let diagnosis = started.diagnosis.map(|own| own.encode().to_string());
            let image = started.inputs;
            Ok(format!(
                "{} ({} octets), diagnosis {}, master {MASTER}, {}",
                started.ppo,
                started.ppo.octets(),
                diagnosis.unwrap_or_default(),
                reply(&image)
            ))
        })
    })
}

/// Exchanges words with a slave, step by step.
pub(super) fn exchange(
    rig: &Rig,
    arguments: &ExchangeArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let steps = steps(&arguments.words).map_err(Failure::refused)?;
    let as_what = Use {
        purpose: "exchange",
        moves: arguments.leave,
        holds: false,
    };
    with(rig, &arguments.rig, as_what, output, |session, output| {
        let slave = single(&arguments.drive, session)?;
        let mut driver = driver(session);
        driver.start(slave, None)?;
        let hertz = |own: &Step| matches!(own.setpoint, Some(Setpoint::Tenths(_)));
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
        for (place, words) in all.into_iter().enumerate() {
            let mut image = driver.exchange(slave, words)?;
            if place == last && arguments.length.units() > 0 {
                driver.run(arguments.length)?;
                image = driver.inputs(slave)?;
            }
            let [control, setpoint, third, fourth] = words;
            let mut sent = format!("STW {control:04X} HSW {setpoint:04X}");
            if third != 0 || fourth != 0 {
                sent.push_str(&format!(" PZD3 {third:04X} PZD4 {fourth:04X}"));
            }
            output.result(&format!("slave {slave}: {sent} -> {}\n", reply(&image)))?;
        }
        Ok(Exit::Passed)
    })
}

/// The words of a step.
fn next(before: [u16; 4], step: &Step, slave: u8, maximum: i64) -> Result<[u16; 4], Error> {
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
pub(super) fn on(rig: &Rig, arguments: &OnArguments, output: &mut Output) -> Result<Exit, Failure> {
    let as_what = Use {
        purpose: "on",
        moves: arguments.leave,
        holds: false,
    };
    let select = &arguments.select;
    with(rig, &select.rig, as_what, output, |session, output| {
        let slaves = crate::cli::port_bench::select(&select.drives, session)?;
        refuse_motion(arguments.leave, "on", &slaves)?;
        let mut driver = driver(session);
        let mut orders = Vec::new();
        let in_hertz = matches!(arguments.setpoint, Setpoint::Tenths(_));
        for slave in &slaves {
            driver.start(*slave, None)?;
            let maximum = supervised(&mut driver, *slave, in_hertz)?;
            let setpoint = word(arguments.setpoint, *slave, maximum)?;
            refuse_denied(&driver, *slave, [stw::START, setpoint, 0, 0])?;
            orders.push((*slave, setpoint));
        }
        output.say(&format!(
            "on: {}: motors may turn\n",
            Inverters::named(&slaves)
        ));
        for (slave, setpoint) in &orders {
            let reached = driver.on(*slave, *setpoint)?;
            output.result(&format!("slave {slave}: {}\n", sent(&reached)))?;
        }
        driver.run(arguments.length)?;
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
pub(super) type Stop = fn(&mut Driver<'_>, u8) -> Result<Reached, Error>;

/// Stops motors; needs no permission.
pub(super) fn stop(
    rig: &Rig,
    (purpose, call): (&'static str, Stop),
    arguments: &SelectArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use {
        moves: true,
        ..Use::look(purpose)
    };
    with(rig, &arguments.rig, as_what, output, |session, output| {
        each(session, &arguments.drives, output, |driver, slave| {
            driver.start(slave, None)?;
            call(driver, slave).map(|reached| sent(&reached))
        })
    })
}

/// Acknowledges faults.
pub(super) fn acknowledge(
    rig: &Rig,
    arguments: &AcknowledgeArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use {
        moves: arguments.leave,
        ..Use::look("acknowledge")
    };
    let select = &arguments.select;
    with(rig, &select.rig, as_what, output, |session, output| {
        let slaves = crate::cli::port_bench::select(&select.drives, session)?;
        let mut driver = driver(session);
        for slave in &slaves {
            driver.start(*slave, None)?;
            refuse_denied(&driver, *slave, [stw::SAFE | stw::ACKNOWLEDGE, 0, 0, 0])?;
        }
        drop(driver);
        each(session, &select.drives, output, |driver, slave| {
            driver.start(slave, None)?;
            let (fault, reached) = driver.acknowledge(slave)?;
            let before = match fault {
                Some(0) => "it had no fault".to_owned(),
                Some(number) => crate::buses::nordac::driver::fault_name(number).map_or_else(
                    || format!("fault {number} acknowledged"),
                    |name| format!("fault {number} ({name}) acknowledged"),
                ),
                None => "its fault is acknowledged".to_owned(),
            };
            Ok(format!("{before}; {}", sent(&reached)))
        })
    })
}

/// Does it to every slave, and shows what came of it. A slave that fails does not keep the others from it.
fn each(
    session: &mut Session,
    wanted: &[crate::buses::commands::Axes],
    output: &mut Output,
    call: impl Fn(&mut Driver<'_>, u8) -> Result<String, Error>,
) -> Result<Exit, Failure> {
    let slaves = select(wanted, session)?;
    let mut driver = driver(session);
    let mut exit = Exit::Passed;
    for slave in slaves {
        match call(&mut driver, slave) {
            Ok(done) => output.result(&format!("slave {slave}: {done}\n"))?,
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

/// Refuses to let motors turn without permission.
fn refuse_motion(allowed: bool, command: &str, slaves: &[u8]) -> Result<(), Failure> {
    match allowed {
        true => Ok(()),
        false => Err(Failure::refused(format!(
            "{command}: {}: motors may turn; nothing was done, add --move to allow it",
            Inverters::named(slaves)
        ))),
    }
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
fn sent(reached: &Reached) -> String {
    let words: Vec<_> = reached.words().map(|own| format!("{own:04X}")).collect();
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
