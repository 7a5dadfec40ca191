//! Plants each deviation of the simulator in one drive of three and checks which one is named. The bench sees what it sees through a port:
//! the bytes and times at the master, cells with unknown contents, and faults on the master's own link only. The drives are plain ones,
//! which take a fraction of the time of complete ND21s; deviations behind the bus are left out.

mod eeprom;

use crate::language::plan::Plan;
use crate::language::plan::asks_the_driver;
use crate::language::read::RingScenario;
use crate::language::syntax::Header;
use crate::link::SimulatedLink;
use crate::qualify::{
    AccusedDrives, Culprit, Meant, NamedDeviation, PinnedDrive, ProbeAnswer, RingSeen, Sighting,
    agreed, answer, conversations, culprit, dumps, exchange, hypotheses, marches, name, probes,
    questions,
};
use crate::rig::{Way, play_one};
use crate::simulate::bench;
use crate::tests::built_in_sources;
use crate::twin::{Conversation, Exactness, Twin};
use harness_bench::link::{Capability, LinkEvent, Octets, Recording};
use harness_bench::scenario::run::lacks;
use harness_bench::scenario::source::Source;
use harness_proto::time::Span;
use harness_sim::novobus::deviation::{DEVIATIONS, Deviation, RELATIVES};
use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};

const DRIVES: u8 = 3;

/// A twin for each set of header lines that makes a ring.
type Twins = BTreeMap<Vec<String>, Result<Twin, ()>>;

/// How long a scenario may take that is played here.
const SHORT: Span = Span::from_millis(150);

const THROUGH_A_PORT: Exactness = Exactness {
    tolerance: Span::from_millis(20),
    line_errors: true,
    knows_cells: false,
    looks: None,
};

fn ring(lines: &[String]) -> Result<(Plan, SimulatedLink), ()> {
    let text = format!(
        "title x\nring {DRIVES}\ndrive 0..last model plain\n{}\n> 80\n",
        lines.join("\n")
    );
    let source = Source {
        name: "ring".to_owned(),
        text: text.into(),
    };
    // A plain drive has no deviation behind its bus.
    let entry = RingScenario::new(source, None).map_err(|_| ())?;
    let plan = entry.plan;
    let link = bench(&plan);
    Ok((plan, link))
}

fn twin_of(header: &Header) -> Result<Twin, ()> {
    twin(&header.lines())
}

/// A twin with more lines in its header. There are many of them, and each is asked for often.
fn twin(lines: &[String]) -> Result<Twin, ()> {
    static TWINS: OnceLock<Mutex<Twins>> = OnceLock::new();
    let twins = TWINS.get_or_init(Mutex::default);
    let mut twins = twins.lock().expect("no panic");
    let twin = twins.entry(lines.to_vec()).or_insert_with(|| {
        let (plan, link) = ring(lines)?;
        Ok(Twin::new(link, &plan.rings))
    });
    twin.clone()
}

/// What a qualification plays through a port: its own conversations, and the short ones of the built-in scenarios that need nothing else.
fn plans() -> &'static [Plan] {
    static PLANS: OnceLock<Vec<Plan>> = OnceLock::new();
    PLANS.get_or_init(|| {
        let conversations = conversations(DRIVES, &|place| place == 0).expect("no mistakes");
        let built_in = built_in_sources();
        let built_in = built_in.filter_map(|source| RingScenario::new(source, Some(DRIVES)).ok());
        let built_in = built_in.map(|entry| entry.plan);
        let right = twin(&[]).expect("a ring").into_link();
        let fits = |plan: &Plan| {
            let mut link = right.clone();
            let mut events: Vec<LinkEvent> = Vec::new();
            let mut recording = Recording::new(&mut link, &mut events);
            plan.rings.len() == 1
                && plan.rings[0].drives() == DRIVES
                && !plan.needs.contains(&Capability::Interposer)
                && !asks_the_driver(plan)
                && lacks(plan, &recording).is_none()
                && play_one(&mut recording, plan, &as_they_are())
                    .is_ok_and(|outcome| outcome.took < SHORT)
        };
        let built_in = built_in.filter(fits);
        let conversations = conversations.into_iter().map(|entry| entry.plan);
        let conversations = conversations.filter(|plan| !asks_the_driver(plan));
        conversations.chain(built_in).collect()
    })
}

/// A scenario on drives that have just been switched on.
fn as_they_are() -> Way {
    Way {
        rings: ring(&[]).expect("a ring").0.rings.clone(),
        attempts: None,
        anew: false,
    }
}

/// A conversation as a bench whose clock is 0.7 % faster than the drives' sees it.
fn slow(conversation: &mut Conversation) {
    for (_, at, _) in &mut conversation.received {
        *at += Span::from_nanos(at.since_start().as_nanos() / 1_000 * 7);
    }
}

/// What comes of playing a scenario on a link, as a bench with another clock sees it.
fn played(plan: &Plan, link: &SimulatedLink) -> Vec<Conversation> {
    let mut all = played_in_time(plan, link);
    all.iter_mut().for_each(slow);
    all
}

/// What comes of playing a scenario on a link.
fn played_in_time(plan: &Plan, link: &SimulatedLink) -> Vec<Conversation> {
    let mut link = link.clone();
    let byte_time = link.byte_time();
    let mut events: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::new(&mut link, &mut events);
    let _verdict = play_one(&mut recording, plan, &as_they_are());
    Conversation::all(&events, byte_time, true)
}

/// What a qualification makes of a ring.
#[derive(Debug, Default)]
struct NamingVerdict {
    /// Whether it differed from the model at all.
    differs: bool,
    named: Vec<NamedDeviation>,
    /// The drive that is to blame, whatever it does.
    culprit: Option<Culprit>,
    /// What the ring has shown when it was asked.
    pinned: Vec<PinnedDrive>,
}

/// What a ring was seen to do.
#[derive(Default)]
struct RingConduct {
    differing: Vec<Vec<Conversation>>,
    alike: Vec<Vec<Conversation>>,
}

impl RingConduct {
    /// Plays a scenario on such a ring, and gives where it differed from the model.
    fn play(&mut self, link: &SimulatedLink, plan: &Plan) -> (bool, Option<Sighting>) {
        let right = twin(&[]).expect("a ring");
        self.judge(played(plan, link), link.byte_time(), right)
    }

    /// Where conversations differed from the model.
    fn judge(
        &mut self,
        played: Vec<Conversation>,
        byte_time: Span,
        mut right: Twin,
    ) -> (bool, Option<Sighting>) {
        let (conversations, _) = as_they_are().compared(played, THROUGH_A_PORT);
        let (comparisons, _) = right.follow_all(&conversations, THROUGH_A_PORT);
        let mut found = comparisons.iter().enumerate();
        let found = found.find(|(_, comparison)| comparison.divergence.is_some());
        let sighting =
            found.and_then(|found| Sighting::of(&conversations, found, DRIVES, byte_time));
        let differs = found.is_some();
        match differs {
            true => self.differing.push(conversations),
            false => self.alike.push(conversations),
        }
        (differs, sighting)
    }
}

/// What a qualification makes of a ring with these lines.
fn verdict(lines: &[String]) -> NamingVerdict {
    let link = twin(lines).expect("a ring").into_link();
    let mut play = RingConduct::default();
    let mut sightings = Vec::new();
    for (number, plan) in plans().iter().enumerate() {
        let (_, sighting) = play.play(&link, plan);
        sightings.extend(sighting.map(|sighting| (number.to_string(), sighting)));
    }
    let seen: Vec<_> = sightings.iter().map(|(_, seen)| seen.meant).collect();
    let asked = questions(DRIVES, &sightings);
    let pinned = asked.iter().filter_map(|question| {
        let plan = &question.entry.plan;
        question.answer(&played(plan, &link))
    });
    let pinned: Vec<_> = pinned.collect();
    let trials = exchange(DRIVES, sightings, &mut |entry: &RingScenario| {
        let plan = &entry.plan;
        let (differs, sighting) = play.play(&link, plan);
        let meant = sighting.map_or(Meant::Nobody, |sighting| sighting.meant);
        Ok::<_, ()>(Some(differs.then_some(meant)))
    });
    let seen_all = RingSeen {
        drives: DRIVES,
        suspects: &[],
        differing: &play.differing,
        alike: &play.alike,
        exactness: THROUGH_A_PORT,
    };
    let culprit = culprit(DRIVES, &seen, &trials.expect("no errors"), &pinned);
    let (culprit, named) = agreed(culprit, &name(&seen_all, &twin_of));
    NamingVerdict {
        differs: !play.differing.is_empty(),
        named,
        culprit,
        pinned,
    }
}

/// How a deviation that was planted is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum End {
    Alone,
    /// Among others that explain every byte too.
    AmongOthers,
    /// It shows, and nothing is named.
    NotNamed,
    /// It does not show.
    NotSeen,
}

/// How a deviation is named, and whether its drive is blamed for it whatever it is.
fn end(planted: &Deviation, whose: Option<u8>) -> (End, bool) {
    let drives = whose.map_or("0..last".to_owned(), |drive| drive.to_string());
    let lines = [format!("drive {drives} deviates {}", planted.name)];
    let NamingVerdict {
        differs,
        named,
        culprit,
        pinned,
    } = verdict(&lines);
    let others = pinned.iter().find(|pinned| Some(pinned.drive) != whose);
    assert!(others.is_none(), "{lines:?}: {others:?}");
    if let Some(culprit) = culprit {
        assert_eq!(
            Some(culprit.drive),
            whose,
            "{lines:?}: another drive is blamed"
        );
    }
    let accused = named.iter().filter_map(|named| match named.whose.clone() {
        AccusedDrives::OneOf(drives) if drives.len() == 1 => Some(drives[0]),
        _ => None,
    });
    let accused: Vec<_> = accused.collect();
    assert!(
        accused.iter().all(|drive| Some(*drive) == whose),
        "{lines:?}: {named:?}"
    );
    let is_it = |named: &&NamedDeviation| {
        let drive = match (&named.whose, whose) {
            (AccusedDrives::OneOf(drives), Some(drive)) => drives.contains(&drive),
            (AccusedDrives::Every, None) => true,
            _ => false,
        };
        named.deviation.name == planted.name && drive
    };
    let right = named.iter().find(is_it);
    let end = match (right, named.len()) {
        (Some(right), 1) if matches!(&right.whose, AccusedDrives::OneOf(drives) if drives.len() > 1) => {
            End::AmongOthers
        }
        (Some(_), 1) => End::Alone,
        (Some(_), _) => End::AmongOthers,
        (None, 0) if differs => End::NotNamed,
        (None, 0) => End::NotSeen,
        (None, _) => panic!("{lines:?}: only others are named: {named:?}"),
    };
    (end, culprit.is_some())
}

#[test]
fn some_planted_in_turn() {
    planted_in_turn(SOME, 2, 1);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn all_planted_in_turn() {
    planted_in_turn(1, 30, 12);
}

/// An ordinary run plants every `SOME`-th deviation, the nightly run plants all of them.
const SOME: usize = 16;

/// Plants every `step`-th deviation, each in the next drive in turn. No other drive may be blamed. The planted drive is blamed where only
/// its own answers differ, as for a deviation without a name. At least `named` deviations must be named, and `culprits` drives blamed.
fn planted_in_turn(step: usize, named: usize, culprits: usize) {
    let (mut ends, mut blamed) = (BTreeMap::new(), 0);
    let of_the_bus = DEVIATIONS
        .all()
        .filter(|deviation| !deviation.is_behind_the_bus());
    for (planted, drive) in of_the_bus.zip((0..DRIVES).cycle()).step_by(step) {
        let (end, is_blamed) = end(planted, Some(drive));
        blamed += usize::from(is_blamed);
        *ends.entry(end).or_insert(0) += 1;
    }
    let count = |end| ends.get(&end).copied().unwrap_or(0);
    assert!(
        count(End::Alone) + count(End::AmongOthers) >= named,
        "{ends:?}"
    );
    assert!(blamed >= culprits, "{blamed}");
}

/// An oscilloscope that stands, as it does after a reset (14.10.6.5): it records nothing in the cells that are tested.
const STANDS: &str = "drive 0..last memory scope_status = 80";

/// A scenario or a conversation of a qualification by its name.
fn named_plan(name: &str) -> Plan {
    let conversations = conversations(DRIVES, &|_| false).expect("no mistakes");
    let built_in = built_in_sources();
    let built_in = built_in.filter_map(|source| RingScenario::new(source, Some(DRIVES)).ok());
    let mut all = built_in.chain(conversations);
    let entry = all.find(|entry| entry.short_name() == name).expect(name);
    entry.plan
}

/// What a ring with these lines shows when it is asked, where this scenario or conversation differed.
fn shown(lines: &str, name: &str) -> Vec<(u8, &'static str)> {
    let wrong = [STANDS.to_owned(), lines.to_owned()];
    let link = twin(&wrong).expect("a ring").into_link();
    let right = twin(&wrong[..1]).expect("a ring");
    let all = played_in_time(&named_plan(name), &link);
    let (_, sighting) = RingConduct::default().judge(all, link.byte_time(), right);
    let sighting = sighting.unwrap_or_else(|| panic!("{lines}: {name} shows nothing"));
    let sightings = [(name.to_owned(), sighting)];
    let asked = questions(DRIVES, &sightings);
    let pinned = asked.iter().filter_map(|question| {
        let plan = &question.entry.plan;
        question.answer(&played_in_time(plan, &link))
    });
    pinned.map(|pin| (pin.drive, pin.section)).collect()
}

/// The deviations that explain what was played on a ring whose right drives have these lines.
fn names_of(play: &RingConduct, lines: &[String]) -> Vec<&'static str> {
    let seen = RingSeen {
        drives: DRIVES,
        suspects: &[],
        differing: &play.differing,
        alike: &play.alike,
        exactness: THROUGH_A_PORT,
    };
    let twin = |header: &Header| twin(&[lines, &header.lines()].concat());
    let named = name(&seen, &twin);
    named.iter().map(|named| named.deviation.name).collect()
}

/// A bit that is stuck at 0 is as in a drive that writes nothing, where nothing else is looked at; other cells that are right refute it.
#[test]
fn what_is_right_refutes_a_name() {
    let wrong = [
        STANDS.to_owned(),
        "drive 1 deviates ram-bit-stuck-at-0".to_owned(),
    ];
    let link = twin(&wrong).expect("a ring").into_link();
    let mut play = RingConduct::default();
    for name in ["10.2-march", "qualify-cells"] {
        let all = played_in_time(&named_plan(name), &link);
        let _sighting = play.judge(all, link.byte_time(), twin(&wrong[..1]).expect("a ring"));
    }
    assert_eq!((play.differing.len(), play.alike.len()), (1, 1));
    let names = names_of(&play, &wrong[..1]);
    assert!(!names.contains(&"writes-ignored"), "{names:?}");
    assert!(names.contains(&"ram-bit-stuck-at-0"), "{names:?}");
}

/// ND21 9.6: 00 in place of 01 is accepted by a drive that does not know this rule, and by one that checks nothing. That it refuses another
/// wrong byte tells them apart.
#[test]
fn what_is_right_elsewhere_refutes_a_name() {
    let wrong = ["drive 1 deviates checksum-zero-accepted".to_owned()];
    let link = twin(&wrong).expect("a ring").into_link();
    let mut play = RingConduct::default();
    let mut names = Vec::new();
    // C0+42+FE = 200, so 01 is right.
    for check in ["00", "2F"] {
        let source = Source {
            name: "wrong".to_owned(),
            text: format!("title x\nring {DRIVES}\n> 88 FE C0 42 FE {check}\n").into(),
        };
        let plan = RingScenario::new(source, None).expect("a scenario").plan;
        let all = played_in_time(&plan, &link);
        let _sighting = play.judge(all, link.byte_time(), twin(&[]).expect("a ring"));
        names.push(names_of(&play, &[]));
    }
    assert_eq!((play.differing.len(), play.alike.len()), (1, 1));
    let unchecked = "checksum-not-checked";
    assert!(names[0].contains(&unchecked), "{names:?}");
    assert!(!names[1].contains(&unchecked), "{names:?}");
    assert!(names[1].contains(&"checksum-zero-accepted"), "{names:?}");
}

/// ND21 10.3: a drive that takes only the mask FF for 7F does not add masks to bytes: with all others before it is right.
#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn what_is_right_before_refutes_a_name() {
    let lines = [STANDS.to_owned()];
    let link = twin(&lines).expect("a ring").into_link();
    let mut all = played_in_time(&named_plan("10.3-every-mask-or"), &link);
    // The answer to the last command, of the last drive: FF, and its checking byte.
    let received = &mut all.last_mut().expect("a conversation").received;
    let [.., (_, _, data), (_, _, sum)] = &mut received[..] else {
        panic!("no answer");
    };
    assert_eq!(data.byte, 0xFF);
    (data.byte, sum.byte) = (0x7F, sum.byte.wrapping_add(0x80));
    let mut play = RingConduct::default();
    let _sighting = play.judge(all, link.byte_time(), twin(&lines).expect("a ring"));
    assert_eq!((play.differing.len(), play.alike.len()), (1, 0));
    let names = names_of(&play, &lines);
    assert!(!names.contains(&"or-carries"), "{names:?}");
}

/// ND21 14.2.1, 9.3, 9.7: a ring that is asked shows which drive is wrong, or which cell, and keeps to what the bytes say.
#[test]
fn a_ring_that_is_asked_shows_what_is_wrong() {
    for drive in 0..DRIVES {
        let is = |deviation: &str, name: &str, section: &'static str| {
            let lines = format!("drive {drive} deviates {deviation}");
            assert_eq!(shown(&lines, name), [(drive, section)], "{lines}");
        };
        let nothing = |deviation: &str, name: &str| {
            let lines = format!("drive {drive} deviates {deviation}");
            assert_eq!(shown(&lines, name), [], "{lines}");
        };
        for cell in ["ram-bit-stuck-at-0", "ram-cells-aliased"] {
            is(cell, "10.2-march", "14.2.1");
        }
        is("read-word-stays-in-its-page", "10.1-ends-of-pages", "10.1");
        is("increments-seven-bits", "qualify-addresses", "9.3");
        let seven_bits = "compares-seven-bits-of-the-address";
        is(seven_bits, "9.3-every-address-byte", "9.3");
        // No drive can be told from another one by its address.
        nothing("does-not-increment", "qualify-addresses");
        // The first drive of the conversation has an address byte of its own.
        if drive > 0 {
            is("next-drive-is-same-drive", "qualify-next-drives", "9.2");
        }
        // No cell is wrong: one value, or a write now and then.
        nothing("byte-a7-written-as-a6", "10.2-march");
        nothing("every-64th-write-lost", "10.2-march");
        // Only the first drive of the ring has certainly been sent what the master sent.
        match drive + 1 == DRIVES {
            true => is("last-word-refused", "10.1-ends-of-pages", "10.1"),
            false => nothing("last-word-refused", "10.1-ends-of-pages"),
        }
    }
}

/// ND21 9.6, 9.7: the section is that of the rule that is broken. A drive that finds a wrong checking byte and begins its zeros one byte late
/// breaks the rules of the error mode, and one that finds nothing those of the checking byte. Zeros after a silence are those of 9.9.
#[test]
fn the_section_is_that_of_the_broken_rule() {
    let (drive_1, checksum) = (Meant::Own(1), "qualify-checksum-drive-1");
    for (deviation, name, meant, section) in [
        ("wrong-checksum-passed-on", checksum, drive_1, "9.7"),
        ("checksum-not-checked", checksum, drive_1, "9.6"),
        ("time-out-always", "qualify-silences", Meant::Nobody, "9.9"),
    ] {
        let lines = [STANDS.to_owned(), format!("drive 1 deviates {deviation}")];
        let link = twin(&lines).expect("a ring").into_link();
        let right = twin(&lines[..1]).expect("a ring");
        let all = played_in_time(&named_plan(name), &link);
        let (_, sighting) = RingConduct::default().judge(all, link.byte_time(), right);
        let found = sighting.map(|sighting| (sighting.meant, sighting.section));
        assert_eq!(found, Some((meant, section)), "{deviation}");
    }
}

#[test]
fn right_drives_have_no_names() {
    let right = verdict(&[]);
    assert!(
        !right.differs && right.named.is_empty() && right.culprit.is_none(),
        "{right:?}"
    );
}

/// ND21 9.7: what a follower in the error mode does wrong can look like what the drive behind it does wrong. Errors in each drive, and bytes
/// of all kinds behind them, tell the two apart.
#[test]
fn a_follower_that_adds_nothing_is_told_from_the_drive_behind_it() {
    let verdict = verdict(&["drive 1 deviates adds-0-in-error-mode".to_owned()]);
    let [only] = &verdict.named[..] else {
        panic!("{verdict:?}")
    };
    assert_eq!(only.deviation.name, "adds-0-in-error-mode");
    assert_eq!(only.whose, AccusedDrives::OneOf(vec![1]));
}

/// Relatives of the deviations with other numbers, some of them.
#[test]
fn other_numbers() {
    with_other_numbers(10, 3);
}

#[test]
#[ignore = "takes minutes; .ci/nightly runs it"]
fn all_other_numbers() {
    with_other_numbers(1, 30);
}

/// Every `step`-th relative is named, or nothing is; at least `named` of them are.
fn with_other_numbers(step: usize, named: usize) {
    let mut ends = BTreeMap::new();
    for (planted, drive) in RELATIVES.all().step_by(step).zip((0..DRIVES).cycle()) {
        let (end, _) = end(planted, Some(drive));
        *ends.entry(end).or_insert(0) += 1;
    }
    let count = |end| ends.get(&end).copied().unwrap_or(0);
    assert!(
        count(End::Alone) + count(End::AmongOthers) >= named,
        "{ends:?}"
    );
}

#[test]
fn some_planted_in_every_drive() {
    planted_in_every_drive(SOME);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn all_planted_in_every_drive() {
    planted_in_every_drive(1);
}

/// In every drive: it is named for all of them, or for none.
fn planted_in_every_drive(step: usize) {
    let all = DEVIATIONS.all();
    let of_the_bus = all.filter(|deviation| !deviation.is_behind_the_bus());
    for planted in of_the_bus.step_by(step) {
        let lines = [format!("drive 0..last deviates {}", planted.name)];
        let found = verdict(&lines);
        let of_all = |one: &NamedDeviation| one.whose == AccusedDrives::Every || one.perhaps_of_all;
        assert!(
            found.named.is_empty() || found.named.iter().any(of_all),
            "{lines:?}: {found:?}"
        );
        assert!(
            found.culprit.is_none_or(|culprit| culprit.perhaps_of_all) || !found.named.is_empty(),
            "{lines:?}: {found:?}"
        );
    }
}

/// What RAM holds before the first write is a drive's choice, DataIn and DataOut (ND21 14.10.3) among it.
#[test]
fn right_drives_with_contents_of_their_own_have_no_names() {
    let lines = [
        "drive 0..last memory FE10 = A1 B2 C3 D4 E5 F6 17 28",
        "drive 0..last memory DataIn = 08",
        "drive 0..last memory DataOut = 0C",
        "drive 0..last memory FF08 = 12 34",
        "drive 0..last memory FF7C = 56 78 9A BC",
    ];
    let found = verdict(&lines.map(str::to_owned));
    assert!(!found.differs && found.named.is_empty(), "{found:?}");
}

/// ND21 9.9: the time-outs of the drives, and their waits, lie 0.3 ms apart at most. No drive is named, and what the probes of these times
/// settle is the manual's own value.
#[test]
fn right_drives_with_clocks_of_their_own_have_no_names() {
    let time_outs = ["time-out", "time-out-wait", "time-out-answer"];
    let probes = probes(DRIVES).expect("no mistakes");
    for seed in 0..8_u64 {
        let tenths = |place: u64| (seed * 7 + place * 5) % 4;
        let property_line = |place: u64, property: &str| {
            let drive = place % u64::from(DRIVES);
            let ms = tenths(place);
            format!("drive {drive} property {property} = 10.{ms}ms")
        };
        let lines: Vec<_> = (0..6)
            .map(|place| property_line(place, time_outs[usize::from(place >= 3)]))
            .collect();
        let found = verdict(&lines);
        let nothing = !found.differs && found.named.is_empty();
        assert!(nothing, "{lines:?}: {found:?}");
        let link = twin(&lines).expect("a ring").into_link();
        for probe in probes
            .iter()
            .filter(|probe| time_outs.contains(&probe.property))
        {
            let entries = probe.entries.iter().map(|entry| &entry.plan);
            let seen: Vec<_> = entries.map(|plan| played(plan, &link)).collect();
            let found = answer(probe, DRIVES, &seen, THROUGH_A_PORT, &twin_of).expect("rings");
            let manual = &hypotheses(probe.property, DRIVES)[0];
            let is_manual =
                matches!(&found, ProbeAnswer::Settled { header, .. } if *header == manual.header);
            assert!(is_manual, "{lines:?}: {}: {found:?}", probe.property);
        }
    }
}

/// What a conversation shows of a ring of ND21 drives, with this line or as the manual says: which drive is meant, and the section of the
/// byte that differs.
fn sighted(name: &str, line: &str) -> Option<(Meant, &'static str)> {
    sighted_by(&[line], |_| named_plan(name))
}

/// The same of a conversation that may depend on what the drives hold.
fn sighted_by(
    lines: &[&str],
    plan: impl Fn(&SimulatedLink) -> Plan,
) -> Option<(Meant, &'static str)> {
    let right = ["drive 0..last model nd21", STANDS].map(str::to_owned);
    let mut drives = right.to_vec();
    drives.extend(lines.iter().map(|line| (*line).to_owned()));
    let link = twin(&drives).expect("a ring").into_link();
    let all = played_in_time(&plan(&link), &link);
    let model = twin(&right).expect("a ring");
    let (_, sighting) = RingConduct::default().judge(all, link.byte_time(), model);
    sighting.map(|sighting| (sighting.meant, sighting.section))
}

/// What these conversations are made for: ND21 10.1 (ROM is compared with itself, and longs go over the ends of pages), 14.4.1 and 14.10.1
/// (`Status` after an error of the bus).
#[test]
fn conversations_find_their_deviations() {
    for (name, wrong) in [
        ("qualify-rom", "rom-cell-wrong-at-times"),
        ("qualify-long-reads", "read-long-stays-in-its-page"),
        ("qualify-errors", "errors-stop"),
        ("qualify-errors", "status-without-wrong-sums"),
    ] {
        assert_eq!(sighted(name, ""), None, "{name}");
        let found = sighted(name, &format!("drive 1 deviates {wrong}"));
        assert_eq!(found.map(|found| found.0), Some(Meant::Own(1)), "{name}");
    }
    // Which errors of the bus set the error bit is left open (11.8).
    let rule = "drive 1 property bus-errors = time-out-only";
    assert_eq!(sighted("qualify-errors", rule), None);
}
