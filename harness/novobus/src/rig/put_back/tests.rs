//! What scenarios change is put back on every way out, or printed with the command that does it.

use super::super::busy::line::Stalls;
use super::super::busy::{entry, rig, session};
use super::super::run::Run;
use super::*;
use crate::language::argument::{MemoryKind, assignments};
use harness_bench::link::{DriveFault, Link as _, LinkFault, Moment, PlacedFault};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::novobus::sync::SYNCO;

/// The EEPROM, the monitoring, settings, an output, and an error (ND21 14.10.5, 14.10.2, 14.2.1, 10.4, 14.10.1).
const CHANGES: &str = "title t\nring 3\n\
    write-byte 1 nKp = 33\nwrite-word 2 nMax = 0123\nwrite-byte 0 scope_level = 44\nwrite-byte 1 DataOut = 18\nwrite-io 1 = 01\n\
    master write-eeprom 1 47 = 80\nmaster write-eeprom 2 60 = 5A\nmaster ram-to-eeprom 1\nor 1 Flags2 = 04\n";

/// Everything that these tests change, of every drive.
fn all(session: &mut Session) -> Values {
    let _examined = session.examined();
    let touched = [Touched::Reset, Touched::Eeprom(0x47), Touched::Eeprom(0x60)];
    let parameters = (0x20..=0x3F).map(Touched::Eeprom);
    let places: Vec<_> = touched
        .into_iter()
        .chain(parameters)
        .flat_map(places)
        .collect();
    let axes = session.axes();
    let all = axes
        .into_iter()
        .flat_map(|axis| places.iter().map(move |place| (axis, *place)));
    let (all, rings) = (all.collect(), session.rings().to_vec());
    with_bus(session.link(), &rings, |bus| read(bus, &all)).expect("drives that answer")
}

/// Sets a byte in RAM alone.
fn write(session: &mut Session, drive: u8, address: u16, data: u8) {
    let command = Command::WriteByte { address, data };
    let bytes = telegram(session.rings()[0], drive, command);
    session.link().inner_mut().send_octets(0, &bytes);
}

fn play(session: &mut Session, text: &str) -> Verdict {
    let entry = entry("t.scn", text.to_owned());
    let mut run = Run::new(session).expect("a run");
    let played = run.play(&entry.plan, None);
    played.expect("a healthy ring").outcome.verdict
}

/// ND21 14.10.5, 10.5, 14.10.2, 10.4: the drives hold what they held; what a killed run would leave is known meanwhile.
#[test]
fn what_a_scenario_changes_is_put_back() {
    let rig = rig("");
    let mut session = session(&rig, "", Stalls::new(1, 0)).expect("a ring");
    write(&mut session, 0, ram::NKI, 0x21);
    let before = all(&mut session);
    assert_eq!(play(&mut session, CHANGES), Verdict::Passed);
    assert_ne!(all(&mut session), before);
    let left = session.left().all().join("\n");
    let write = "`drivebench write 2 ee:60=0x00 ";
    assert!(left.contains(write) && left.contains("FF71=0x21"), "{left}");
    session.drives_mut().before.earlier = Some("left before".to_owned());
    let end = session.end(false);
    assert_eq!(end.remarks, ["left before"]);
    assert!(end.safe.is_some_and(|safe| safe.confirmed));
    assert_eq!(session.left().all(), [""; 0]);
    let (rings, axes) = (session.rings().to_vec(), session.axes());
    let errors = with_bus(session.link(), &rings, |bus| latched(bus, &axes));
    assert_eq!(
        errors,
        Ok(BTreeMap::new()),
        "0504 of the check sequence (9.8)"
    );
    assert_eq!(all(&mut session), before);
}

/// ND21 9.7: a byte that is lost on the way back costs nothing, wherever it is.
#[test]
fn a_lost_byte_leaves_nothing_changed() {
    for byte in (100..2_400).step_by(767) {
        let rig = rig("");
        let mut session = session(&rig, "", Stalls::new(1, 0)).expect("a ring");
        let before = all(&mut session);
        play(&mut session, CHANGES);
        let _examined = session.examined();
        session.link().begin();
        let lost = PlacedFault::Link(1, LinkFault::Drop);
        session
            .link()
            .inner_mut()
            .inject(0, lost, Moment::Byte(byte));
        assert_eq!(put_back(&mut session, true), [""; 0], "byte {byte}");
        assert_eq!(session.link().unused_faults(), [""; 0], "byte {byte}");
        assert_eq!(all(&mut session), before, "byte {byte}");
    }
}

/// A ring behind a slow adapter still owes bytes when drives are read: they are let back first, and no drive is sent to the error mode for them.
#[test]
fn bytes_on_their_way_disturb_nothing() {
    let rig = rig("");
    let mut session = session(&rig, "", Stalls::new(1, 0)).expect("a ring");
    let before = all(&mut session);
    play(&mut session, CHANGES);
    let _examined = session.examined();
    session.link().begin();
    session.link().inner_mut().send_octets(0, &[SYNCO; 2_000]);
    let axes = session.axes();
    let rings = session.rings().to_vec();
    let disturbed = with_bus(session.link(), &rings, |bus| {
        latched(bus, &axes)?;
        Ok(bus.corrected_errors())
    });
    assert_eq!(disturbed, Ok(0));
    assert_eq!(put_back(&mut session, true), [""; 0]);
    assert_eq!(all(&mut session), before);
}

/// ND21 9.9: drives that are not reached are named with the command that puts back what they held.
#[test]
fn what_is_not_put_back_is_printed() {
    let rig = rig("");
    let mut session = session(&rig, "", Stalls::new(1, 0)).expect("a ring");
    play(
        &mut session,
        "title t\nring 3\nmaster write-eeprom 2 60 = 5A\n",
    );
    session
        .link()
        .inner_mut()
        .inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
    let end = session.end(false);
    assert!(end.is_unsafe());
    let [_, _, last] = &end.remarks[..] else {
        panic!("{end}");
    };
    let begin =
        "drive 2: nothing was put back; to put it back, `drivebench write 2 ee:60=0x00 FD80:2=0x";
    assert!(last.starts_with(begin), "{last}");
    assert!(
        last.ends_with(" Flags2=0x00 --move --rig busy.toml`"),
        "{last}"
    );
}

/// ND21 14.10.6, 10.4: without resets a scenario may begin while drives are in the error mode (9.7), and nothing can be read of them then.
#[test]
fn what_a_scenario_changes_behind_an_error_is_put_back() {
    let mut rig = rig("");
    rig.file.limits.allow_reset = false;
    let mut session = session(&rig, "", Stalls::new(1, 0)).expect("a ring");
    let before = all(&mut session);
    let mut run = Run::new(&mut session).expect("a run");
    for text in [
        "> 01\n",
        "recover\nwrite-io 1 = 01\nwrite-byte 0 scope_level = 44\n",
    ] {
        let entry = entry("t.scn", format!("title t\nring 3\n{text}"));
        run.play(&entry.plan, None).expect("a healthy ring");
    }
    drop(run);
    assert_eq!(session.end(false).remarks, [""; 0]);
    assert_eq!(all(&mut session), before);
}

/// ND21 10.5: a reset loses what is in RAM alone; what the limits do not let the bench write is printed.
#[test]
fn what_the_limits_deny_is_printed() {
    let rig = rig("max_speed = \"300rpm\"\n");
    let mut session = session(&rig, "", Stalls::new(1, 0)).expect("a ring");
    write(&mut session, 1, ram::NKP, 0x33);
    assert_eq!(
        play(&mut session, "title t\nring 3\n> 80\n< 80\n"),
        Verdict::Passed
    );
    let [remark] = &session.end(false).remarks[..] else {
        panic!("one drive");
    };
    assert!(remark.starts_with("drive 1: ring 1: "), "{remark}");
    let command = "; to put it back, `drivebench write 1 FF70=0x33 --move --rig busy.toml`";
    assert!(remark.ends_with(command), "{remark}");
}

/// What is printed is understood by `drivebench write`.
#[test]
fn commands_are_understood() {
    let mut places = places(Touched::Reset);
    places.extend([0x00, 0x47, 0xFF].map(Place::Eeprom));
    let mut count = 0;
    for place in places {
        let Ok((text, _)) = place.assignment(0x1234) else {
            assert_eq!(place, Place::Outputs);
            continue;
        };
        let found = assignments(std::slice::from_ref(&text));
        let found = found.unwrap_or_else(|problems| panic!("{text}: {problems}"));
        let [(range, _)] = &found[..] else {
            panic!("{text}");
        };
        let (memory, address, size) = match place {
            Place::Eeprom(cell) => (MemoryKind::Eeprom, cell.into(), 1),
            Place::Ram(address) if Place::width(address) == Width::Word => {
                (MemoryKind::Ram, address, 2)
            }
            Place::Ram(address) => (MemoryKind::Ram, address, 1),
            _ => (MemoryKind::Ram, ram::FLAGS2, 1),
        };
        assert_eq!(
            (range.memory, range.address(), range.size),
            (memory, address, size),
            "{text}"
        );
        count += 1;
    }
    assert!(count > 40, "{count}");
}
