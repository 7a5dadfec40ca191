//! Each deviation shows in a fixed conversation; a wrapper without a deviation changes nothing.

use super::common::{Desk, octets, setup};
use harness_proto::nordac::pkw::Index;
use harness_proto::profibus::BusRate;
use harness_proto::profibus::fdl::FrameControl;
use harness_proto::time::{Instant, Span};
use harness_sim::fault::Flips;
use harness_sim::nordac::deviation::{DEVIATIONS, Deviant, Deviation, MASTER_DEVIATIONS};
use harness_sim::nordac::{Drive, InverterSetup};
use harness_sim::octet_segment::{LineStation, Octet, Wish};
use harness_sim::record::LineByte;
use std::collections::BTreeSet;

/// With PPO1 and interface 2. A line is one of: `>` octets, with `p3`, `s3`, `g3` for a wrong parity bit, a wrong stop bit and a gap at octet 3;
/// `soon` octets behind 20 idle bits; `srd` SAP data; `dx` data; `control` command group; `all` command group, to all stations;
/// `fc` FC, SAP and data; `master` number; `wait` milliseconds; `lost`; `found`; `cause` fault.
const FIRST: &str = "
    > 10 08 02 49 53 16
    > 10 7F 02 4D CE 16
    > 10 09 02 49 54 16
    > 10 08 02 49 53 16 p3
    > 10 08 02 49 53 16 s3
    > 10 08 02 49 53 16 g3
    > 10 08 02 49 54 16
    > 10 08 02 49 53 17
    > 68 05 06 68 88 82 6C 3C 3E F0 16
    > 68 05 05 69 88 82 6C 3C 3E F0 16
    > 68 05 05 68 88 82 6C BC 3E 70 16
    > 10 08 02 C9 D3 16
    soon 10 08 02 49 53 16
    srd 60
    dx 00 00 00 00 00 00 00 00 00 00 00 00
    fc 45 0
    srd 55 08 75 31 00
    srd 59
    > 68 04 04 68 88 02 6C 3C 32 16
    srd 61 80 00 00 0B 31 75 00
    srd 60
    srd 61 80 00 00 0B 75 31
    srd 60
    srd 61 40 00 00 0B 75 31 00
    srd 61 80 00 00 0B 75 31 00 01
    srd 60
    srd 61 88 00 01 0B 75 31 00
    srd 60
    srd 61 80 00 00 14 75 31 00
    srd 60
    > 10 08 02 49 53 16
    srd 61 80 00 00 00 75 31 00
    > 10 08 02 49 53 16
    dx 00 00 00 00 00 00 00 00 00 00 00 00
    srd 62 F3 F5
    srd 60
    srd 61 80 00 00 0B 75 31 00
    srd 62 F3 F1 00
    srd 60
    srd 61 C0 00 00 0B 75 31 00
    srd 60
    srd 61 B0 00 00 0B 75 31 02
    srd 62 F3 F1
    srd 60
    fc 6D 60
    fc 5D 59
    fc 5D 60
    fc 7D 61 80 00 00 0B 00 00 00
    fc 7D 61 B0 00 00 0B 75 31 02
    fc 5D 60
    fc 6D 61 B0 00 00 0B 75 31 02
    srd 61 B0 00 00 0B 75 31 02
    srd 62 F3 F1
    master 3
    dx 00 00 00 00 00 00 00 00 00 00 00 00
    srd 56
    srd 57
    srd 61 80 00 00 0B 75 31 00
    fc 6D 60
    master 2
    fc 7D 59
    master 3
    fc 7D 60
    master 2
    srd 60
    dx 00 00 00 00 00 00 00 00 04 7E 11 11
    srd 56
    srd 57
    master 3
    control 20 00
    master 2
    srd 60
    control 20 04
    srd 60
    all 20 00
    srd 60
    dx 00 00 00 00 00 00 00 00 04 7E 22 22
    srd 57
    control 30 00
    srd 57
    srd 60
    control 08 00
    srd 60
    dx 00 00 00 00 00 00 00 00 04 7F 22 22
    dx 00 00 00 00 00 00 00 00 04 7F 22 22
    control 0C 00
    srd 60
    control 02 00
    srd 57
    srd 58 20 00
    srd 60
    control 10 00
    dx 00 00 00 00
    srd 60
    srd 61 88 02 05 0B 75 31 00
    srd 62 F3 F1
    srd 60
    wait 60
    srd 60
    wait 120
    srd 60
    srd 61 80 00 00 0B 75 31 00
    srd 62 F3 F1
    srd 61 40 00 00 0B 75 31 00
    srd 60
    srd 61 80 00 00 0B 75 31 00
    srd 62 F3 F1
    dx 00 00 00 00 00 00 00 00 04 7D 00 00
    dx 00 00 00 00 00 00 00 00 04 7F 20 00
    dx 00 00 00 00 00 00 00 00 04 7F 20 00
    dx 00 00 00 00 00 00 00 00 04 7E 20 00
    dx 00 00 00 00 00 00 00 00 04 77 20 00
    dx 00 00 00 00 00 00 00 00 04 77 20 00
    dx 00 00 00 00 00 00 00 00 04 7F 20 00
    wait 500
    dx 00 00 00 00 00 00 00 00 04 6F 20 00
    wait 20
    dx 00 00 00 00 00 00 00 00 04 5F 20 00
    wait 500
    dx 00 00 00 00 00 00 00 00 04 3F 20 00
    wait 500
    dx 00 00 00 00 00 00 00 00 04 7F 20 00
    wait 3000
    dx 00 00 00 00 00 00 00 00 00 00 00 00
    wait 500
    dx 00 00 00 00 00 00 00 00 14 7F 10 00
    wait 6000
    dx 00 00 00 00 00 00 00 00 1C 7F 10 00
    wait 6000
    dx 00 00 00 00 00 00 00 00 04 7F F0 00
    wait 6000
    dx 00 00 00 00 00 00 00 00 44 7F 10 34
    wait 6000
    dx 00 00 00 00 00 00 00 00 84 7F 10 34
    wait 6000
    dx 00 00 00 00 00 00 00 00 04 7E 10 34
    wait 500
    dx 00 00 00 00 00 00 00 00 04 7F 10 34
    wait 5000
    dx 00 00 00 00 00 00 00 00 04 7B 10 34
    wait 10
    dx 00 00 00 00 00 00 00 00 04 7B 10 34
    wait 500
    dx 00 00 00 00 00 00 00 00 04 7E 10 34
    dx 00 00 00 00 00 00 00 00 04 7F 10 34
    wait 500
    dx 00 00 00 00 00 00 00 00 04 7D 10 34
    dx 00 00 00 00 00 00 00 00 04 7D 10 34
    cause 3
    dx 00 00 00 00 00 00 00 00 04 7E 10 34
    cause 0
    dx 00 00 00 00 00 00 00 00 04 FE 10 34
    dx 00 00 00 00 00 00 00 00 04 7E 10 34
    task 14 B2 00 00 00 00 00 00
    task 1C B2 00 07 00 00 00 00
    task 24 B2 02 00 00 00 00 C8
    task 14 B2 02 00 00 00 00 00
    task 14 B2 00 00 00 00 00 00
    task 67 0E 08 00 00 00 00 00
    task 67 09 07 00 00 00 00 00
    task 67 0E 02 00 00 00 00 00
    task 97 09 00 00 00 00 00 00
    task A4 B2 00 00 00 00 00 00
    task 44 B2 00 00 00 00 00 00
    task 24 B2 00 00 00 00 00 00
    lost
    dx 00 00 00 00 00 00 00 00 04 7E 10 34
    srd 60
    dx 00 00 00 00 00 00 00 00 04 7E 10 34
    found
    srd 60
    wait 1000
    srd 60
    srd 60
    srd 60
    srd 60
    srd 60
    srd 60
";

/// With PPO2, interface 3 and PosiCon.
const SECOND: &str = "
    srd 61 80 00 00 0B 75 31 00
    srd 62 F3 F5
    dx 00 00 00 00 00 00 00 00 04 7E 20 00 00 00 08 00 00 00 00 00
    dx 00 00 00 00 00 00 00 00 04 7F 20 00 00 00 08 00 00 00 00 00
    wait 6000
    dx 00 00 00 00 00 00 00 00 04 7F 20 00 00 00 08 00 00 00 00 00
    dx 66 B4 14 00 00 00 00 00 04 7F 20 00 00 00 08 00 00 00 00 00
    dx 66 B4 14 00 00 00 00 00 04 7F 20 00 00 00 08 00 00 00 00 00
    dx 66 B4 14 00 00 00 00 00 04 7F 20 00 00 00 08 00 00 00 00 00
    dx 66 B4 14 00 00 00 00 00 04 7F 20 00 00 00 08 00 00 00 00 00
    srd 59
";

/// Plays a conversation; gives what the drive has sent.
fn conversation<D: LineStation>(
    desk: &mut Desk<D>,
    script: &str,
    poke: fn(&mut D, Instant, &str),
) -> Vec<LineByte> {
    for line in script
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
    {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        let number = |text: &str| text.parse().expect("a number");
        match word {
            ">" | "soon" => raw(desk, word, rest),
            "srd" => {
                let (sap, data) = rest.split_once(' ').unwrap_or((rest, ""));
                desk.srd(sap.parse().expect("a SAP"), data);
            }
            "dx" => drop(desk.exchange(rest)),
            "task" => {
                for _ in 0..4 {
                    desk.exchange(&format!("{rest} 00 00 00 00"));
                }
            }
            "control" => {
                let pair = octets(rest);
                desk.control(pair[0], pair[1]);
            }
            "all" => {
                let pair = octets(rest);
                let slave = std::mem::replace(&mut desk.slave, 127);
                desk.control(pair[0], pair[1]);
                desk.slave = slave;
            }
            "fc" => {
                let words: Vec<&str> = rest.split(' ').collect();
                let fc = octets(words[0])[0];
                let sap: u8 = words[1].parse().expect("a SAP");
                let data = octets(&words[2..].join(" "));
                desk.request(FrameControl(fc), (sap > 0).then_some(sap), &data);
            }
            "master" => desk.master = rest.parse().expect("an address"),
            "wait" => drop(desk.wait(Span::from_millis(number(rest)))),
            _ => {
                let now = desk.now();
                poke(desk.drive(), now, line);
            }
        }
    }
    desk.line.take_record(1)
}

fn raw<D: LineStation>(desk: &mut Desk<D>, word: &str, rest: &str) {
    let (marks, digits): (Vec<&str>, Vec<&str>) = rest
        .split(' ')
        .partition(|word| word.starts_with(['p', 's', 'g']));
    let mut all: Vec<Octet> = octets(&digits.join(" "))
        .into_iter()
        .map(Octet::from)
        .collect();
    for mark in marks {
        let place: usize = mark[1..].parse().expect("an octet");
        let octet = &mut all[place - 1];
        match &mark[..1] {
            "p" => {
                octet.flips = Flips {
                    parity: true,
                    ..Flips::default()
                }
            }
            "s" => {
                octet.flips = Flips {
                    stop: true,
                    ..Flips::default()
                }
            }
            _ => octet.pause = desk.rate.bit_time(),
        }
    }
    if word == "soon" {
        let ready = desk.now();
        desk.host().send(
            Wish {
                ready,
                idle_bits: 33,
            },
            vec![Octet::from(0xE5)],
        );
        desk.host().send(
            Wish {
                ready,
                idle_bits: 20,
            },
            all,
        );
        desk.wait(Span::from_millis(5));
    } else {
        desk.say(all);
    }
}

fn poke(drive: &mut Drive, at: Instant, line: &str) {
    match line.split_once(' ') {
        Some((_, code)) => {
            let code = code.parse().expect("a fault");
            drive.advance(at);
            drive
                .inverter_mut()
                .set_cause(at, (code != 0).then_some(code));
        }
        None => drive.set_link(at, line == "lost"),
    }
}

fn setups() -> [(InverterSetup, &'static str); 2] {
    let mut first = setup(8, &[(1621, 2), (1202, 40), (1203, 40)]);
    for (set, raw) in [(1, 20), (2, 60)] {
        first
            .parameters
            .push((1202, Index { element: 0, set }, raw));
        first
            .parameters
            .push((1205, Index { element: 0, set }, 500 + raw));
    }
    let mut second = setup(8, &[(1621, 3), (1622, 1), (1517, 2), (1504, 1)]);
    second.posicon = true;
    second
        .parameters
        .push((1716, Index { element: 5, set: 0 }, 70_000));
    [(first, FIRST), (second, SECOND)]
}

fn right() -> Vec<LineByte> {
    let all = setups().into_iter().flat_map(|(setup, script)| {
        let mut desk = Desk::new(&setup);
        conversation(&mut desk, script, |drive, at, line| poke(drive, at, line))
    });
    all.collect()
}

fn with(deviation: Option<&'static Deviation>) -> Vec<LineByte> {
    let all = setups().into_iter().flat_map(|(setup, script)| {
        let drive = Drive::new(&setup, BusRate::K500, Instant::START);
        let deviant = Deviant::new(drive, deviation);
        let mut desk = Desk::over(BusRate::K500, std::iter::once(deviant));
        conversation(&mut desk, script, |deviant, at, line| {
            poke(deviant.drive_mut(), at, line);
        })
    });
    all.collect()
}

/// Names are unique, and there are at least 50 deviations of the drive and 15 of the master.
#[test]
fn the_tables() {
    let names = BTreeSet::from_iter(DEVIATIONS.names());
    let count = DEVIATIONS.all().count();
    assert_eq!(names.len(), count);
    assert!(count >= 50, "{count}");
    let masters = BTreeSet::from_iter(MASTER_DEVIATIONS.names());
    assert!(masters.len() == MASTER_DEVIATIONS.all().count() && masters.len() >= 15);
    for (name, about) in DEVIATIONS
        .all()
        .map(|d| (d.name, d.about))
        .chain(MASTER_DEVIATIONS.all().map(|d| (d.name, d.about)))
    {
        let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        assert!(name.bytes().all(plain), "{name}");
        assert!(about.ends_with('.') && about.len() < 120, "{name}: {about}");
    }
    assert!(DEVIATIONS.named("no-off2").is_some() && DEVIATIONS.named("none").is_none());
    assert!(MASTER_DEVIATIONS.named("master-gaps").is_some());
}

#[test]
fn each_deviation_of_the_drive_shows() {
    let right = right();
    assert!(right.len() > 2_000, "{}", right.len());
    assert!(with(None) == right, "a wrapper without a deviation");
    let hidden: Vec<_> = DEVIATIONS
        .all()
        .filter(|d| with(Some(d)) == right)
        .map(|d| d.name)
        .collect();
    assert_eq!(hidden, [""; 0], "these do not show");
}
