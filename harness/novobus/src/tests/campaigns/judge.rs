//! The classes of a ring of two beside a judge that knows nothing but the reference model.

use crate::campaign::class::{CaseClass, CaseEvidence, WrongValue};
use crate::campaign::fault::{FaultEffect, LineBit};
use crate::campaign::find::find;
use crate::campaign::{CaseFaults, CaseOutcome};
use harness_sim::novobus::reference;

/// What a case is, by the reference model alone: no code of the simulator, the master or the campaign. It knows no
/// time, so that it judges bits but the start bit.
struct ReferenceJudge {
    sent: Vec<u8>,
    drives: Vec<reference::Drive>,
    heard: Vec<u8>,
}

/// What the judge can say.
#[derive(Debug, PartialEq, Eq)]
enum CaseVerdict {
    /// The master hears what it hears without a fault, and every drive holds the same.
    Harmless,
    /// The master hears the same, and this cell of this drive is different.
    Silent(Vec<(u8, u16)>),
    /// The master hears something else; the drive that the ring spells out, if it does.
    Noticed(Option<u8>),
}

impl ReferenceJudge {
    fn new() -> Self {
        let text = [
            "8A FE 82 55 13 FE E8",
            "8C FF 63 34 12 08 FF B0",
            "85 FE 12 34",
            "88 FE C0 13 FE D1",
        ];
        let byte = |word| u8::from_str_radix(word, 16).expect("a byte");
        let sent: Vec<u8> = text.join(" ").split(' ').map(byte).collect();
        let mut drive = reference::Drive::new();
        drive.poke(0xFF32, 0x6A);
        drive.poke(0xFF34, 0x28);
        let mut judge = Self {
            sent,
            drives: vec![drive.clone(), drive],
            heard: Vec::new(),
        };
        judge.heard = judge.listen(&[]).0.iter().map(|(byte, _)| *byte).collect();
        judge
    }

    fn listen(
        &self,
        faults: &[(usize, usize, reference::Fault)],
    ) -> (Vec<(u8, bool)>, Vec<reference::Drive>) {
        let mut drives = self.drives.clone();
        let mut sent = self.sent.clone();
        sent.extend([0x80; 60]);
        let links = reference::run(&mut drives, &sent, faults);
        let last = links.last().expect("a link");
        (
            last.iter().map(|cell| (cell.byte, cell.error)).collect(),
            drives,
        )
    }

    fn verdict(&self, faults: &[(usize, usize, reference::Fault)]) -> CaseVerdict {
        let (heard, drives) = self.listen(faults);
        let same = heard
            .iter()
            .map(|(byte, error)| (*byte, *error))
            .eq(self.heard.iter().map(|b| (*b, false)));
        if !same {
            let (last, _) = *heard.last().expect("bytes");
            let spelled = heard
                .iter()
                .rev()
                .take_while(|(byte, error)| *byte == last && !error)
                .count()
                >= 20;
            return CaseVerdict::Noticed(Some(last).filter(|last| spelled && *last < 2));
        }
        let sound = self.listen(&[]).1;
        let mut wrong = Vec::new();
        for (place, (drive, sound)) in drives.iter().zip(&sound).enumerate() {
            let differs = |address: &u16| drive.peek(*address) != sound.peek(*address);
            let addresses = (0xFD80..=0xFFFF).filter(differs);
            wrong.extend(addresses.map(|address| (1 - place as u8, address)));
        }
        if wrong.is_empty() {
            CaseVerdict::Harmless
        } else {
            CaseVerdict::Silent(wrong)
        }
    }
}

fn as_reference(case: &CaseFaults) -> Option<Vec<(usize, usize, reference::Fault)>> {
    let fault = |what| {
        Some(match what {
            FaultEffect::Bit(LineBit::Data(bit)) => reference::Fault::Flip(1 << bit, false, false),
            FaultEffect::Bit(LineBit::Parity) => reference::Fault::Flip(0, true, false),
            FaultEffect::Bit(LineBit::Stop) => reference::Fault::Flip(0, false, true),
            FaultEffect::Drop => reference::Fault::Drop,
            FaultEffect::Duplicate => reference::Fault::Duplicate,
            FaultEffect::Insert(byte) => reference::Fault::Insert(byte),
            _ => return None,
        })
    };
    let all = case.faults().map(|injected| {
        let byte = usize::try_from(injected.byte).ok()?;
        Some((injected.link, byte, fault(injected.what)?))
    });
    all.collect()
}

/// The classes of a ring of two beside a judge that knows nothing but the reference model: every bit, and every pair of bits
/// in one byte, but for the start bit.
#[test]
fn an_independent_judge_agrees() {
    let judge = ReferenceJudge::new();
    let folder = tempfile::tempdir().expect("a folder");
    let bytes: String = judge.sent.iter().map(|b| format!(" {b:02X}")).collect();
    let scenario = format!(
        "title t\nsource nd21 9.6\nring 2\ndrive 0..last memory DataIn = 6A\n\
         drive 0..last memory DataOut = 28\n>{bytes}\n"
    );
    std::fs::write(folder.path().join("two.scn"), scenario).expect("a file");
    let mut seen = std::collections::BTreeMap::new();
    for more in ["", "pairs = \"byte\"\n"] {
        let text = format!(
            "schema = 1\ntitle = \"t\"\nscenario = \"two.scn\"\nfaults = [\"bits\"]\n\
             bits = [\"0\", \"1\", \"2\", \"3\", \"4\", \"5\", \"6\", \"7\", \"p\", \"s\"]\n{more}"
        );
        let path = folder.path().join("two.toml");
        std::fs::write(&path, text).expect("a file");
        let found = find(&path).expect("a file");
        let campaign = found.unwrap_or_else(|error| panic!("{error:?}"));
        for case in &campaign.cases {
            let (outcome, _) = campaign.play(case).expect("a class");
            let faults = as_reference(case).expect("bits");
            let verdict = judge.verdict(&faults);
            check(case, &outcome, &verdict);
            *seen.entry(outcome.class).or_insert(0u32) += 1;
        }
    }
    // Cases of one class alone would show little.
    for class in [
        CaseClass::Located,
        CaseClass::Recovered,
        CaseClass::Mislocated,
        CaseClass::Corrupted,
        CaseClass::SilentCorruption,
    ] {
        assert!(seen.get(&class).is_some_and(|count| *count > 5), "{seen:?}");
    }
}

/// A classification that is planted wrong does not pass the judge: each of these is one of the others.
#[test]
fn the_judge_finds_a_wrong_classification() {
    let case = CaseFaults::from_name("master->1:18:0+master->1:18:1", 2).expect("a case");
    let judge = ReferenceJudge::new();
    let silent = judge.verdict(&as_reference(&case).expect("bits"));
    assert_eq!(silent, CaseVerdict::Silent(vec![(0, 0xFF6A)]));
    let right = CaseEvidence {
        confirmed: true,
        all_back: true,
        wrong: vec![WrongValue::Cell {
            drive: 0,
            address: 0xFF6A,
            value: 0x11,
            expected: 0x12,
        }],
        ..CaseEvidence::default()
    };
    let outcome = |evidence: CaseEvidence| CaseOutcome {
        case,
        drives: 2,
        class: evidence.class(&case.links()).expect("a class"),
        evidence,
    };
    check(&case, &outcome(right.clone()), &silent);
    let planted = [
        CaseEvidence {
            wrong: Vec::new(),
            ..right.clone()
        },
        CaseEvidence {
            noticed: true,
            ..right.clone()
        },
        CaseEvidence {
            noticed: true,
            named: Some(0),
            wrong: Vec::new(),
            ..right.clone()
        },
        CaseEvidence {
            wrong: vec![WrongValue::Cell {
                drive: 1,
                address: 0xFF6A,
                value: 0x11,
                expected: 0x12,
            }],
            ..right.clone()
        },
    ];
    for evidence in planted {
        let outcome = outcome(evidence);
        let caught = std::panic::catch_unwind(|| check(&case, &outcome, &silent));
        assert!(caught.is_err(), "{outcome:?}");
    }
    // A class that its evidence does not give.
    let outcome = CaseOutcome {
        class: CaseClass::Located,
        ..outcome(right)
    };
    assert!(std::panic::catch_unwind(|| check(&case, &outcome, &silent)).is_err());
}

/// Whether class and evidence are what the judge says.
fn check(case: &CaseFaults, outcome: &CaseOutcome, verdict: &CaseVerdict) {
    let place = || format!("{}: {verdict:?} {outcome:?}", case.name(2));
    let evidence = &outcome.evidence;
    let class = evidence.class(&case.links());
    assert_eq!(class, Ok(outcome.class), "{}", place());
    match verdict {
        CaseVerdict::Harmless => assert_eq!(outcome.class, CaseClass::Harmless, "{}", place()),
        CaseVerdict::Silent(cells) => {
            assert_eq!(outcome.class, CaseClass::SilentCorruption, "{}", place());
            let cell = |wrong: &WrongValue| match wrong {
                WrongValue::Cell { drive, address, .. } => Some((*drive, *address)),
                WrongValue::Answer { .. } => None,
            };
            let mut found: Vec<_> = evidence.wrong.iter().filter_map(cell).collect();
            found.sort_unstable_by_key(|(drive, address)| (std::cmp::Reverse(*drive), *address));
            assert_eq!(&found, cells, "{}", place());
        }
        CaseVerdict::Noticed(None) => {
            // Data that are not compared may come back changed.
            let data = outcome.class == CaseClass::SilentCorruption
                && evidence
                    .wrong
                    .iter()
                    .all(|wrong| matches!(wrong, WrongValue::Answer { .. }));
            assert!(evidence.noticed || data, "{}", place());
            // What is no drive's address can only be the master's own link.
            assert!(evidence.named.is_none_or(|link| link == 2), "{}", place());
        }
        CaseVerdict::Noticed(Some(drive)) => {
            assert!(evidence.noticed, "{}", place());
            assert_eq!(evidence.named, Some(1 - usize::from(*drive)), "{}", place());
        }
    }
}
