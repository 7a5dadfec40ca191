//! The DP slave: telegrams of sections 1, 2 and 14 of the reading, row by row.

use super::common::{Desk, setup, with};
use harness_proto::profibus::BusRate;
use harness_proto::profibus::fdl::FrameControl;
use harness_proto::time::Span;

const PRM: &str = "80 00 00 0B 75 31 00";
const RS: &str = "10 02 08 03 0D 16";

/// Every whole telegram that section 2 prints.
#[test]
fn printed_telegrams() {
    let mut desk = Desk::standard();
    for (request, reply) in [
        ("10 08 02 49 53 16", "10 02 08 00 0A 16"),
        (
            "68 05 05 68 88 82 6C 3C 3E F0 16",
            "68 0B 0B 68 82 88 08 3E 3C 02 05 00 FF 75 31 38 16",
        ),
        (
            "68 0F 0F 68 08 02 5C 00 00 00 00 00 00 00 00 00 00 00 00 66 16",
            RS,
        ),
        (
            "68 0C 0C 68 88 82 7C 3D 3E 80 00 00 0B 75 31 00 32 16",
            "E5",
        ),
        ("68 07 07 68 88 82 5C 3E 3E F3 F1 C6 16", "E5"),
    ] {
        assert_eq!(desk.ask(request), reply, "{request}");
    }
    let mut desk = Desk::standard();
    for (request, reply) in [
        (
            "68 0C 0C 68 88 82 5C 3D 3E 80 00 00 0B 75 31 00 12 16",
            "E5",
        ),
        ("68 07 07 68 88 82 7C 3E 3E F3 F1 E6 16", "E5"),
    ] {
        assert_eq!(desk.ask(request), reply, "{request}");
    }
}

#[test]
fn printed_diagnoses() {
    let mut desk = Desk::standard();
    assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31");
    assert_eq!(desk.srd(61, PRM), "E5");
    assert_eq!(desk.diagnosis(), "02 04 00 02 75 31");
    assert_eq!(desk.srd(62, "F3 F1"), "E5");
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31");
    assert_eq!(desk.srd(61, "88 01 1E 0B 75 31 00"), "E5");
    assert_eq!(desk.diagnosis(), "02 0C 00 02 75 31");
    assert_eq!(desk.srd(61, "80 00 00 0B 75 32 00"), "E5");
    assert_eq!(desk.diagnosis(), "42 05 00 FF 75 31");
    assert_eq!(desk.srd(61, PRM), "E5");
    assert_eq!(desk.srd(62, "F3 F5"), "E5");
    assert_eq!(desk.diagnosis(), "06 05 00 FF 75 31");
}

/// Requests that get no answer at all (section 1), each beside the good one.
#[test]
fn no_answer_at_all() {
    for request in [
        "11 08 02 49 53 16",
        "68 05 06 68 88 82 6C 3C 3E F0 16",
        "68 03 03 68 08 02 5D 67 16",
        "68 05 05 69 88 82 6C 3C 3E F0 16",
        "68 06 06 68 88 82 6C 3C 3E F0 16",
        "68 04 04 68 88 82 6C 3C 3E F0 16",
        "10 08 02 49 54 16",
        "10 08 02 49 53 17",
        "10 09 02 49 54 16",
        "10 08 7F 49 D0 16",
        "10 08 02 C9 D3 16",
        "10 08 02 09 13 16",
        "10 08 02 40 4A 16",
        "10 08 02 48 52 16",
        "10 7F 02 49 CA 16",
        "68 05 05 68 FF 82 6C 3C 3E 67 16",
        "68 07 07 68 88 82 46 3A 3E 00 00 C8 16",
        "DC 08 02",
        "E5",
        "10 88 02 49 D3 16",
        "68 05 05 68 88 82 6C BC 3E 70 16",
        "68 05 05 68 88 82 6C 7C 3E 30 16",
        "68 05 05 68 88 82 6C 3C BE 70 16",
        "68 04 04 68 88 82 6C 3C B2 16",
        // FDL status is SD1 only.
        "68 04 04 68 08 02 49 00 53 16",
    ] {
        let mut desk = Desk::standard();
        assert_eq!(desk.ask(request), "", "{request}");
        assert_eq!(
            desk.ask("10 08 02 49 53 16"),
            "10 02 08 00 0A 16",
            "{request}"
        );
    }
}

/// Services by state: Wait_Prm, Wait_Cfg, Data_Exch.
#[test]
fn services_by_state() {
    let table: [(Option<u8>, &str, [&str; 3]); 12] = [
        (
            None,
            "00 00 00 00 00 00 00 00 00 00 00 00",
            ["RS", "RS", "data"],
        ),
        (Some(55), "08 75 31 00", ["RS"; 3]),
        (Some(56), "", ["RS", "RS", "data"]),
        (Some(57), "", ["RS", "RS", "data"]),
        (Some(58), "00 00", ["RS"; 3]),
        (Some(59), "", ["data"; 3]),
        (Some(60), "", ["data"; 3]),
        (Some(61), PRM, ["E5"; 3]),
        (Some(62), "F3 F1", ["RS", "E5", "E5"]),
        (Some(50), "", ["RS"; 3]),
        (Some(60), "00", ["RS"; 3]),
        (Some(59), "00", ["RS"; 3]),
    ];
    for (sap, data, replies) in table {
        for (state, expected) in replies.into_iter().enumerate() {
            let mut desk = Desk::standard();
            if state > 0 {
                assert_eq!(desk.srd(61, PRM), "E5");
            }
            if state > 1 {
                assert_eq!(desk.srd(62, "F3 F1"), "E5");
            }
            let reply = match sap {
                Some(sap) => desk.srd(sap, data),
                None => desk.exchange(data),
            };
            let kind = match reply.as_str() {
                RS => "RS",
                "E5" => "E5",
                reply if reply.starts_with("68") => "data",
                _ => "other",
            };
            assert_eq!(kind, expected, "SAP {sap:?} in state {state}: {reply}");
        }
    }
}

/// What other masters get while master 2 has the slave.
#[test]
fn other_masters() {
    let mut desk = Desk::standard();
    desk.start("F3 F1");
    desk.master = 3;
    assert_eq!(
        desk.exchange("00 00 00 00 00 00 00 00 00 00 00 00"),
        "10 03 08 03 0E 16"
    );
    assert_eq!(desk.srd(62, "F3 F1"), "10 03 08 03 0E 16");
    assert_eq!(desk.srd(61, "80 00 00 0B 12 34 00"), "E5");
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31");
    assert!(desk.srd(56, "").starts_with("68 11 11 68 83 88 08 3E 38"));
    assert!(
        desk.srd(59, "")
            .starts_with("68 07 07 68 83 88 08 3E 3B F3 F1")
    );

    let mut desk = Desk::new(&with(setup(8, &[]), "foreign-prm", "rs"));
    desk.start("F3 F1");
    desk.master = 3;
    assert_eq!(desk.srd(61, PRM), "10 03 08 03 0E 16");
}

/// SDA, ident and LSAP status: no service activated.
#[test]
fn functions_without_a_service() {
    for (word, reply) in [("rs", RS), ("silent", "")] {
        for fc in [0x43, 0x45, 0x4E, 0x4F, 0x63, 0x75] {
            let mut desk = Desk::new(&with(setup(8, &[]), "sda-ident-lsap", word));
            assert_eq!(desk.request(FrameControl(fc), None, &[]), reply, "{fc:02X}");
        }
    }
    // FDL status in every code of FCB and FCV.
    for fc in [0x49, 0x59, 0x69, 0x79] {
        let mut desk = Desk::standard();
        let reply = desk.request(FrameControl(fc), None, &[]);
        assert_eq!(reply, "10 02 08 00 0A 16", "{fc:02X}");
    }
}

/// A SAP on one side only is refused.
#[test]
fn one_sap() {
    let mut desk = Desk::standard();
    assert_eq!(desk.ask("68 04 04 68 88 02 6C 3C 32 16"), RS);
    assert_eq!(desk.ask("68 04 04 68 08 82 6C 3E 34 16"), RS);
}

#[test]
fn a_repetition_gets_the_same_reply_and_executes_nothing() {
    let mut desk = Desk::standard();
    let first = desk.request(FrameControl(0x6D), Some(60), &[]);
    let prm = [0x80, 0, 0, 11, 0x75, 0x31, 0];
    assert_eq!(desk.request(FrameControl(0x5D), Some(61), &prm), "E5");
    // The same frame count bit: the short confirmation again, whatever the telegram carries.
    assert_eq!(desk.request(FrameControl(0x5D), Some(60), &[]), "E5");
    assert_eq!(
        desk.request(FrameControl(0x49), None, &[]),
        "10 02 08 00 0A 16"
    );
    assert_eq!(desk.request(FrameControl(0x5D), Some(60), &[]), "E5");
    let second = desk.request(FrameControl(0x7D), Some(60), &[]);
    assert_ne!(first, second);
    // Another master is no repetition, and takes the record.
    desk.master = 3;
    assert!(
        desk.request(FrameControl(0x7D), Some(60), &[])
            .starts_with("68 0B 0B 68 83")
    );
    desk.master = 2;
    assert_eq!(desk.request(FrameControl(0x7D), Some(60), &[]), second);
    // FCV = 0 and FCB = 0 forget the record; FCB = 1 begins a new one.
    assert_eq!(
        desk.request(FrameControl(0x5D), Some(59), &[]),
        "68 07 07 68 82 88 08 3E 3B F3 F1 6F 16"
    );
    assert_eq!(desk.request(FrameControl(0x4D), Some(60), &[]), second);
    assert_eq!(desk.request(FrameControl(0x5D), Some(60), &[]), second);
    assert_eq!(
        desk.request(FrameControl(0x6D), Some(59), &[]),
        "68 07 07 68 82 88 08 3E 3B F3 F1 6F 16"
    );
    assert_eq!(
        desk.request(FrameControl(0x7D), Some(60), &[]),
        "68 07 07 68 82 88 08 3E 3B F3 F1 6F 16"
    );
}

/// Set_Prm, row by row: data, the diagnosis behind it.
#[test]
fn parameters() {
    for (data, diagnosis) in [
        ("80 00 00 0B 75 31", "42 05 00 FF 75 31"),
        ("", "42 05 00 FF 75 31"),
        ("40 00 00 00 75 31 00", "02 05 00 FF 75 31"),
        ("C0 00 00 00 75 31 00", "02 05 00 FF 75 31"),
        ("00 00 00 00 75 31 00", "00 04 00 02 75 31"),
        ("07 00 00 00 12 34 00 FF", "00 04 00 02 75 31"),
        ("80 00 00 00 75 32 00", "42 05 00 FF 75 31"),
        ("80 00 00 00 75 31 00 00", "42 05 00 FF 75 31"),
        ("88 00 0A 00 75 31 00", "42 05 00 FF 75 31"),
        ("88 0A 00 00 75 31 00", "42 05 00 FF 75 31"),
        ("80 0A 00 00 75 31 00", "02 04 00 02 75 31"),
        ("88 0A 0A 00 75 31 00", "02 0C 00 02 75 31"),
        ("B7 00 00 00 75 31 FF", "02 04 00 02 75 31"),
    ] {
        let mut desk = Desk::standard();
        desk.start("F3 F1");
        assert_eq!(desk.srd(61, data), "E5", "{data}");
        assert_eq!(desk.diagnosis(), diagnosis, "{data}");
    }
    let mut desk = Desk::new(&with(setup(8, &[]), "user-prm", "ignore"));
    desk.start_with("80 00 00 00 75 31 00 01 02", "F3 F1");
}

/// A fault of Set_Prm or Chk_Cfg stays until the next one of the same service.
#[test]
fn faults_stay() {
    let mut desk = Desk::standard();
    assert_eq!(desk.srd(61, "80 00 00 0B 00 00 00"), "E5");
    assert_eq!(desk.diagnosis(), "42 05 00 FF 75 31");
    assert_eq!(desk.srd(61, "40 00 00 00 00 00 00"), "E5");
    assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31");
    assert_eq!(desk.srd(61, PRM), "E5");
    assert_eq!(desk.srd(62, "F1"), "E5");
    assert_eq!(desk.diagnosis(), "06 05 00 FF 75 31");
    assert_eq!(desk.srd(61, PRM), "E5");
    assert_eq!(desk.diagnosis(), "06 04 00 02 75 31");
    assert_eq!(desk.srd(62, "F3 F1"), "E5");
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31");
}

/// Chk_Cfg accepts the configuration of the PPO type and no other.
#[test]
fn configurations() {
    let all = ["F3 F1", "F3 F5", "F1", "F5"];
    for ppo in 0..4_usize {
        for (number, cfg) in all.into_iter().enumerate() {
            for word in ["yes", "any-ppo"] {
                let raw = i32::try_from(ppo).expect("a PPO type");
                let mut desk = Desk::new(&with(
                    setup(8, &[(1622, raw)]),
                    "cfg-follows-ppo-type",
                    word,
                ));
                desk.start(cfg);
                let accepted = number == ppo || word == "any-ppo";
                let diagnosis = if accepted {
                    "00 04 00 02 75 31"
                } else {
                    "06 05 00 FF 75 31"
                };
                assert_eq!(desk.diagnosis(), diagnosis, "PPO{} {cfg}", ppo + 1);
            }
        }
    }
    let mut desk = Desk::new(&with(setup(8, &[]), "chk-cfg-early", "sc"));
    assert_eq!(desk.srd(62, "F3 F1"), "E5");
    assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31");
}

/// A Data_Exchange of the wrong length is refused, and the slave leaves Data_Exch.
#[test]
fn wrong_length() {
    for (word, diagnosis) in [
        ("rs-and-wait-prm", "02 05 00 FF 75 31"),
        ("rs-only", "00 04 00 02 75 31"),
    ] {
        for data in ["", "00 00 00 00", "00 00 00 00 00 00 00 00 00 00 00 00 00"] {
            let mut desk = Desk::new(&with(setup(8, &[]), "leave-dx-wrong-length", word));
            desk.start("F3 F1");
            assert_eq!(desk.exchange(data), RS, "{data}");
            assert_eq!(desk.diagnosis(), diagnosis, "{data}");
        }
    }
}

/// The watchdog runs for 10 ms x WD1 x WD2; SRD requests and Global_Control of the own master restart it.
#[test]
fn watchdog() {
    let running = "00 0C 00 02 75 31";
    let expired = "02 05 00 FF 75 31";
    let after = |keep: &dyn Fn(&mut Desk)| {
        let mut desk = Desk::standard();
        desk.start_with("88 02 05 0B 75 31 01", "F3 F1");
        desk.wait(Span::from_millis(60));
        keep(&mut desk);
        desk.wait(Span::from_millis(60));
        desk.diagnosis()
    };
    assert_eq!(after(&|_| {}), expired);
    assert_eq!(after(&|desk| drop(desk.diagnosis())), running);
    assert_eq!(after(&|desk| drop(desk.srd(50, ""))), running);
    assert_eq!(
        after(&|desk| drop(desk.exchange("00 00 00 00 00 00 00 00 00 00 00 00"))),
        running
    );
    assert_eq!(after(&|desk| drop(desk.control(0, 0))), running);
    // Not by an FDL status, and not by another master.
    assert_eq!(after(&|desk| drop(desk.ask("10 08 02 49 53 16"))), expired);
    let other = |desk: &mut Desk| {
        desk.master = 3;
        desk.diagnosis();
        desk.master = 2;
    };
    assert_eq!(after(&other), expired);
}

/// The watchdog expires to the instant.
#[test]
fn the_watchdog_is_exact() {
    let mut desk = Desk::standard();
    desk.start_with("88 01 01 0B 75 31 00", "F3 F1");
    desk.exchange("00 00 00 00 00 00 00 00 00 00 00 00");
    // The line was idle for long enough; the request has 21 octets.
    let heard = desk.now() - Span::from_millis(5) + desk.rate.octet_time() * 21;
    let expires = heard + Span::from_millis(10);
    desk.line.run_until(expires - Span::from_units(1));
    assert_eq!(desk.drive().slave().state().name(), "Data_Exch");
    desk.line.run_until(expires);
    assert_eq!(desk.drive().slave().state().name(), "Wait_Prm");
}

/// The reply begins min T_SDR after the request, at every rate.
#[test]
fn reply_delay() {
    for rate in BusRate::ALL {
        let mut desk = Desk::at(rate, &[setup(8, &[])]);
        let delay = |desk: &mut Desk, data: Option<&str>| {
            if let Some(data) = data {
                assert_eq!(desk.srd(61, data), "");
                assert_eq!(desk.wait(Span::from_millis(100)), "E5");
            }
            desk.line.take_record(0);
            desk.line.take_record(1);
            desk.ask("10 08 02 49 53 16");
            desk.wait(Span::from_millis(100));
            let request = desk.line.record(0).last().expect("a request").at;
            let reply = desk.line.record(1)[0].at - desk.rate.octet_time();
            reply.since(request).units() / desk.rate.bit_time().units()
        };
        assert_eq!(delay(&mut desk, None), 11);
        if rate == BusRate::K9_6 {
            for (byte, bits) in [("05", 11), ("14", 20), ("00", 20), ("FF", 255), ("0B", 11)] {
                let prm = format!("00 00 00 {byte} 75 31 00");
                assert_eq!(delay(&mut desk, Some(&prm)), bits, "{byte}");
            }
        }
    }
}

/// Sync stores outputs, Freeze keeps inputs: the modes in the diagnosis, groups, and RD_Outp.
#[test]
fn sync_and_freeze() {
    let old = "00 00 00 00 00 00 00 00 04 7E 11 11";
    let new = "00 00 00 00 00 00 00 00 04 7E 22 22";
    let outputs = |desk: &mut Desk| {
        desk.srd(57, "")
            .split(' ')
            .skip(9)
            .take(12)
            .collect::<Vec<_>>()
            .join(" ")
    };
    let mut desk = Desk::standard();
    desk.start_with("B0 00 00 0B 75 31 04", "F3 F1");
    desk.exchange(old);
    assert_eq!(desk.control(0x20, 0x03), "");
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31", "another group");
    desk.control(0x20, 0x06);
    assert_eq!(desk.diagnosis(), "00 24 00 02 75 31");
    desk.exchange(new);
    assert_eq!(outputs(&mut desk), old);
    desk.control(0x20, 0x00);
    assert_eq!(outputs(&mut desk), new);
    desk.exchange(old);
    assert_eq!(outputs(&mut desk), new);
    desk.control(0x02, 0x00);
    assert_eq!(outputs(&mut desk), "00 00 00 00 00 00 00 00 00 00 00 00");
    desk.exchange(old);
    desk.control(0x30, 0x00);
    assert_eq!(outputs(&mut desk), old, "Unsync wins");
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31");
    desk.control(0x08, 0x00);
    assert_eq!(desk.diagnosis(), "00 14 00 02 75 31");
    desk.control(0x0C, 0x00);
    assert_eq!(desk.diagnosis(), "00 04 00 02 75 31", "Unfreeze wins");
    // Without a request in Set_Prm both are ignored; another number of octets too.
    for (word, modes) in [
        ("ignored", "00 04 00 02 75 31"),
        ("obeyed", "00 34 00 02 75 31"),
    ] {
        let mut desk = Desk::new(&with(setup(8, &[]), "sync-without-request", word));
        desk.start("F3 F1");
        desk.control(0x28, 0);
        assert_eq!(desk.diagnosis(), modes);
    }
}

/// Module and inverter apart: the extension, and 0A until a diagnosis was fetched.
#[test]
fn extended_diagnosis() {
    let zero = "00 00 00 00 00 00 00 00 00 00 00 00";
    for word in ["any-master", "own"] {
        let mut desk = Desk::new(&with(setup(8, &[]), "diag-flag-cleared-by", word));
        desk.start("F3 F1");
        let control = |desk: &mut Desk| desk.inputs(zero)[..2].to_owned();
        assert_eq!(control(&mut desk), "08");
        let now = desk.now();
        desk.drive().set_link(now, true);
        assert_eq!(control(&mut desk), "0A");
        desk.srd(60, "00");
        assert_eq!(control(&mut desk), "0A", "RS does not count");
        desk.master = 3;
        assert_eq!(desk.diagnosis(), "08 04 00 02 75 31 02 04");
        desk.master = 2;
        assert_eq!(control(&mut desk), if word == "own" { "0A" } else { "08" });
        assert_eq!(desk.diagnosis(), "08 04 00 02 75 31 02 04");
        assert_eq!(control(&mut desk), "08");
        let now = desk.now();
        desk.drive().set_link(now, false);
        assert_eq!(control(&mut desk), "0A");
        assert_eq!(desk.diagnosis(), "00 04 00 02 75 31");
        assert_eq!(control(&mut desk), "08");
    }
    let mut desk = Desk::new(&with(setup(8, &[]), "ext-diag", "always"));
    assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31 02 00");
}

/// The first telegram after power-up may only serve to find the bit rate.
#[test]
fn autobaud() {
    let status = "10 08 02 49 53 16";
    let mut desk = Desk::new(&with(setup(8, &[]), "autobaud", "first-telegram-lost"));
    assert_eq!(desk.ask(status), "");
    assert_eq!(desk.ask(status), "10 02 08 00 0A 16");
}

/// A drive without power neither hears nor sends, and restarts.
#[test]
fn power() {
    let mut desk = Desk::standard();
    desk.start("F3 F1");
    let now = desk.now();
    desk.drive().set_power(now, false);
    assert_eq!(desk.ask("10 08 02 49 53 16"), "");
    let now = desk.now();
    desk.drive().set_power(now, true);
    assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31");
}

/// Three slaves on one line: each answers to its own address only.
#[test]
fn three_slaves() {
    let mut desk = Desk::at(
        BusRate::K1500,
        &[setup(8, &[]), setup(9, &[]), setup(126, &[])],
    );
    for slave in [8, 9, 126, 10, 8] {
        desk.slave = slave;
        let reply = desk.request(FrameControl(0x49), None, &[]);
        let expected = if slave == 10 {
            String::new()
        } else {
            format!("10 02 {slave:02X} 00 {:02X} 16", slave + 2)
        };
        assert_eq!(reply, expected);
    }
}
