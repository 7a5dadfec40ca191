//! What may have been set before the first telegram of a capture: each of it explains replies of a right slave, and excuses no wrong one.
//!
//! 1. The exchange, with each PPO type: Chk_Cfg was not heard (3.1).
//! 2. An answer that is shown, one that is due, and a value of the parameter that the capture changes (3.4.1).
//! 3. A motor that turns, or stands still on a ramp (3.3).
//! 4. Parameters: scales, PZD4, the parameter set (3.2.4, 3.2.6).
//! 5. A fault, and its cause (5.7).
//! 6. Freeze, Sync, and Clear_Data (EN 2).
//! 7. The DP watchdog, which expires (EN 2).
//! 8. Prm_Fault and Cfg_Fault (EN 2).
//! 9. A diagnosis that waits (2.6).
//! 10. min T_SDR (EN 2).
//! 11. User parameters of Set_Prm, which a slave may take.
//! 12. Another PPO type or address: the module has restarted, or restarts while it is heard (2.5.1).
//! 13. Another master, which has locked the slave (EN 2).
//! 14. The frame count bit, and a request that repeats one from before (EN 1).

use super::judge;
use super::tests::{begun_at, scenarios, trace};
use harness_bench::capture::runs::runs;
use harness_bench::scenario::source::Source;
use harness_proto::profibus::fdl::check_sum;
use harness_proto::time::Span;

/// A line `ask` becomes a request of these octets from DA on.
fn telegram(line: &str) -> String {
    let Some(octets) = line.strip_prefix("ask ") else {
        return line.to_owned();
    };
    let body = octets.split(' ').map(|octet| u8::from_str_radix(octet, 16));
    let body: Vec<u8> = body.collect::<Result<_, _>>().expect("octets");
    let length = body.len();
    let sum = check_sum(&body);
    format!("> 68 {length:02X} {length:02X} 68 {octets} {sum:02X} 16\nwait 3ms")
}

/// Plays steps with slave 8, and judges what follows the line `---`, and the same from each telegram on: of a right slave, and of one that deviates.
#[track_caller]
fn check(header: &str, steps: &str, deviation: &str) {
    let (before, behind) = steps.split_once("---\n").expect("two parts");
    let play = |steps: &str, more: &str| {
        let steps: Vec<_> = steps.lines().map(telegram).collect();
        let text = format!(
            "title   a capture\nsource  nordac EN 1\nbus     nordac\nslave 8{header}\n{more}\n{}\n",
            steps.join("\n")
        );
        let source = Source::from_bytes("begun".into(), text.into_bytes()).expect("a text");
        trace(&source, "")
    };
    let judged = |more: &str| {
        let first = match before {
            "" => 0,
            _ => runs(&play(before, more)).len(),
        };
        let trace = play(&(before.to_owned() + behind), more);
        let begins = runs(&trace).into_iter().skip(first);
        let all = begins.map(|run| begun_at(&trace, run.octets[0].at));
        let all = all.map(|trace| judge(&trace, &[8], Span::ZERO));
        all.collect::<Vec<_>>()
    };
    for right in judged("") {
        let mut doubts = right.doubts;
        // Of the last telegrams alone.
        doubts.retain(|doubt| doubt != "slave 8: no reply of it was compared");
        assert_eq!((right.breaches, doubts), (Vec::new(), Vec::new()));
    }
    let wrong = judged(&format!("slave 8 deviates {deviation}"));
    assert!(
        !wrong[0].breaches.is_empty(),
        "{deviation}: {:#?}",
        wrong[0]
    );
}

const PRM: &str = "ask 88 82 4C 3D 3E 80 00 00 0B 75 31 00";
const DIAG: &str = "ask 88 82 4C 3C 3E";
const CFG: &str = "ask 88 82 4C 3B 3E";

/// NORDAC 3.1: the status words of each PPO type.
#[test]
fn exchange() {
    for (ppo, deviation) in [
        ("1", "pzd-low-byte-first"),
        ("2", "pzd5-not-0"),
        ("3", "pzd-low-byte-first"),
        ("4", "pzd5-not-0"),
        ("1", "answers-without-number"),
        ("2", "answers-without-number"),
    ] {
        let task = if ["1", "2"].contains(&ppo) {
            "read 8 1202\nread 8 1203\nread 8 1204\n"
        } else {
            ""
        };
        let steps = format!("start 8\nexchange 8\n---\nexchange 8 STW=047E\nexchange 8\n{task}");
        check(&format!(" ppo {ppo}"), &steps, deviation);
    }
}

/// NORDAC 3.4.1.
#[test]
fn answer() {
    for before in [
        "read 8 1801",
        "read 8 1202",
        "write 8 1202 = 90",
        "read 8 1801\nexchange 8 PKW=14B3000000000000",
        "write 8 1202 = 90\nexchange 8 PKW=24B2000000000070",
    ] {
        let behind = "write 8 1202 = 101\nwrite 8 1203 = 102\nread 8 1204\nwrite 8 1205 = 703\n";
        let steps = format!("start 8\n{before}\n---\n{behind}");
        check(" ppo 2", &steps, "values-of-one-more");
        check("", &steps, "values-of-one-more");
    }
}

/// NORDAC 3.3, 5.7.
#[test]
fn motor() {
    let on = "start 8\non 8\nexchange 8 HSW=50%\nwait 1s\n";
    let behind = "exchange 8\nexchange 8\noff 8\n";
    let header = "\nslave 8 parameter 1621 = 2";
    for steps in [
        format!("{on}---\n{behind}"),
        format!("{on}exchange 8 STW=045F\n---\n{behind}"),
        format!("{on}exchange 8 STW=047B\n---\n{behind}"),
        format!("{on}exchange 8 STW=0C7F HSW=-50%\n---\n{behind}"),
    ] {
        check(header, &steps, "directions-exchanged");
    }
    let fault = format!("{on}slave 8 fault 5 on\n---\n{behind}slave 8 fault off\nacknowledge 8\n");
    check(header, &fault, "no-fault-bit");
}

/// NORDAC 3.2.1, 3.2.4, 3.2.6.
#[test]
fn parameters() {
    let header = " ppo 2\nslave 8 parameter 1621 = 3\nslave 8 parameter 1205.2 = 1000\nslave 8 parameter 1504 = 1\nslave 8 parameter 1517 = 2";
    let steps = "start 8\non 8\nexchange 8 STW=447F HSW=50% PZD4=10%\nwait 1s\n---\nexchange 8\nexchange 8 STW=047F\nwait 1s\nexchange 8\n";
    check(header, steps, "pzd5-not-0");
}

/// EN 2.
#[test]
fn group() {
    let exchange =
        |word: &str, task: &str| format!("ask 08 02 4C {task} 00 00 00 00 00 00 {word} 00 00\n");
    let [idle, ready] = ["04 00", "04 7E"].map(|word| exchange(word, "14 B2"));
    let other = exchange("04 7E", "14 B3");
    for (status, command, end) in [("90", "08", "04"), ("A0", "20", "10"), ("80", "02", "00")] {
        let prm = PRM.replace("80", status);
        let [begin, end] = [command, end].map(|octet| format!("ask FF 82 46 3A 3E {octet} 00\n"));
        let cfg = "ask 88 82 4C 3E 3E F3 F1\n";
        let steps = format!(
            "{prm}\n{cfg}{idle}{idle}{begin}{other}---\n{ready}{ready}{DIAG}\n{end}{ready}{ready}{ready}{other}{other}{other}"
        );
        check("", &steps, "pzd-low-byte-first");
    }
}

/// EN 2, NORDAC 2.6: watchdog, faults of parameters and configuration, a diagnosis that waits, min T_SDR, user parameters, another master.
#[test]
fn services() {
    let start = "start 8\nexchange 8\n";
    let wrong = PRM.replace("75", "76");
    let cfg = "ask 88 82 4C 3E 3E F1";
    let late = PRM.replace("0B", "64");
    for (header, before, behind, deviation) in [
        (
            "",
            "start 8 watchdog 100ms\nexchange 8\n",
            format!("exchange 8\nwait 150ms\nexchange 8\n{DIAG}\n{start}"),
            "hides-prm-req",
        ),
        (
            "",
            &format!("{wrong}\n"),
            format!("{DIAG}\n{start}"),
            "hides-prm-req",
        ),
        (
            "",
            &format!("{PRM}\n{cfg}\n"),
            format!("{DIAG}\n{start}"),
            "hides-prm-req",
        ),
        (
            "",
            &format!("{start}slave 8 link lost\n"),
            format!("exchange 8\n{DIAG}\nexchange 8\n"),
            "extension-bit-1",
        ),
        (
            "",
            &format!("{late}\n{cfg} F3\n"),
            format!("{DIAG}\n{start}"),
            "addresses-exchanged",
        ),
        (
            "\nslave 8 property user-prm = ignore",
            &format!("{PRM} 00\n"),
            format!("{DIAG}\n{DIAG}\n"),
            "bit-2-of-diagnosis",
        ),
        (
            "",
            &format!(
                "{}\n{}\n",
                PRM.replace("82", "83"),
                cfg.replace("82 4C 3E 3E", "83 4C 3E 3E F3")
            ),
            format!("{DIAG}\n{PRM}\n{cfg}\n{DIAG}\n"),
            "refuses-with-saps",
        ),
    ] {
        check(header, &format!("{before}---\n{behind}"), deviation);
    }
}

/// NORDAC 2.5.1: after another PPO type or address the module forgets the frame count bit and the exchange.
#[test]
fn restart() {
    let exchange = |fc: &str| format!("ask 08 02 {fc} 26 56 00 00 00 00 00 02 04 00 00 00\n");
    let [counted, again, other] = ["6C", "7C", "5C"].map(exchange);
    for behind in [
        format!("{counted}{CFG}\n{DIAG}\n"),
        format!("{counted}{again}{DIAG}\n{DIAG}\n"),
        format!("{counted}{other}{DIAG}\n{CFG}\n{DIAG}\n"),
    ] {
        for before in [
            "start 8\n---\n",
            "---\nstart 8\n",
            &format!("start 8\n{counted}---\n"),
        ] {
            check("", &format!("{before}{behind}"), "hides-prm-req");
        }
    }
}

/// A capture that begins with any telegram, or in any.
#[test]
#[ignore = "takes minutes; .ci/nightly runs it"]
fn every_begin_of_every_scenario() {
    let mut compared = 0;
    for source in scenarios() {
        let whole = trace(&source, "");
        let doubts = judge(&whole, &[], Span::ZERO).doubts.len();
        let begins = runs(&whole).into_iter().flat_map(|run| {
            let middle = run.octets.len() / 2;
            [run.octets[0].at, run.octets[middle].at]
        });
        for at in begins.collect::<Vec<_>>() {
            let judged = judge(&begun_at(&whole, at), &[], Span::ZERO);
            let name = &source.name;
            assert_eq!(judged.breaches, [], "{name} from {at} on");
            assert!(
                judged.doubts.len() <= doubts,
                "{name} from {at} on: {:#?}",
                judged.doubts
            );
            compared += judged.compared;
        }
    }
    assert!(compared > 1_000_000, "{compared}");
}
