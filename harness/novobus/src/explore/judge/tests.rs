//! Drives that make every choice left open by the manual in the opposite way to the model are not blamed. Wrong drives are.

use super::*;
use crate::explore::Finding;
use crate::explore::FuzzRun;
use crate::explore::FuzzSettings;
use crate::explore::Pool;
use crate::explore::case::{Act, Case};
use crate::explore::generate::{CaseScope, RingScope};
use crate::explore::setup::RingSetup;
use crate::explore::{Rehearsal, Tried};
use crate::explore::{Spice, Swarm};
use harness_bench::explore::Dice;
use harness_bench::explore::Progress;
use harness_bench::explore::Target;
use harness_bench::explore::{Bounds, RunEnd, Watcher};
use harness_bench::explore::{ExploreError, FuzzCase as _};
use harness_proto::nd21::own;
use harness_proto::novobus::bus_end::BusEnd;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::guard::Limits;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::output::OutputChange;
use harness_proto::time::{Instant, Span};

/// How a memory is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrong {
    /// It is not.
    Nothing,
    /// A bit of a cell is stuck.
    Stuck,
    /// Two cells are one.
    Alias,
    /// Every 64th write is lost.
    Every64th,
    /// One value of 256 becomes another.
    OneValue,
}

/// A memory with random contents, in which the drive's own cells change randomly at any time.
struct Any {
    cells: Vec<u8>,
    dice: Dice,
    wrong: Wrong,
    writes: u32,
}

impl Any {
    fn forget(&mut self) {
        for address in 0xFD80..=0xFFFF_usize {
            self.cells[address] = self.dice.byte();
        }
    }

    fn place(&self, address: u16) -> usize {
        usize::from(match (self.wrong, address) {
            (Wrong::Alias, 0xFE40) => 0xFE80,
            _ => address,
        })
    }
}

impl Memory for Any {
    fn read(&mut self, address: u16) -> u8 {
        // The bus end itself keeps its address there.
        let bus = address == harness_proto::nd21::ram::BUS_ADDR;
        let changes = own::is_own(address) && !bus;
        let stuck = u8::from((self.wrong, address) == (Wrong::Stuck, 0xFE27)) << 3;
        match changes {
            true => self.dice.byte(),
            false => self.cells[self.place(address)] | stuck,
        }
    }

    fn write(&mut self, address: u16, data: u8) {
        let bus = address == harness_proto::nd21::ram::BUS_ADDR;
        self.writes += u32::from(!bus);
        let lost = self.wrong == Wrong::Every64th && !bus && self.writes.is_multiple_of(64);
        let place = self.place(address);
        if address >= 0xFD80 && !lost {
            self.cells[place] = match (self.wrong, data) {
                (Wrong::OneValue, 0xA7) if !bus => 0xA6,
                _ => data,
            };
        }
    }

    fn write_output(&mut self, _: OutputChange) {}

    fn reset(&mut self) {
        self.forget();
    }

    fn bus_error(&mut self, _: BusError) {}

    fn monitors_time_out(&self) -> bool {
        false
    }
}

/// A ring of such drives as a target, seen from the master's end alone.
struct AnyRing {
    drives: Vec<(BusEnd, Any)>,
    judge: Judge,
    history: Vec<Act>,
    stale: bool,
}

impl AnyRing {
    fn new(drives: u8, properties: Properties, wrong: Wrong, seed: u64) -> Self {
        let any = |drive: u8| {
            let mut dice = Dice::of_part(seed, u64::from(drive));
            let cells = (0..0x1_0000).map(|_| dice.byte()).collect();
            let wrong = if drive == 1 { wrong } else { Wrong::Nothing };
            let memory = Any {
                cells,
                dice,
                wrong,
                writes: 0,
            };
            (BusEnd::new(properties), memory)
        };
        let size = RingSize::new(u64::from(drives)).expect("a size");
        Self {
            drives: (0..drives).rev().map(any).collect(),
            judge: Judge::new(0, size, true),
            history: Vec::new(),
            stale: true,
        }
    }

    /// What comes back for a case.
    fn play(&mut self, case: &Case) -> Vec<Received> {
        let exchange = BytesExchanged::of(case, Vec::new());
        let mut counts = vec![0; self.drives.len() + 1];
        let mut received = Vec::new();
        for (byte, _) in exchange.sent {
            let mut bytes = vec![Received::good(byte)];
            for (place, count) in counts.iter_mut().enumerate() {
                let mut next = Vec::new();
                for byte in bytes {
                    *count += 1;
                    let harms = exchange.harms.get(&(place, *count));
                    let arrives = harms.map_or(vec![[Some(byte); 2]], |harms| {
                        harmed([Some(byte); 2], harms)
                    });
                    next.extend(arrives.into_iter().filter_map(|both| both[0]));
                }
                bytes = match self.drives.get_mut(place) {
                    None => next,
                    Some((end, memory)) => next
                        .into_iter()
                        .filter_map(|byte| end.receive(Instant::START, byte, memory).byte)
                        .map(Received::good)
                        .collect(),
                };
            }
            received.extend(bytes);
        }
        received
    }
}

impl Target<Case> for AnyRing {
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError> {
        Ok(Rehearsal {
            took: Span::from_micros(300) * case.bytes().len() as u64,
            ..Rehearsal::default()
        })
    }

    fn attempt(&mut self, case: &Case, rehearsal: &Rehearsal) -> Result<Tried, ExploreError> {
        if self.stale {
            for (end, memory) in &mut self.drives {
                memory.forget();
                let mut all = vec![0; 17];
                all.extend(harness_proto::novobus::check_sequence::SEQUENCE);
                for byte in all {
                    let _answer = end.receive(Instant::START, Received::good(byte), memory);
                }
            }
            self.judge.begin();
            self.history.clear();
            let prologue = prologue(case.drives, None);
            let received = self.play(&prologue);
            let difference = self.judge.see(BytesExchanged::of(&prologue, received));
            assert!(difference.is_none(), "{difference:?}");
        }
        let mut tried = Tried {
            took: rehearsal.took,
            ..Tried::default()
        };
        if self.judge.foresee(case).is_harmful {
            tried.not_played = Some("harmful".to_owned());
            return Ok(tried);
        }
        let received = self.play(case);
        tried.before = Some(self.history.clone());
        self.history.extend(case.acts.iter().cloned());
        tried.difference = self.judge.see(BytesExchanged::of(case, received));
        self.stale = tried.difference.is_some()
            || case
                .orders()
                .any(|order| order.command == RawCommand::Reset);
        Ok(tried)
    }

    fn begin(&mut self) {
        self.stale = true;
    }
}

#[derive(Default)]
struct Heard(Vec<Finding>);

impl Watcher<Case> for Heard {
    fn round(&mut self, _: u64, _: &Swarm) {}
    fn found(&mut self, finding: &Finding, _: &str) {
        self.0.push(finding.clone());
    }
    fn progress(&mut self, _: &Progress, _: &Pool) {}
}

/// Runs `cases` cases and returns the findings and how many cases could not be sent.
fn run(mut ring: AnyRing, seed: u64, cases: u64, without: &[Spice]) -> (Vec<Finding>, u64) {
    let (first, second) = RingScope::both(3, None, |_, _| true);
    let not_on_ports = [Spice::Power, Spice::Silence, Spice::Late, Spice::Eeprom];
    let spices = Spice::NAMES.iter().map(|(_, spice)| *spice);
    let scope = CaseScope {
        first,
        second,
        spices: spices
            .filter(|spice| !not_on_ports.contains(spice) && !without.contains(spice))
            .collect(),
        limits: Limits::unlimited(),
        spare_eeprom: true,
    };
    let about = FuzzSettings {
        schema: <FuzzSettings>::SCHEMA,
        rig: "any".to_owned(),
        drives: 3,
        second: None,
        ports: true,
        seed,
        confirm: 1,
        of: 2,
        setup: RingSetup::default(),
        spices: Vec::new(),
    };
    let bounds = Bounds {
        cases,
        wire: Some(Span::from_millis(60_000)),
        findings: 1,
        every: u64::MAX,
    };
    let mut campaign = FuzzRun::new(about, scope);
    let mut heard = Heard::default();
    let end = campaign.run(&mut ring, None, &bounds, &mut heard);
    assert!(!matches!(end, Ok(RunEnd::Over(_)) | Err(_)));
    (heard.0, campaign.progress().not_sent)
}

/// ND21 9.2, 10.1, 14.2: whatever ROM, RAM, states and registers hold, whatever a reset leaves, and each property of the bus: no drive
/// is blamed.
#[test]
fn no_correct_drive_is_blamed() {
    not_blamed(30);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn no_correct_drive_is_blamed_in_more_cases() {
    not_blamed(400);
}

fn not_blamed(cases: u64) {
    for (number, properties) in (0..).zip(all_properties()) {
        let ring = AnyRing::new(3, properties, Wrong::Nothing, number);
        let (found, not_sent) = run(ring, number, cases, &[]);
        let told = found.iter().map(|finding| {
            let text = Case::scenario(finding, "it was blamed", None, false).unwrap_or_default();
            format!(
                "{} confirmed {}\n{text}",
                finding.difference.about, finding.confirmed
            )
        });
        let told: Vec<_> = told.collect();
        assert!(found.is_empty(), "{properties:?}: {}", told.concat());
        assert!(
            not_sent < cases / 2,
            "{not_sent} of {cases} cases were not sent"
        );
    }
}

/// ND21 10.1, 10.2: a drive whose memory is wrong is found within a minute on the line, and no other is named.
#[test]
fn a_wrong_memory_is_found() {
    for wrong in [
        Wrong::Stuck,
        Wrong::Alias,
        Wrong::Every64th,
        Wrong::OneValue,
    ] {
        let ring = AnyRing::new(3, Properties::default(), wrong, 5);
        let (found, _) = run(ring, 5, 1_000, &[Spice::Reset]);
        let found = found
            .first()
            .unwrap_or_else(|| panic!("{wrong:?} is not found"));
        let named = found.difference.drive;
        assert!(named.is_none_or(|drive| drive == 1), "{wrong:?}: {named:?}");
    }
}
