//! `drivebench info` and `top` on NORDAC inverters: identity, state, fault, frequency, and what guards the motor.

use super::bench::driver;
use super::control::send_off;
use super::read::{ReadCell, find};
use crate::driver::{Driver, Error};
use crate::live;
use crate::report::Reader;
use crate::rig::{Inverters, Session};
use crate::value::{Cell, ReplyWord, parameter};
use harness_bench::capture::Piece;
use harness_bench::capture::runs::TelegramRun;
use harness_bench::command::drives::DriveInfo;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::HeldDrives as _;
use harness_bench::command::line_top::LineTop;
use harness_bench::command::output::Output;
use harness_bench::top::{TopColumn, TopForm, TopRow};
use harness_proto::nordac::PpoType;
use harness_proto::nordac::words::State;

/// What is shown of a slave that has a parameter channel: the heading, and the parameter.
const SHOWN: [(&str, &str); 10] = [
    ("fault", "1800"),
    ("past fault", "1801"),
    ("frequency", "1813"),
    ("maximum", "1205"),
    ("heat sink", "1825"),
    ("link voltage", "1825.2"),
    ("interface", "1621"),
    ("bus time-out", "1625"),
    ("software", "1812"),
    ("hours", "1808"),
];

struct SlaveReading {
    slave: u8,
    ppo: PpoType,
    /// The process words, and the parameters.
    words: Vec<ReadCell>,
    parameters: Vec<(&'static str, ReadCell)>,
}

impl SlaveReading {
    /// What is shown, each with its heading and where it stands.
    fn rows(&self) -> Vec<[String; 3]> {
        let mut rows = vec![[
            "PPO type".to_owned(),
            self.ppo.to_string(),
            "1622".to_owned(),
        ]];
        let names = ["status", "actual value"];
        for (name, found) in names.into_iter().zip(&self.words) {
            rows.push([name.to_owned(), found.words(), found.cell.name()]);
        }
        for (name, found) in &self.parameters {
            rows.push([(*name).to_owned(), value(found), found.cell.name()]);
        }
        rows
    }

    fn of(&self, heading: &str) -> String {
        let row = self.parameters.iter().find(|(name, _)| *name == heading);
        row.map_or_else(|| "-".to_owned(), |(_, found)| value(found))
    }
}

/// A value in words; 0 is no fault, and no time-out.
fn value(found: &ReadCell) -> String {
    match (found.cell, found.number) {
        (Cell::Parameter(parameter), 0) if matches!(parameter.parameter.number, 1800..=1805) => {
            "none".to_owned()
        }
        (Cell::Parameter(parameter), 0) if parameter.parameter.number == 1625 => {
            "none: nothing stops the motor if the master fails".to_owned()
        }
        (Cell::Parameter(parameter), 0) if parameter.parameter.number == 1621 => {
            "0: local, the bus does not control it".to_owned()
        }
        _ => found.words(),
    }
}

/// Reads the process words of a slave, and some of what is shown of its parameters.
fn look(
    driver: &mut Driver<'_>,
    slave: u8,
    wanted: impl Fn(&str) -> bool,
) -> Result<SlaveReading, Error> {
    let ppo = driver.join(slave)?;
    let words = [ReplyWord::Status, ReplyWord::Actual].map(Cell::Word);
    let words = find(driver, slave, &words)?;
    let mut parameters = Vec::new();
    if ppo.has_pkw() {
        for (name, text) in SHOWN.into_iter().filter(|(name, _)| wanted(name)) {
            let Ok(named) = parameter(text) else {
                continue;
            };
            let found = find(driver, slave, &[Cell::Parameter(named)])?;
            parameters.extend(found.into_iter().map(|found| (name, found)));
        }
    }
    Ok(SlaveReading {
        slave,
        ppo,
        words,
        parameters,
    })
}

/// What is shown of slaves. One that does not answer is reported, and the others are listed.
pub(super) fn info(
    session: &mut Session,
    slaves: &[u8],
    output: &mut Output,
) -> Result<(Vec<DriveInfo>, Exit), Failure> {
    let mut driver = driver(session);
    let (mut all, mut exit) = (Vec::new(), Exit::Passed);
    for &slave in slaves {
        match look(&mut driver, slave, |_| true) {
            Ok(seen) => all.push((slave, seen.rows())),
            Err(error @ Error::Link(_)) => return Err(error.into()),
            Err(error) => exit = exit.max(Failure::from(error).tell(output)),
        }
    }
    Ok((all, exit))
}

/// The table of all slaves, a row each.
pub(super) fn top(session: &Session) -> LineTop<Inverters> {
    let slaves = session.drives().listed();
    let mut reader = Reader::default();
    LineTop {
        what: "inverters on PROFIBUS",
        form: &FORM,
        traffic: &["from", "telegrams", "telegrams/s", "damaged"],
        picture: live::picture_of_port(&slaves),
        read: |session, slave| {
            let shown = |name: &str| FORM.columns.iter().any(|column| column.head == name);
            Ok(row(&look(&mut driver(session), slave, shown)?))
        },
        stop: send_off,
        rows: Box::new(move |heard| {
            let run = |piece| match piece {
                Piece::Telegram(from, octets) => Some(TelegramRun { from, octets }),
                _ => None,
            };
            let runs: Vec<_> = heard.into_iter().filter_map(run).collect();
            let row = |run| (live::at_port(run, &slaves, &mut reader), run);
            live::without_tokens(runs.iter().map(row))
        }),
    }
}

/// The table of `top`. The states are those of NORDAC 3.3.
static FORM: TopForm = TopForm {
    drive: "slave",
    columns: &[
        TopColumn::words("slave", 5),
        TopColumn::words("PPO", 4),
        TopColumn::words("fault", 5),
        TopColumn::words("frequency", 9),
        TopColumn::words("HIW", 7),
        TopColumn::words("heat sink", 9),
        TopColumn::words("status", 0),
    ],
    give_way: &[1, 5, 4, 3],
    states: &[
        "not read",
        "no state of the manual",
        "fault",
        "fault reaction active",
        "quick stop active",
        "not ready to start",
        "start-disable",
        "ready to start",
        "ready for operation",
        "operation enabled",
    ],
};

fn row(seen: &SlaveReading) -> TopRow {
    let mut words = seen.words.iter().map(ReadCell::words);
    let (status, actual) = (words.next(), words.next());
    let mut numbers = seen.words.iter().map(|word| word.number as u16);
    let (zsw, hiw) = (numbers.next().unwrap_or(0), numbers.next());
    let state = State::of_zsw(zsw);
    let fault = seen.parameters.iter().find(|(name, _)| *name == "fault");
    let in_error = matches!(state, Some(State::Fault | State::FaultReaction));
    TopRow {
        state: FORM.state(state.map_or("no state of the manual", State::name)),
        in_error,
        speed: hiw.map(|speed| f64::from(speed.cast_signed())),
        error: fault
            .and_then(|(_, found)| u32::try_from(found.number).ok())
            .filter(|_| in_error),
        cells: vec![
            seen.slave.to_string(),
            seen.ppo.to_string(),
            seen.of("fault"),
            seen.of("frequency"),
            actual.unwrap_or_default(),
            seen.of("heat sink"),
            status.unwrap_or_default(),
        ],
    }
}
