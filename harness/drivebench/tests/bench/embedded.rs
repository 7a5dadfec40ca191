//! The crate as another program uses it: a mistake names its place.

use harness::{Drives, Error, Scenario};

#[test]
fn a_mistake_names_the_line() {
    let text = "title A mistake\nring 2\nread-byte 1 FF322 = 5A\n";
    let Err(Error::Mistake(why)) = Scenario::parse("mine.scn", text) else {
        panic!("a mistake");
    };
    assert!(why.starts_with("mine.scn:3: "), "{why}");
    let scenario = Scenario::read("9.7-parity-error").expect("a built-in scenario");
    let Err(Error::Mistake(why)) = scenario.for_drives(3) else {
        panic!("a ring of 100 drives only");
    };
    assert!(why.contains("ring"), "{why}");
    let Err(Error::NotFound(why)) = Scenario::read("no-such-scenario") else {
        panic!("there is none");
    };
    assert!(why.contains("no-such-scenario"), "{why}");
}

#[test]
fn a_cell_a_drive_and_a_unit_that_are_wrong_are_named() {
    let drives = Drives::simulated(2, "").expect("a ring");
    for (asked, word) in [
        (drives.read(7, "nist").err(), "no drive 7"),
        (drives.read(0, "nsit").err(), "nist"),
        (drives.write(0, "nsoll=1500").err(), "unit"),
        (drives.write(0, "nsoll=1500V").err(), "rpm"),
    ] {
        let Some(Error::Mistake(why)) = asked else {
            panic!("a mistake: {asked:?}");
        };
        assert!(why.contains(word), "{why}");
    }
    drives.close().expect("simulated drives");
}
