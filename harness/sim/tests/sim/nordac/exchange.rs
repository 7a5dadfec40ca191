//! Data_Exchange through the whole drive: parameter channel, Sync, Freeze, Clear_Data, watchdog, restart of the module.

use super::common::{Desk, setup, with};
use harness_proto::time::Span;

/// No task and a control word with bit 10 = 0: nothing is taken over.
const IDLE: &str = "00 00 00 00 00 00 00 00 00 00 00 00";
const RS: &str = "10 02 08 03 0D 16";

/// The parameter channel of a reply, as the manual writes it.
fn answer(reply: &str) -> String {
    let octets: Vec<&str> = reply.split(' ').skip(1).take(8).collect();
    octets
        .chunks(2)
        .map(<[&str]>::concat)
        .collect::<Vec<_>>()
        .join(" ")
}

/// Status word and main actual value of a reply under PPO1.
fn words(reply: &str) -> String {
    let octets: Vec<&str> = reply.split(' ').skip(9).take(4).collect();
    octets
        .chunks(2)
        .map(<[&str]>::concat)
        .collect::<Vec<_>>()
        .join(" ")
}

/// Process data of PPO1: a task, a control word, a setpoint, all in hexadecimal digits.
fn ppo1(task: &str, stw: &str, hsw: &str) -> String {
    let digits: String = [task, stw, hsw].concat().replace(' ', "");
    let octets: Vec<&str> = (0..digits.len())
        .step_by(2)
        .map(|at| &digits[at..at + 2])
        .collect();
    octets.join(" ")
}

fn started(interface: i32) -> Desk {
    let mut desk = Desk::new(&setup(8, &[(1621, interface)]));
    desk.start_with("B0 00 00 0B 75 31 00", "F3 F1");
    desk
}

/// The printed and derived examples of section 8 under PPO1: the answer comes two exchanges later.
#[test]
fn printed_tasks() {
    for (task, expected) in [
        ("14B2 0000 0000 0000", "14B2 0000 0000 0064"),
        ("24B5 0200 0000 01F4", "14B5 0200 0000 01F4"),
        ("744E 0200 0000 0000", "744E 0200 0000 0000"),
        ("244E 0200 0000 03E8", "744E 0200 0000 0000"),
        ("670E 0900 0000 0000", "470E 0900 0000 0000"),
        ("9709 0000 0000 0000", "6709 0000 0000 0007"),
        ("1001 0000 0000 0000", "7001 0000 0000 0000"),
        ("44B2 0000 0000 0000", "74B2 0000 0000 0009"),
        ("A4B2 0000 0000 0000", "74B2 0000 0000 00C9"),
    ] {
        let mut desk = started(0);
        let data = ppo1(task, "0000", "0000");
        let answers: Vec<_> = (0..4).map(|_| answer(&desk.inputs(&data))).collect();
        let none = "0000 0000 0000 0000";
        assert_eq!(answers, [none, none, expected, expected], "{task}");
    }
    // A double word needs PPO2.
    let mut all = setup(8, &[(1622, 1)]);
    all.posicon = true;
    let mut desk = Desk::new(&all);
    desk.start("F3 F5");
    let data = "66 B4 15 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";
    let answers: Vec<_> = (0..3).map(|_| answer(&desk.inputs(data))).collect();
    assert_eq!(answers[2], "56B4 1500 0000 0000");
}

/// The former answer is repeated until the next one is due; a new task replaces the answer and not the effect.
#[test]
fn answers_in_order() {
    let mut desk = started(0);
    let read = |number: &str| ppo1(&format!("{number} 0000 0000 0000"), "0000", "0000");
    let (accel, decel) = (read("14B2"), read("14B3"));
    let change = ppo1("24B3 0000 0000 00C8", "0000", "0000");
    let mut seen = Vec::new();
    for data in [
        &accel, &accel, &accel, &change, &accel, &accel, &decel, &decel, &decel,
    ] {
        seen.push(answer(&desk.inputs(data))[..4].to_owned());
    }
    assert_eq!(
        seen,
        [
            "0000", "0000", "14B2", "14B2", "14B2", "14B2", "14B2", "14B2", "14B3"
        ]
    );
    let data = desk.inputs(&decel);
    assert_eq!(
        answer(&data),
        "14B3 0000 0000 00C8",
        "the change was executed"
    );
    // No task has no answer, and it comes as late.
    let seen: Vec<_> = (0..3)
        .map(|_| answer(&desk.inputs(IDLE))[..4].to_owned())
        .collect();
    assert_eq!(seen, ["14B3", "14B3", "0000"]);
}

/// `pkw-latency`, `pzd-latency` and `task-new-when`.
#[test]
fn open_points_of_the_exchange() {
    for latency in 1..6_usize {
        let settings = with(setup(8, &[]), "pkw-latency", &latency.to_string());
        let mut desk = Desk::new(&settings);
        desk.start("F3 F1");
        let data = ppo1("14B2 0000 0000 0000", "0000", "0000");
        let first = (0..10).position(|_| answer(&desk.inputs(&data)) != "0000 0000 0000 0000");
        assert_eq!(first, Some(latency));
        let settings = with(setup(8, &[(1621, 2)]), "pzd-latency", &latency.to_string());
        let mut desk = Desk::new(&settings);
        desk.start("F3 F1");
        let data = ppo1("0000 0000 0000 0000", "047E", "0000");
        let first = (0..10).position(|_| words(&desk.inputs(&data)).starts_with("0B31"));
        assert_eq!(first, Some(latency));
    }
    for (word, value) in [("any-byte", "00C8"), ("pke-or-ind", "0096")] {
        let mut desk = Desk::new(&with(setup(8, &[]), "task-new-when", word));
        desk.start("F3 F1");
        for pwe in ["0096", "00C8"] {
            let data = ppo1(&format!("24B2 0000 0000 {pwe}"), "0000", "0000");
            for _ in 0..3 {
                desk.exchange(&data);
            }
        }
        let last = desk.inputs(&ppo1("24B2 0000 0000 00C8", "0000", "0000"));
        assert_eq!(answer(&last), format!("14B2 0000 0000 {value}"));
    }
}

/// The start-up of section 6: 0B70, 0B31, 0F37.
#[test]
fn printed_start() {
    let mut desk = started(2);
    let none = "0000 0000 0000 0000";
    assert_eq!(
        words(&desk.inputs(&ppo1(none, "047E", "0000"))),
        "0B70 0000"
    );
    assert_eq!(
        words(&desk.inputs(&ppo1(none, "047F", "2000"))),
        "0B31 0000"
    );
    desk.wait(Span::from_millis(5_000));
    assert_eq!(
        words(&desk.inputs(&ppo1(none, "047F", "2000"))),
        "0F37 2000"
    );
    // The words of Clear_Data do not stop the motor.
    desk.control(0x02, 0);
    assert_eq!(words(&desk.inputs(IDLE)), "0F37 2000");
    // OFF2 shows with the next reply.
    desk.exchange(&ppo1(none, "047D", "0000"));
    assert_eq!(words(&desk.inputs(IDLE)), "0B60 0000");
}

/// Sync keeps the outputs back, the parameter channel included; Freeze keeps the inputs.
#[test]
fn sync_and_freeze_reach_the_inverter() {
    let none = "0000 0000 0000 0000";
    let mut desk = started(2);
    desk.control(0x20, 0);
    desk.exchange(&ppo1("14B2 0000 0000 0000", "047E", "0000"));
    for _ in 0..4 {
        let reply = desk.inputs(&ppo1("14B2 0000 0000 0000", "047E", "0000"));
        assert_eq!(
            (answer(&reply).as_str(), words(&reply).as_str()),
            (none, "0B70 0000")
        );
    }
    desk.control(0x20, 0);
    let reply = desk.inputs(IDLE);
    assert_eq!(
        (answer(&reply).as_str(), words(&reply).as_str()),
        (none, "0B31 0000")
    );
    assert_eq!(answer(&desk.inputs(IDLE)), "14B2 0000 0000 0064");
    desk.control(0x10, 0);
    desk.control(0x08, 0);
    desk.exchange(&ppo1(none, "047F", "0000"));
    assert_eq!(words(&desk.inputs(IDLE)), "0B31 0000", "frozen");
    assert_eq!(
        &desk.srd(56, "")[27 + 24..27 + 29],
        "0B 37",
        "RD_Inp reads live"
    );
    desk.control(0x08, 0);
    assert_eq!(words(&desk.inputs(IDLE)), "0B37 0000", "the next Freeze");
    desk.control(0x04, 0);
    desk.exchange(&ppo1(none, "047D", "0000"));
    assert_eq!(words(&desk.inputs(IDLE)), "0B60 0000");

    let frozen = with(setup(8, &[(1621, 2)]), "rd-inp-under-freeze", "frozen");
    let mut desk = Desk::new(&frozen);
    desk.start_with("B0 00 00 0B 75 31 00", "F3 F1");
    desk.control(0x08, 0);
    desk.exchange(&ppo1(none, "047E", "0000"));
    assert_eq!(&desk.srd(56, "")[27 + 24..27 + 29], "0B 70");
}

/// The watchdog leads to Wait_Prm and leaves the motor alone, unless the drive is to stop for it.
#[test]
fn watchdog_and_motor() {
    for (word, status) in [("keep", "0F37 2000"), ("stop", "0B70 0000")] {
        let mut desk = Desk::new(&with(setup(8, &[(1621, 2)]), "watchdog-action", word));
        desk.start_with("88 0A 0A 0B 75 31 00", "F3 F1");
        let none = "0000 0000 0000 0000";
        desk.exchange(&ppo1(none, "047E", "2000"));
        desk.exchange(&ppo1(none, "047F", "2000"));
        desk.wait(Span::from_millis(5_000));
        assert_eq!(desk.exchange(IDLE), RS);
        desk.start("F3 F1");
        let reply = words(&desk.inputs(IDLE));
        if word == "keep" {
            assert_eq!(reply, status);
        } else {
            assert!(reply.ends_with("0000"), "{reply}");
        }
    }
}

/// A change of 1619, 1622 or 1624 restarts the module: its own exchange is still answered.
#[test]
fn restart_of_the_module() {
    for (task, address) in [
        ("2653 0000 0000 0001", 8),
        ("2656 0000 0000 0002", 8),
        ("2658 0000 0000 0009", 9),
    ] {
        let mut desk = started(0);
        let data = ppo1(task, "0000", "0000");
        assert!(desk.exchange(&data).starts_with("68"), "{task}");
        let reply = desk.exchange(&data);
        assert_eq!(reply, if address == 8 { RS } else { "" }, "{task}");
        desk.slave = address;
        assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31", "{task}");
    }
    // The value that it has already restarts nothing.
    let mut desk = started(0);
    for _ in 0..3 {
        desk.exchange(&ppo1("2658 0000 0000 0008", "0000", "0000"));
    }
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31");
    // At power-up only, if the drive is such a one.
    let mut desk = Desk::new(&with(setup(8, &[]), "reinit", "at-power-up"));
    desk.start("F3 F1");
    for _ in 0..3 {
        desk.exchange(&ppo1("2658 0000 0000 0009", "0000", "0000"));
    }
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31");
    let now = desk.now();
    desk.drive().set_power(now, false);
    desk.drive().set_power(now, true);
    assert_eq!(desk.diagnosis(), "");
    desk.slave = 9;
    assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31");
}

/// Module and inverter apart: inputs stay, outputs are lost, fault 10 comes after 100 ms.
#[test]
fn module_and_inverter_apart() {
    let none = "0000 0000 0000 0000";
    let mut desk = started(2);
    desk.exchange(&ppo1(none, "047E", "0000"));
    desk.exchange(&ppo1(none, "047F", "2000"));
    let now = desk.now();
    desk.drive().set_link(now, true);
    let kept = words(&desk.inputs(IDLE));
    desk.wait(Span::from_millis(200));
    assert_eq!(words(&desk.inputs(&ppo1(none, "047D", "0000"))), kept);
    let now = desk.now();
    desk.drive().set_link(now, false);
    assert_eq!(
        &words(&desk.inputs(IDLE))[..4],
        "0A38",
        "fault 10, and OFF2 was lost"
    );
}
