//! Trials of the engine on a bus, for the tests of its rooms: right drives are never accused, wrong ones are found, shrunk and kept as
//! scenarios.

use super::{LineBus, LineRig, LineScope, LineSetup, LineTalk, OnAdapter, OnLine, SessionOf};
use crate::explore::smaller::{Shrinkable as _, Subject, asked, shrink};
use crate::explore::{
    Bounds, Differing as _, Finding, FuzzCase, FuzzRun, FuzzSettings, Planted, Pool, Progress,
    RunEnd, Spiced, Swarm, Target as _, Watcher,
};
use crate::rig::{Rig, UseOptions};
use crate::scenario::language::Language;
use crate::scenario::run::AtMismatch;
use crate::scenario::settled::{BenchSize, settle};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::time::Duration;

struct Findings<B: LineBus>(Vec<Finding<LineTalk<B>>>);

impl<B: LineBus> Watcher<LineTalk<B>> for Findings<B> {
    fn round(&mut self, _: u64, _: &Swarm<B::Spice>) {}
    fn found(&mut self, finding: &Finding<LineTalk<B>>, _: &str) {
        self.0.push(finding.clone());
    }
    fn progress(&mut self, _: &Progress, _: &Pool<LineTalk<B>>) {}
}

/// Drives that are explored.
#[derive(Clone, Debug)]
pub struct EngineTrial<B: LineBus> {
    /// Their header lines.
    pub header: Vec<String>,
    /// The drive in which deviations are planted.
    pub drive: u8,
    /// The same as conversations address it.
    pub station: B::Station,
}

/// What a run has found.
pub struct Exploration<B: LineBus> {
    pub findings: Vec<Finding<LineTalk<B>>>,
    pub end: RunEnd,
    pub undecided: u64,
}

impl<B: LineBus> EngineTrial<B> {
    /// Explores for a number of seconds of bus time, up to a number of findings.
    pub fn explored(
        &self,
        line: &[String],
        deviates: Option<&str>,
        seed: u64,
        seconds: u64,
        findings: usize,
    ) -> Exploration<B> {
        let deviates = deviates.map(|name| Planted {
            ring: 0,
            drive: self.drive,
            name: name.to_owned(),
        });
        let header = [&self.header, line].concat();
        let setup = LineSetup::new::<B>(header, deviates.into_iter().collect());
        let mut target = OnLine::<B>::new(setup.under_test::<B>().expect("a header"));
        let scope = LineScope::<B> {
            drives: vec![self.station],
            spices: B::Spice::ALL.iter().map(|(_, spice)| *spice).collect(),
        };
        let about = settings::<B>(setup, seed);
        let bounds = bounds(seconds, findings);
        let mut found = Findings(Vec::new());
        let mut run = FuzzRun::new(about, scope);
        let end = run.run(&mut target, None, &bounds, &mut found);
        Exploration {
            findings: found.0,
            end: end.expect("no error"),
            undecided: target.undecided(),
        }
    }

    /// Explores right drives: nothing is found, and every case is judged.
    pub fn accuses_nobody(&self, line: &[String], seed: u64, seconds: u64) {
        let found = self.explored(line, None, seed, seconds, 1);
        let findings = found.findings.iter();
        let about: Vec<_> = findings.map(|finding| &finding.difference).collect();
        assert_eq!((about, found.end), (Vec::new(), RunEnd::Wire), "{line:?}");
        assert_eq!(found.undecided, 0, "{line:?}");
    }

    /// Explores right drives of a simulated rig with this header line like drives behind an adapter: nothing is found, and something is
    /// played.
    pub fn accuses_nobody_behind_a_port(mut rig: Rig, line: &[String], seconds: u64)
    where
        B: LineRig,
    {
        let sim = rig.file.sim.as_mut().expect("a simulated rig");
        sim.setup.extend_from_slice(line);
        // The slowest right drive replies after 137 ms.
        let port = rig.file.port.as_mut().expect("a port");
        port.first.patience.0 = Duration::from_millis(200);
        let options = UseOptions {
            allow_motion: true,
            ..UseOptions::default()
        };
        let mut session = SessionOf::<B>::open(&rig, &options).expect("drives");
        let drives = B::stations(&rig, Some(&session));
        let all = B::Spice::ALL.iter().map(|(_, spice)| *spice);
        let spices = all
            .filter(|spice| B::lacks(&rig, true, *spice).is_none())
            .collect();
        let setup = LineSetup::of_rig::<B>(&rig, &drives, Vec::new());
        let model = setup.under_test::<B>().expect("a header");
        let mut target = OnAdapter::<B>::new(&mut session, model).expect("drives");
        let scope = LineScope { drives, spices };
        let mut found = Findings(Vec::new());
        let about = settings::<B>(setup, 1);
        let mut run = FuzzRun::new(about, scope);
        let bounds = bounds(seconds, 1);
        let end = run.run(&mut target, None, &bounds, &mut found);
        let about: Vec<_> = found.0.iter().map(|finding| &finding.difference).collect();
        assert_eq!(
            (about, end.expect("a rig")),
            (Vec::new(), RunEnd::Wire),
            "{line:?}"
        );
        let progress = run.progress();
        assert!(
            progress.cases > 2 * progress.not_sent,
            "{line:?}: {progress:?}"
        );
        // What is stored is said, with the command that stores what was there before.
        let mut left = target.restore();
        left.retain(|sentence| !sentence.contains("EEPROM"));
        assert_eq!(left, [""; 0], "{line:?}");
        drop(target);
        assert!(!session.close(false).is_unsafe(), "{line:?}");
    }

    /// Explores drives with these deviations for ten minutes of bus time: those that were not found. What is found is made small and is a
    /// scenario.
    pub fn missed(&self, some: impl Iterator<Item = &'static str>) -> Vec<&'static str>
    where
        B: Language,
    {
        let mut missed = Vec::new();
        for name in some {
            let found = self.explored(&[], Some(name), 1, 600, 1).findings;
            let Some(finding) = found.first() else {
                missed.push(name);
                continue;
            };
            let under_test = finding.setup.under_test::<B>().expect("a header");
            let mut target = OnLine::<B>::new(under_test);
            let mut ask = |subject: &Subject<_>| asked(subject, &mut target);
            let difference = finding.difference.clone();
            let small = shrink(finding.subject(), difference, 200, &mut ask).expect("a header");
            let small = finding.shrunk(small);
            assert!(small.case.measure() <= finding.case.measure(), "{name}");
            let (shown, kind) = (&small.difference, &finding.difference);
            let is_like = shown.is_like(kind);
            assert!(is_like, "{name}: {shown:?} in place of {kind:?}");
            let text = LineTalk::<B>::text(&small).expect("a model");
            let (right, why) = verdict::<B>(&text, "", &[]);
            assert_eq!(right, Verdict::Passed, "{name}: {why}\n{text}");
            // The values of open points with which the model explains most are not those of the drive.
            let planted = &small.setup.deviates[0].line::<B>();
            let under = B::basis(&small.difference).1;
            let (wrong, why) = verdict::<B>(&text, planted, under);
            assert_eq!(wrong, Verdict::Failed, "{name}: {why}\n{text}");
        }
        missed
    }
}

fn settings<B: LineBus>(setup: LineSetup, seed: u64) -> FuzzSettings<LineTalk<B>> {
    let spices = B::Spice::ALL.iter().map(|(name, _)| (*name).to_owned());
    FuzzSettings {
        schema: 1,
        rig: "sim".to_owned(),
        drives: 1,
        second: None,
        ports: false,
        seed,
        confirm: 2,
        of: 3,
        setup,
        spices: spices.collect(),
    }
}

fn bounds(seconds: u64, findings: usize) -> Bounds {
    Bounds {
        cases: u64::MAX,
        wire: Some(Span::from_millis(1_000 * seconds)),
        findings,
        every: u64::MAX,
    }
}

/// The verdict of a scenario, with one more line in its header, and without the lines `under`.
fn verdict<L: Language>(text: &str, line: &str, under: &[String]) -> (Verdict, String) {
    let lines = text
        .lines()
        .filter(|line| under.iter().all(|other| other != line));
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    let text = text.replacen("\n# ", &format!("{line}\n\n# "), 1);
    let source = Source {
        name: "finding".to_owned(),
        text: text.clone().into(),
    };
    let found = settle::<L>(&source, BenchSize::Own);
    let (_, plan) = found.unwrap_or_else(|p| panic!("{text}\n{:#?}", p.all()));
    let outcome = plan.play(&mut *plan.simulate(), AtMismatch::Stop);
    (
        outcome.verdict,
        outcome.finding.map_or(text, |finding| finding.message),
    )
}
