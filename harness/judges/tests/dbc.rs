//! The DBC file of drives on CAN, read by the crate can-dbc, against the table of registers.

use can_dbc::{Dbc, Message, MultiplexIndicator, Signal, ValueType};
use harness_proto::unitek::units::{Scaling, shown, usual};
use harness_proto::unitek::{Access, Data, REGISTERS, Register, Reply, Unit};
use std::process::Command;

fn dbc(drives: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_judged"))
        .args(["dbc", "--drives", drives])
        .output()
        .expect("the program");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

fn message(dbc: &Dbc, id: u32) -> &Message {
    let all = dbc.messages().iter();
    let mut found = all.filter(|message| message.id().raw() == id);
    found.next().expect("a message")
}

/// The signals of a register.
fn signals(message: &Message, register: u8) -> Vec<&Signal> {
    let selected = MultiplexIndicator::MultiplexedSignal(register.into());
    let all = message.signals().iter();
    all.filter(|signal| *signal.multiplexer_indicator() == selected)
        .collect()
}

/// What a reader of the file takes out of a frame, in counts.
fn counts(signal: &Signal, frame: &[u8]) -> i64 {
    let mut bytes = [0; 8];
    bytes[..frame.len()].copy_from_slice(frame);
    let bits = u64::from_le_bytes(bytes) >> signal.start_bit;
    let unused = 64 - signal.size;
    match signal.value_type() {
        ValueType::Signed => (bits << unused) as i64 >> unused,
        ValueType::Unsigned => (bits << unused >> unused) as i64,
    }
}

/// Every register, with the ends of its range, out of the frame in which a drive sends it.
#[test]
fn a_reader_sees_what_the_drive_sends() {
    let text = dbc("1");
    let file = Dbc::try_from(text.as_str()).expect("a DBC");
    let tx = message(&file, 0x181);
    assert_eq!((tx.name().as_str(), *tx.size()), ("DriveTx", 6));
    let scaling = Scaling::default();
    let mut scaled = 0;
    for register in &REGISTERS {
        let found = signals(tx, register.number);
        assert!(!found.is_empty(), "{register:?}");
        for raw in [0, 1, 0x1234, 0x7FFF, 0x8000, 0xFFFF, 0x8000_0000, u32::MAX] {
            let raw = raw & register.mask();
            let reply = Reply {
                register: register.number,
                data: Data::of(register, raw),
                stuff: 0,
            };
            let frame = reply.encode(0x181).expect("a frame");
            let of_bits = matches!(
                register.unit,
                Unit::Status | Unit::Errors | Unit::Io | Unit::Mode
            );
            if of_bits || register.unit == Unit::Ramp {
                for signal in &found {
                    let bit = signal.start_bit - 8;
                    let mask = (1_u64 << signal.size) - 1;
                    let expected = u64::from(raw) >> bit & mask;
                    assert_eq!(counts(signal, frame.data()), expected as i64, "{signal:?}");
                }
                continue;
            }
            let [signal] = found.as_slice() else {
                panic!("{register:?}: {found:?}");
            };
            let count = counts(signal, frame.data());
            assert_eq!(count, register.number_of(raw), "{signal:?}");
            if let Some(given) = usual(register.unit).filter(|_| register.unit != Unit::Current) {
                let people = shown(register, raw, given, scaling).expect("a value");
                let people = people.to_string();
                let number = people.trim_end_matches(signal.unit().as_str()).trim();
                let places = number.split_once('.').map_or(0, |(_, digits)| digits.len());
                let half = 0.5_f64 / 10_f64.powi(i32::try_from(places).expect("few"));
                let apart = number.parse::<f64>().expect("a number") - count as f64 * signal.factor;
                assert!(apart.abs() <= half + 1e-9, "{signal:?}: {people}");
                scaled += 1;
            }
        }
    }
    assert!(scaled > 100, "{scaled}");
}

/// What can be written has a signal in the master's message, and what cannot has none; 3D has a register and an interval, selected by REGID alone.
#[test]
fn a_writer_finds_what_it_may_write() {
    let text = dbc("2");
    let file = Dbc::try_from(text.as_str()).expect("a DBC");
    // Few readers know a second level of selectors.
    assert!(file.extended_multiplex().is_empty());
    for id in [0x201, 0x202] {
        let rx = message(&file, id);
        assert_eq!(*rx.size(), 5);
        for register in &REGISTERS {
            let written = matches!(register.access, Access::RW | Access::SP | Access::FN);
            let found = signals(rx, register.number);
            assert_eq!(!found.is_empty(), written, "{register:?}");
        }
        let request: Vec<_> = signals(rx, 0x3D);
        let request = request
            .iter()
            .map(|signal| (signal.name().as_str(), signal.start_bit));
        assert_eq!(request.collect::<Vec<_>>(), [("READ", 8), ("INTERVAL", 16)]);
        let selectors = rx.signals().iter();
        let selectors = selectors
            .filter(|signal| *signal.multiplexer_indicator() == MultiplexIndicator::Multiplexor);
        assert_eq!(selectors.count(), 1);
    }
    assert_eq!(message(&file, 0x182).name(), "Drive2Tx");
    let known = Register::named("SPEED_ACTUAL").expect("a register");
    let found = signals(message(&file, 0x182), known.number);
    assert_eq!(found[0].name(), "SPEED_ACTUAL");
}
