//! Each class of the guard, and that nothing denied gets past it however it is cut.

use super::*;
use crate::nordac::words::stw::{READY, SAFE, START};
use crate::profibus::fdl::{FcStatus, FrameControl, Sequence};
use crate::time::Span;
use proptest::prelude::*;
use std::string::{String, ToString};
use std::vec::Vec;

const SLAVES: [GuardedSlave; 2] = [
    GuardedSlave {
        address: 8,
        ppo: Some(PpoType::One),
    },
    GuardedSlave {
        address: 9,
        ppo: None,
    },
];

fn gate(limits: Limits) -> OctetGate {
    OctetGate::new(limits, BusRate::K500, &SLAVES)
}

fn request(da: u8, service: Service, data: &[u8]) -> Pdu {
    let control = FrameControl::request(FcFunction::SrdHigh, Sequence::First);
    Pdu::with_saps(da, 2, control, service.sap(), service.master_sap(), data).unwrap()
}

fn exchange(da: u8, ppo: PpoType, task: Pkw, words: [u16; 2]) -> Pdu {
    let [first, main] = words;
    let image = Image {
        pkw: task,
        words: [first, main, 0, 0, 0, 0],
    };
    request(da, Service::DataExchange, &image.encode(ppo))
}

fn words(da: u8, first: u16, main: u16) -> Pdu {
    exchange(da, PpoType::One, Pkw::default(), [first, main])
}

fn task(number: u16, pwe: u32) -> Pdu {
    exchange(8, PpoType::One, Pkw::of(2, number, 0, pwe), [0, 0])
}

/// Sends a telegram octet by octet: the place of the octet that is denied, and why.
fn send(gate: &mut OctetGate, pdu: Pdu) -> Option<(usize, FcsDenial)> {
    let all = Telegram::Pdu(pdu).encode();
    let now = gate.free + Span::from_millis(1);
    for (place, octet) in all.iter().enumerate() {
        if let Err(denial) = gate.admit(now, *octet) {
            assert_eq!(place, all.len() - 2, "the FCS is kept back");
            return Some((place, denial));
        }
    }
    None
}

fn denial(gate: &mut OctetGate, pdu: Pdu) -> Option<FcsDenial> {
    send(gate, pdu).map(|(_, denial)| denial)
}

fn missing(gate: &mut OctetGate, pdu: Pdu) -> Option<Missing> {
    match denial(gate, pdu) {
        None => None,
        Some(FcsDenial::NotPermitted { missing, .. }) => Some(missing),
        Some(other) => panic!("{other}"),
    }
}

/// Without permissions: requests that read, a start of the exchange, and words that stop.
#[test]
fn harmless() {
    let mut gate = gate(Limits::default());
    let read = |ak, number| exchange(8, PpoType::One, Pkw::of(ak, number, 0, 0), [0, 0]);
    let status = Pdu::new(77, 2, FrameControl(0x49), &[]).unwrap();
    for pdu in [
        status,
        request(77, Service::SlaveDiag, &[]),
        request(8, Service::RdInp, &[]),
        request(8, Service::SetPrm, &SetPrm::lock(0x7531).encode().unwrap()),
        request(8, Service::ChkCfg, &[0xF3, 0xF1]),
        request(BROADCAST, Service::GlobalControl, &[0, 0]),
        request(8, Service::GlobalControl, &[GlobalControl::FREEZE, 0]),
        words(8, 0, 0),
        words(8, READY, 0),
        words(8, SAFE, 0),
        // What an inverter with PPO1 takes for PKE is no control word.
        read(1, 0x64F),
        read(0, 0),
        read(4, 1202),
        read(6, 1801),
        read(9, 1801),
    ] {
        assert_eq!(denial(&mut gate, pdu), None, "{pdu:?}");
    }
    assert_eq!(gate.writes(), 0);
    // The reply of a slave is none of its requests.
    let reply = Pdu::new(
        8,
        2,
        FrameControl(0x08),
        &words(8, START, 0x2000).data()[..12],
    )
    .unwrap();
    assert_eq!(denial(&mut gate, reply), None);
}

/// Each class without its permission, and with it.
#[test]
fn permissions() {
    let array = Pkw::of(7, 1716, 0, 1);
    for (pdu, needed) in [
        (words(8, START, 0), Missing::Motion),
        (words(8, 0x0C7F, 0), Missing::Motion),
        (words(8, 0x147F, 0), Missing::Motion),
        (words(8, 0x040F, 0), Missing::Motion),
        (words(8, READY, 1), Missing::Motion),
        (words(8, 0, 1), Missing::Motion),
        (words(8, READY | 0x4000, 0), Missing::Motion),
        (words(8, READY | 0x0080, 0), Missing::Motion),
        (words(9, START, 0), Missing::Motion),
        (
            exchange(9, PpoType::Four, Pkw::default(), [START, 0]),
            Missing::Motion,
        ),
        (
            exchange(9, PpoType::Three, Pkw::default(), [START, 0]),
            Missing::Motion,
        ),
        (
            request(8, Service::GlobalControl, &[GlobalControl::SYNC, 0]),
            Missing::Motion,
        ),
        (
            request(8, Service::GlobalControl, &[GlobalControl::UNSYNC, 0]),
            Missing::Motion,
        ),
        (
            request(8, Service::GlobalControl, &[GlobalControl::CLEAR_DATA, 0]),
            Missing::Motion,
        ),
        (
            request(
                BROADCAST,
                Service::GlobalControl,
                &[GlobalControl::FREEZE, 0],
            ),
            Missing::BusSettings,
        ),
        (
            request(8, Service::SetPrm, &[0x40, 0, 0, 0, 0x75, 0x31, 0]),
            Missing::BusSettings,
        ),
        (
            request(8, Service::SetSlaveAdd, &[9, 0x75, 0x31, 0]),
            Missing::BusSettings,
        ),
        (task(1600, 1), Missing::Eeprom),
        (task(971, 1), Missing::Eeprom),
        (task(1304, 1), Missing::Eeprom),
        (exchange(8, PpoType::One, array, [0, 0]), Missing::Eeprom),
        (task(970, 0), Missing::Everything),
        (task(1602, 1), Missing::Everything),
        (task(1519, 1), Missing::Everything),
        (task(1800, 1), Missing::Everything),
        (
            exchange(8, PpoType::One, Pkw::of(12, 1202, 0, 0), [0, 0]),
            Missing::Everything,
        ),
    ] {
        let mut none = gate(Limits::default());
        assert_eq!(missing(&mut none, pdu), Some(needed), "{pdu:?}");
        let mut all = gate(Limits::unlimited());
        assert_eq!(denial(&mut all, pdu), None, "{pdu:?}");
    }
    let stored = Limits {
        eeprom: true,
        ..Limits::default()
    };
    for (number, needed) in [
        (1600, None),
        (1304, Some(Missing::MotorData)),
        (1625, Some(Missing::MotorData)),
        (1205, Some(Missing::MotorData)),
        (1509, Some(Missing::MotorData)),
        (1624, Some(Missing::BusSettings)),
        (1619, Some(Missing::BusSettings)),
        (1621, Some(Missing::BusSettings)),
        (1622, Some(Missing::BusSettings)),
    ] {
        assert_eq!(
            missing(&mut gate(stored), task(number, 1)),
            needed,
            "{number}"
        );
    }
    let motor = Limits {
        motor_data: true,
        ..stored
    };
    assert_eq!(
        missing(&mut gate(motor), task(1205, 1)),
        Some(Missing::Motion)
    );
    assert_eq!(missing(&mut gate(motor), task(1304, 1)), None);
    let never = FcsDenial::Never {
        station: 8,
        act: Act::Task { ak: 2, number: 967 },
    };
    assert_eq!(
        denial(&mut gate(Limits::unlimited()), task(967, 0x047F)),
        Some(never)
    );
}

/// Other stations: reading only; an address to none of them.
#[test]
fn other_stations() {
    let other = Some(FcsDenial::OtherStation { station: 7 });
    assert_eq!(denial(&mut gate(Limits::default()), words(7, 0, 0)), other);
    assert_eq!(
        denial(
            &mut gate(Limits::default()),
            request(7, Service::SetPrm, &[])
        ),
        other
    );
    let all = &mut gate(Limits::unlimited());
    assert_eq!(denial(all, words(7, START, 0)), None);
    assert_eq!(
        denial(all, request(7, Service::SetSlaveAdd, &[9, 0, 0, 0])),
        other
    );
    // After a write to 1624 the slave is at both addresses.
    assert_eq!(denial(all, task(1624, 7)), None);
    assert_eq!(
        denial(all, request(7, Service::SetSlaveAdd, &[9, 0, 0, 0])),
        None
    );
}

/// A motor is enabled only where time-out and watchdog are on, and the exchange does not end while it may run.
#[test]
fn supervision() {
    let limits = Limits {
        motion: true,
        bus_settings: true,
        ..Limits::default()
    };
    let mut gate = gate(limits);
    let unsupervised = |watch| Some(FcsDenial::Unsupervised { station: 8, watch });
    assert_eq!(
        denial(&mut gate, words(8, START, 0)),
        unsupervised(Supervision::Timeout)
    );
    gate.learn(8, 1625, 0, 10);
    assert_eq!(
        denial(&mut gate, words(8, START, 0)),
        unsupervised(Supervision::Watchdog)
    );
    let prm = SetPrm {
        status: SetPrm::LOCK | SetPrm::WATCHDOG,
        watchdog: [1, 30],
        ..SetPrm::lock(0x7531)
    };
    let prm = request(8, Service::SetPrm, &prm.encode().unwrap());
    assert_eq!(denial(&mut gate, prm), None);
    assert_eq!(denial(&mut gate, words(8, START, 0)), None);
    assert_eq!(gate.enabled().collect::<Vec<_>>(), [8]);
    let still = Some(FcsDenial::StillEnabled { station: 8 });
    let short = request(8, Service::DataExchange, &[0; 4]);
    let ends = [prm, request(8, Service::ChkCfg, &[0xF1]), short];
    for pdu in ends {
        assert_eq!(denial(&mut gate, pdu), still, "{pdu:?}");
    }
    // Zeros leave it enabled; OFF2 does not.
    assert_eq!(denial(&mut gate, words(8, 0, 0)), None);
    assert_eq!(denial(&mut gate, short), still);
    let sync = |command| request(8, Service::GlobalControl, &[command, 0]);
    assert_eq!(denial(&mut gate, sync(GlobalControl::SYNC)), None);
    assert_eq!(denial(&mut gate, words(8, SAFE, 0)), None);
    assert_eq!(denial(&mut gate, short), still, "the word waits for Sync");
    assert_eq!(denial(&mut gate, sync(GlobalControl::UNSYNC)), None);
    assert_eq!(denial(&mut gate, words(8, SAFE, 0)), None);
    assert_eq!(gate.enabled().count(), 0);
    for pdu in ends {
        assert_eq!(denial(&mut gate, pdu), None, "{pdu:?}");
    }
    gate.doubt();
    assert_eq!(
        denial(&mut gate, words(8, START, 0)),
        unsupervised(Supervision::Timeout)
    );
}

/// A slave that has left the exchange can be taken into it again, to stop its motor.
#[test]
fn a_slave_that_has_left_is_started_again() {
    let mut gate = gate(Limits {
        motion: true,
        ..Limits::default()
    });
    gate.learn(8, 1625, 0, 10);
    let prm = SetPrm {
        status: SetPrm::LOCK | SetPrm::WATCHDOG,
        watchdog: [1, 30],
        ..SetPrm::lock(0x7531)
    };
    let prm = request(8, Service::SetPrm, &prm.encode().unwrap());
    let cfg = request(8, Service::ChkCfg, PpoType::One.cfg());
    let still = Some(FcsDenial::StillEnabled { station: 8 });
    assert_eq!(denial(&mut gate, prm), None);
    assert_eq!(denial(&mut gate, words(8, START, 0)), None);
    assert_eq!(denial(&mut gate, prm), still);
    assert_eq!(denial(&mut gate, words(8, START, 0)), None);
    let rs = Pdu::new(2, 8, FrameControl::reply(FcStatus::Rs), &[]).unwrap();
    for octet in Telegram::Pdu(rs).encode().iter() {
        gate.hear(Some(*octet));
    }
    assert_eq!(denial(&mut gate, prm), None);
    assert_eq!(denial(&mut gate, cfg), None);
    assert_eq!(denial(&mut gate, prm), still);
    assert_eq!(gate.enabled().collect::<Vec<_>>(), [8]);
}

/// The reply of slave 8 to an exchange, with this in its parameter channel.
fn reply(gate: &mut OctetGate, shown: Pkw) {
    let image = Image {
        pkw: shown,
        ..Image::default()
    };
    let control = FrameControl::reply(FcStatus::DataLow);
    let pdu = Pdu::new(2, 8, control, &image.encode(PpoType::One)).unwrap();
    for octet in Telegram::Pdu(pdu).encode().iter() {
        gate.hear(Some(*octet));
    }
}

/// The gate reads the bus time-out and the maximum frequency along with the bench. An answer that may be older than the last write does not count.
#[test]
fn what_slaves_reply_is_learnt() {
    let limits = Limits {
        motion: true,
        eeprom: true,
        motor_data: true,
        ..Limits::default()
    };
    let mut gate = gate(limits);
    let prm = SetPrm {
        status: SetPrm::LOCK | SetPrm::WATCHDOG,
        watchdog: [1, 30],
        ..SetPrm::lock(0x7531)
    };
    let prm = request(8, Service::SetPrm, &prm.encode().unwrap());
    assert_eq!(denial(&mut gate, prm), None);
    let unsupervised = Some(FcsDenial::Unsupervised {
        station: 8,
        watch: Supervision::Timeout,
    });
    let ask = |task| exchange(8, PpoType::One, task, [0, 0]);
    let (read, ten) = (Pkw::of(1, 1625, 0, 0), Pkw::of(1, 1625, 0, 10));
    // A reply without a request, one with a damaged octet, and one to another task.
    reply(&mut gate, ten);
    assert_eq!(denial(&mut gate, words(8, START, 0)), unsupervised);
    assert_eq!(denial(&mut gate, ask(read)), None);
    gate.hear(None);
    reply(&mut gate, ten);
    assert_eq!(denial(&mut gate, words(8, START, 0)), unsupervised);
    assert_eq!(denial(&mut gate, ask(Pkw::of(1, 1202, 0, 0))), None);
    reply(&mut gate, ten);
    assert_eq!(denial(&mut gate, words(8, START, 0)), unsupervised);
    assert_eq!(denial(&mut gate, ask(read)), None);
    reply(&mut gate, ten);
    assert_eq!(denial(&mut gate, words(8, START, 0)), None);
    assert_eq!(denial(&mut gate, words(8, SAFE, 0)), None);
    // The time-out is switched off: the former answer stands for two exchanges more.
    assert_eq!(denial(&mut gate, ask(Pkw::of(2, 1625, 0, 0))), None);
    reply(&mut gate, ten);
    assert_eq!(denial(&mut gate, ask(read)), None);
    reply(&mut gate, ten);
    assert_eq!(denial(&mut gate, words(8, START, 0)), unsupervised);
    reply(&mut gate, Pkw::default());
    assert_eq!(denial(&mut gate, ask(read)), None);
    reply(&mut gate, Pkw::of(1, 1625, 0, 0));
    assert_eq!(denial(&mut gate, words(8, START, 0)), unsupervised);
}

/// A configuration of another PPO type leaves it open how the slave reads its outputs.
#[test]
fn another_configuration_makes_the_layout_unknown() {
    let limits = Limits {
        eeprom: true,
        ..Limits::default()
    };
    let mut gate = gate(limits);
    // Under PPO4 the first word is the control word, here of a task that reads.
    let task = exchange(8, PpoType::One, Pkw::of(0, 0x47F, 0, 0), [0, 0]);
    assert_eq!(denial(&mut gate, task), None);
    let other = request(8, Service::ChkCfg, PpoType::Four.cfg());
    assert_eq!(denial(&mut gate, other), None);
    assert_eq!(missing(&mut gate, task), Some(Missing::Motion));
    // Get_Cfg shows which one it has.
    let ask = request(8, Service::GetCfg, &[]);
    assert_eq!(denial(&mut gate, ask), None);
    let control = FrameControl::reply(FcStatus::DataLow);
    let cfg = PpoType::One.cfg();
    let pdu = Pdu::with_saps(2, 8, control, ask.ssap(), ask.dsap(), cfg).unwrap();
    for octet in Telegram::Pdu(pdu).encode().iter() {
        gate.hear(Some(*octet));
    }
    assert_eq!(denial(&mut gate, task), None);
}

/// A word that stops, sent where stations may not take it for the start of a telegram, leaves the motor enabled.
#[test]
fn a_stop_in_the_middle_of_something() {
    let mut gate = gate(Limits {
        unsupervised: true,
        motion: true,
        ..Limits::default()
    });
    assert_eq!(denial(&mut gate, words(8, START, 0)), None);
    let now = gate.free + Span::from_millis(1);
    let stop = Telegram::Pdu(words(8, SAFE, 0)).encode();
    for octet in [0x00].iter().chain(stop.iter()) {
        assert_eq!(gate.admit(now, *octet), Ok(()));
    }
    assert_eq!(gate.enabled().count(), 1);
    assert_eq!(denial(&mut gate, words(8, SAFE, 0)), None);
    assert_eq!(gate.enabled().count(), 0);
}

/// The highest setpoint and the highest frequency.
#[test]
fn speeds() {
    let motion = Limits {
        motion: true,
        eeprom: true,
        motor_data: true,
        unsupervised: true,
        ..Limits::default()
    };
    let fast = |fast| Some(FcsDenial::Speed { station: 8, fast });
    let mut gate = gate(Limits {
        highest: Some(Highest::Setpoint(0x2000)),
        ..motion
    });
    assert_eq!(denial(&mut gate, words(8, START, 0x2000)), None);
    assert_eq!(denial(&mut gate, words(8, START, 0xE000)), None);
    let above = fast(Fast::Above { most: 0x2000 });
    assert_eq!(denial(&mut gate, words(8, START, 0x2001)), above);
    assert_eq!(denial(&mut gate, words(8, 0, 0xDFFF)), above);
    let mut gate = super::tests::gate(Limits {
        highest: Some(Highest::Frequency(350)),
        ..motion
    });
    let unknown = |set| fast(Fast::MaximumUnknown { set });
    assert_eq!(denial(&mut gate, words(8, START, 0)), unknown(0));
    gate.learn(8, 1205, 0, 700);
    assert_eq!(denial(&mut gate, words(8, START, 0x2000)), None);
    assert_eq!(denial(&mut gate, words(8, START, 0x2001)), above);
    assert_eq!(denial(&mut gate, words(8, START | 0x8000, 0)), unknown(2));
    let maximum = |value| exchange(8, PpoType::One, Pkw::of(2, 1205, 0, value), [0, 0]);
    assert_eq!(denial(&mut gate, maximum(351)), fast(Fast::Maximum));
    // The old value counts until it is read again.
    assert_eq!(denial(&mut gate, maximum(300)), None);
    assert_eq!(denial(&mut gate, words(8, START, 0x2001)), above);
    gate.learn(8, 1205, 0, 300);
    assert_eq!(denial(&mut gate, words(8, START, 0x7FFF)), None);
    // The second setpoint adds.
    let second = Image {
        words: [START, 0, 0, 1, 0, 0],
        ..Image::default()
    };
    let second = request(9, Service::DataExchange, &second.encode(PpoType::Four));
    gate.learn(9, 1622, 0, 3);
    gate.learn(9, 1205, 0, 700);
    assert_eq!(
        denial(&mut gate, second),
        Some(FcsDenial::Speed {
            station: 9,
            fast: Fast::Second
        })
    );
}

/// A repeated task writes once, and the number of writes has an end.
#[test]
fn wear() {
    let mut gate = gate(Limits {
        eeprom: true,
        most_writes: Some(2),
        ..Limits::default()
    });
    for value in [1, 1, 1, 2, 2] {
        assert_eq!(denial(&mut gate, task(1600, value)), None);
    }
    assert_eq!(gate.writes(), 2);
    assert_eq!(
        denial(&mut gate, task(1600, 3)),
        Some(FcsDenial::Wear { most: 2 })
    );
    assert_eq!(denial(&mut gate, task(1600, 2)), None);
    let first: String = FcsDenial::Wear { most: 2 }.to_string();
    assert!(first.contains("max_eeprom_writes"));
}

/// Whether a telegram does nothing that needs a permission, judged apart from the gate and for every layout.
fn is_harmless(pdu: &Pdu) -> bool {
    if pdu.fc().0 & 0x40 == 0 || [9, 14, 15].contains(&(pdu.fc().0 & 15)) {
        return true;
    }
    let data = pdu.data();
    let listed = [8, 9].contains(&pdu.da());
    match pdu.dsap() {
        Some(56 | 57 | 59 | 60) => true,
        Some(58) => {
            data.len() == 2 && data[0] == 0 || listed && !data.is_empty() && data[0] & 0x32 == 0
        }
        Some(61) => listed && data.first().is_none_or(|status| status & 0x40 == 0),
        Some(62) => listed,
        Some(_) => false,
        None => {
            let (with_task, words_only) = ((Some(0), 8), (None, 0));
            let readings: &[(Option<usize>, usize)] = match (pdu.da(), data.len()) {
                (8, 12) | (8 | 9, 20) => &[with_task],
                (9, 12) => &[with_task, words_only],
                (8 | 9, 4) => &[words_only],
                _ => return listed,
            };
            readings.iter().all(|(task, words)| {
                let stopped = data[words + 2..].iter().take(6).all(|octet| *octet == 0);
                let control = u16::from(data[*words]) << 8 | u16::from(data[words + 1]);
                let calm = control & 0x0400 == 0 || control & 0xC080 == 0 && control & 15 != 15;
                let reads = |place: usize| [0, 1, 4, 6, 9].contains(&(data[place] >> 4));
                stopped && calm && task.is_none_or(reads)
            })
        }
    }
}

/// Octets of telegrams that matter, whole or in part, and of others.
fn pieces() -> impl Strategy<Value = Vec<u8>> {
    let control = prop_oneof![
        Just(START),
        Just(READY),
        Just(SAFE),
        Just(0u16),
        any::<u16>()
    ];
    let service = prop::sample::select(&Service::ALL[..]);
    let station = prop::sample::select(&[8, 9, 7, BROADCAST][..]);
    let task = (
        0u8..16,
        prop::sample::select(&[1202, 1205, 967, 970, 1600, 1801, 1][..]),
    );
    let words = (
        station.clone(),
        prop::sample::select(&PpoType::ALL[..]),
        task,
        control,
        0u16..2,
    );
    let words = words.prop_map(|(da, ppo, (ak, number), first, main)| {
        exchange(da, ppo, Pkw::of(ak, number, 0, 1), [first, main])
    });
    let other = (station, service, prop::collection::vec(any::<u8>(), 0..9))
        .prop_map(|(da, service, data)| request(da, service, &data));
    let whole = prop_oneof![words, other].prop_map(|pdu| Telegram::Pdu(pdu).encode().to_vec());
    let part = (whole.clone(), any::<prop::sample::Index>(), any::<bool>()).prop_map(
        |(all, place, front)| {
            let place = place.index(all.len());
            if front {
                all[..place].to_vec()
            } else {
                all[place..].to_vec()
            }
        },
    );
    // A telegram within the data of another one.
    let inner = whole.clone().prop_map(|all| {
        let outer = Pdu::new(7, 2, FrameControl(0x08), &all).unwrap();
        Telegram::Pdu(outer).encode().to_vec()
    });
    prop_oneof![4 => whole, 2 => part, 2 => inner, 1 => prop::collection::vec(any::<u8>(), 0..20)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    /// No octets, however they are cut, put together and repeated after a denial, bring a denied telegram onto the line.
    #[test]
    fn nothing_denied_gets_past(pieces in prop::collection::vec((pieces(), 0u64..200), 0..12)) {
        let mut gate = gate(Limits::default());
        let mut sent = Vec::new();
        let mut now = Instant::START;
        for (octets, pause) in pieces {
            now += Span::from_micros(pause);
            for octet in octets {
                if gate.admit(now, octet).is_ok() {
                    sent.push(octet);
                }
            }
        }
        for begin in 0..sent.len() {
            if let Decoded::Value { value: Telegram::Pdu(pdu), .. } = Telegram::decode(&sent[begin..]) {
                prop_assert!(is_harmless(&pdu), "{pdu:?}");
            }
        }
        prop_assert_eq!(gate.enabled().count(), 0);
    }

    /// With every permission every telegram passes but a write to 967 and a new address for a station that is not listed.
    #[test]
    fn everything_is_permitted(octets in pieces()) {
        let mut gate = gate(Limits::unlimited());
        for octet in octets {
            match gate.admit(Instant::START, octet) {
                Ok(()) | Err(FcsDenial::Never { .. } | FcsDenial::OtherStation { .. }) => {}
                Err(other) => prop_assert!(false, "{}", other),
            }
        }
    }
}
