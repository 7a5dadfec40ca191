//! `drivebench fuzz power`: how many cases it takes to find each planned deviation, of a drive and of the master.

use crate::explore::masters;
use crate::explore::{Case, Finding, FuzzRun, OnSim, Pool, RingSetup, Swarm};
use harness_bench::command::exit::Exit;
use harness_bench::command::fuzz::case::{ExploredCase as _, settings};
use harness_bench::command::fuzz::power::PowerArguments;
use harness_bench::command::fuzz::tell;
use harness_bench::command::output::Output;
use harness_bench::counted::counted;
use harness_bench::explore::Planted;
use harness_bench::explore::{Bounds, ExploreError, Progress, Watcher};
use harness_bench::rig::buses::RigBuses;
use harness_bench::rig::find;
use harness_sim::novobus::deviation::{DEVIATIONS, Deviation, MASTER_DEVIATIONS};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

const FOUND_BY_SCENARIOS: &str = include_str!("../../../../../corpora/deviations.toml");

const MASTERS_FOUND_BY_SCENARIOS: &str = include_str!("../../../../../corpora/masters.toml");

/// How many drives the ring has; one of them deviates, another one with each seed.
const DRIVES: u8 = 3;

/// By which scenario a deviation is found, and by what means; see the head of the file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ByScenario {
    wire: Option<String>,
    faults: Option<String>,
    look: Option<String>,
}

impl ByScenario {
    fn words(&self) -> String {
        let means = [
            ("wire", &self.wire),
            ("faults", &self.faults),
            ("look", &self.look),
        ];
        let first = means
            .iter()
            .find_map(|(name, scenario)| Some((name, scenario.as_ref()?)));
        first.map_or_else(
            || "-".to_owned(),
            |(name, scenario)| format!("{name} {scenario}"),
        )
    }
}

/// What each deviation of a table took.
struct Table<'a> {
    arguments: &'a PowerArguments,
    /// How many deviations there are, and how many cases those took that were found.
    all: usize,
    within: Vec<u64>,
}

impl<'a> Table<'a> {
    fn begin(
        arguments: &'a PowerArguments,
        head: &str,
        output: &mut Output,
    ) -> std::io::Result<Self> {
        output.result(&format!("{head}\n"))?;
        Ok(Self {
            arguments,
            all: 0,
            within: Vec::new(),
        })
    }

    /// Shows what the seeds took, the least first; `by` says what else finds it.
    fn row(
        &mut self,
        name: &str,
        counts: &[Option<u64>],
        by: &str,
        output: &mut Output,
    ) -> std::io::Result<()> {
        self.all += 1;
        let median = counts.get(counts.len() / 2).copied().flatten();
        self.within.extend(median);
        let show = |count: Option<&Option<u64>>| match count {
            Some(Some(count)) => count.to_string(),
            _ => "-".to_owned(),
        };
        let mut line = String::new();
        let _infallible = write!(
            line,
            "{name:38} {:>7} ({:>6}, {:>6})  {by}",
            show(Some(&median)),
            show(counts.first()),
            show(counts.last()),
        );
        output.result(&format!("{}\n", line.trim_end()))
    }

    fn end(mut self, output: &mut Output) -> std::io::Result<()> {
        self.within.sort_unstable();
        let middle = self.within.get(self.within.len() / 2).copied().unwrap_or(0);
        output.result(&format!(
            "{} of {} found within {} (median of {}); the median of these is {middle}\n",
            self.within.len(),
            self.all,
            counted(self.arguments.cases, "case"),
            counted(self.arguments.seeds, "seed")
        ))
    }
}

/// Shows the tables.
pub(super) fn power(
    arguments: &PowerArguments,
    buses: &'static RigBuses,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let filter = arguments.filter.as_deref().unwrap_or_default();
    let wanted: Vec<_> = DEVIATIONS
        .all()
        .filter(|deviation| deviation.name.contains(filter))
        .collect();
    let masters: Vec<_> = MASTER_DEVIATIONS
        .all()
        .filter(|deviation| deviation.name.contains(filter) && !arguments.whole)
        .collect();
    if wanted.is_empty() && masters.is_empty() {
        output
            .complain("no deviation has this text in its name; `drivebench deviations` shows them");
        return Ok(Exit::NothingSelected);
    }
    if !wanted.is_empty() {
        // A test of the file keeps it whole.
        let by: BTreeMap<String, ByScenario> =
            toml::from_str(FOUND_BY_SCENARIOS).unwrap_or_default();
        let head = "drives: cases until found: median of the seeds (least, most), and by which means a scenario finds it";
        let mut table = Table::begin(arguments, head, output)?;
        for deviation in wanted {
            let counts = match counts(deviation, arguments, buses) {
                Ok(counts) => counts,
                Err(error) => return Ok(tell(&error, output)),
            };
            let by = by.get(deviation.name).map(ByScenario::words);
            table.row(
                deviation.name,
                &counts,
                &by.unwrap_or_else(|| "-".to_owned()),
                output,
            )?;
        }
        table.end(output)?;
    }
    if !masters.is_empty() {
        let by: BTreeMap<String, String> =
            toml::from_str(MASTERS_FOUND_BY_SCENARIOS).unwrap_or_default();
        let head = "masters: cases until found: median of the seeds (least, most), and the scenario that finds it";
        let mut table = Table::begin(arguments, head, output)?;
        for deviation in masters {
            let seeds = 1..=arguments.seeds;
            let mut counts: Vec<_> = seeds
                .map(|seed| {
                    let found = masters::cases_until_found(deviation, seed, arguments.cases);
                    found.map(|(cases, _)| cases)
                })
                .collect();
            counts.sort_unstable_by_key(|count| count.unwrap_or(u64::MAX));
            let by = by.get(deviation.name).map_or("-", String::as_str);
            table.row(deviation.name, &counts, by, output)?;
        }
        table.end(output)?;
    }
    Ok(Exit::Passed)
}

/// How many cases each seed takes, the least first; those that do not find it last.
fn counts(
    deviation: &Deviation,
    arguments: &PowerArguments,
    buses: &'static RigBuses,
) -> Result<Vec<Option<u64>>, ExploreError> {
    let name = format!("sim:{DRIVES}");
    let rig = find(&name, Path::new(""), buses)
        .map_err(|error| ExploreError::Usage(error.to_string()))?;
    let mut counts = Vec::new();
    for seed in 1..=arguments.seeds {
        let planted = Planted {
            ring: 0,
            drive: u8::try_from(seed % u64::from(DRIVES)).unwrap_or(0),
            name: deviation.name.to_owned(),
        };
        let setup = match arguments.whole {
            true => RingSetup::of_rig(&rig, &[], true).hides(&planted),
            false => RingSetup::of_rig(&rig, &[planted], false),
        };
        let mut target = OnSim::new(setup.clone());
        let scope = Case::scope(&rig, &setup, true);
        let about = settings::<Case>((&name, false), (&scope, setup), (seed, (1, 1)));
        let mut campaign = FuzzRun::new(about, scope);
        let bounds = Bounds {
            cases: arguments.cases,
            wire: None,
            findings: 1,
            every: u64::MAX,
        };
        campaign.run(&mut target, None, &bounds, &mut Silent)?;
        let cases = campaign.progress().cases;
        counts.push((campaign.findings().0 > 0).then_some(cases));
    }
    counts.sort_unstable_by_key(|count| count.unwrap_or(u64::MAX));
    Ok(counts)
}

/// Tells nothing.
struct Silent;

impl Watcher<Case> for Silent {
    fn round(&mut self, _: u64, _: &Swarm) {}
    fn found(&mut self, _: &Finding, _: &str) {}
    fn progress(&mut self, _: &Progress, _: &Pool) {}
}
