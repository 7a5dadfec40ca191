//! Conversations of a thorough qualification with the EEPROM of a drive (ND21 14.10.5).

use super::*;

/// ND21 14.10.5: a thorough qualification writes each cell of an EEPROM and leaves what was there.
#[test]
fn a_march_over_an_eeprom_leaves_what_was_there() {
    let text = format!(
        "title x\nring {DRIVES}\ndrive 0..last model nd21\ndrive 1 eeprom 60 = 12 34 56\n\n> 80\n"
    );
    let source = Source {
        name: "ring".to_owned(),
        text: text.into(),
    };
    let ring = RingScenario::new(source, None).expect("no mistakes");
    let mut link = bench(&ring.plan);
    let byte_time = link.byte_time();
    let mut play = |entry: &RingScenario| {
        let mut events: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut events);
        let plan = &entry.plan;
        let outcome = play_one(&mut recording, plan, &as_they_are()).expect("it is played");
        assert_eq!(
            outcome.verdict,
            harness_bench::scenario::verdict::Verdict::Passed
        );
        Conversation::all(&events, byte_time, true)
    };
    let (drive, read) = dumps(DRIVES).swap_remove(1);
    let written = marches(DRIVES, drive, &play(&read));
    assert_eq!(written.len(), 5);
    let positions = &written[3].source.text;
    for line in ["write-eeprom 1 61 = CB", "write-eeprom 1 61 = 34"] {
        assert!(positions.contains(line), "{positions}");
    }
    for entry in &written {
        play(entry);
    }
    let after = marches(DRIVES, drive, &play(&read));
    for (before, after) in written.iter().zip(&after) {
        assert_eq!(before.source.text, after.source.text);
    }
}

/// ND21 14.10.5.4: `ProgParam` copies the parameters into the EEPROM, whatever they are.
#[test]
fn a_copy_of_parameters_that_is_not_made_is_found() {
    let copied = |link: &SimulatedLink| {
        let (drive, read) = dumps(DRIVES).swap_remove(1);
        let read = played_in_time(&read.plan, link);
        let mut written = marches(DRIVES, drive, &read);
        written.pop().expect("the copy").plan
    };
    let held = "drive 1 eeprom 3E = 12 34";
    assert_eq!(sighted_by(&[held], copied), None);
    let wrong = "drive 1 deviates prog-param-copies-nothing";
    let found = sighted_by(&[held, wrong], copied);
    assert_eq!(found, Some((Meant::Own(1), "14.10.5")));
}
