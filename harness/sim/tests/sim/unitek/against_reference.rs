//! Random frames, inputs and times: the drive and the reference send the same frames in the same milliseconds.

use super::common::property;
use harness_proto::can::{Frame, Id};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::{Accepts, PROPERTIES, Properties, Setting};
use harness_sim::unitek::reference::Reference;
use harness_sim::unitek::{Drive, Inputs};
use proptest::prelude::*;

use std::sync::atomic::{AtomicUsize, Ordering};

#[derive(Clone, Debug)]
enum Event {
    Frame(Frame),
    Input(usize, bool),
    Fault(u8),
    Wait(u64),
}

/// Registers that do something, more often than others.
fn register() -> impl Strategy<Value = u8> {
    let known = [
        0x30, 0x31, 0x31, 0x34, 0x35, 0x3D, 0x40, 0x40, 0x51, 0x51, 0x52, 0x68, 0x69, 0x6D, 0x6E,
        0x6E, 0x70, 0x72, 0x78, 0x78, 0x79, 0x7A, 0x83, 0x84, 0x8E, 0x8F, 0x90, 0x90, 0x91, 0xA8,
        0xC7, 0xC8, 0xCE, 0xD0, 0xD4, 0xD8, 0xDC, 0xE2, 0xE8, 0xED, 0xEF, 0xF2, 0xF4, 0xF5, 0x20,
        0x27, 0x3E, 0x73, 0x88, 0x89,
    ];
    prop_oneof![6 => prop::sample::select(known.to_vec()), 1 => any::<u8>()]
}

fn value() -> impl Strategy<Value = u32> {
    prop_oneof![
        3 => 0u32..20,
        1 => Just(4),
        1 => Just(0x14),
        1 => Just(0x10),
        1 => Just(0x3000),
        1 => Just(0x201),
        1 => Just(0x210),
        1 => Just(0x181),
        1 => Just(0x130),
        1 => prop::sample::select(vec![0x4025, 0x405C, 0x4102]),
        2 => 0u32..3_000,
        2 => any::<u16>().prop_map(u32::from),
        2 => any::<u32>(),
        1 => prop::sample::select(vec![0x7FFF, 0x8000, 0x8001, 0xFFFF, 0x8000_0000, 0x7FFF_FFFF]),
    ]
}

fn frame() -> impl Strategy<Value = Frame> {
    let id = prop_oneof![12 => Just(0x201u16), 3 => Just(0x210), 1 => 0..0x800u16];
    let base = |id, data: &[u8]| Frame::base(id, data).expect("a frame");
    let write = (
        id.clone(),
        register(),
        value(),
        prop_oneof![4 => Just(3usize), 3 => Just(5), 1 => 0..=8usize],
    )
        .prop_map(move |(id, register, value, len)| {
            let [a, b, c, d] = value.to_le_bytes();
            base(id, &[register, a, b, c, d, 7, 8, 9][..len])
        });
    let time = prop_oneof![4 => Just(0u8), 3 => 1..20u8, 2 => Just(255), 1 => any::<u8>()];
    let read = (id.clone(), register(), time)
        .prop_map(move |(id, register, time)| base(id, &[0x3D, register, time]));
    let other = (0..0x800u32, 0..=8usize, any::<bool>()).prop_map(|(id, len, extended)| {
        if extended {
            Frame::new(Id::extended(id).expect("an id"), &[0x3D, 0x40, 0]).expect("a frame")
        } else {
            Frame::remote(Id::base(id as u16).expect("an id"), len).expect("a frame")
        }
    });
    prop_oneof![8 => write, 8 => read, 1 => other]
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let event = prop_oneof![
        10 => frame().prop_map(Event::Frame),
        2 => (0..8usize, any::<bool>()).prop_map(|(place, on)| Event::Input(place, on)),
        1 => prop_oneof![Just(32u8), 0..32u8].prop_map(Event::Fault),
        5 => (0..30u64).prop_map(Event::Wait),
        1 => (0..2_500u64).prop_map(Event::Wait),
    ];
    prop::collection::vec(event, 1..60)
}

fn properties() -> impl Strategy<Value = Properties> {
    let choices = prop::collection::vec((0..4usize, any::<bool>()), PROPERTIES.len());
    choices.prop_map(|choices| {
        let mut properties = Properties::default();
        for (property, (choice, differs)) in PROPERTIES.iter().zip(choices) {
            let setting = match property.accepts {
                Accepts::Words(words) => Setting::Word(words[choice % words.len()]),
                Accepts::Byte => Setting::Word("A5"),
                // The reference knows no delays, and homing ends in whole milliseconds.
                Accepts::TimeUpTo(_) if property.name == "homing-time" => {
                    Setting::Time(Span::from_millis(choice as u64 * 17))
                }
                Accepts::TimeUpTo(_) => continue,
            };
            if differs && property.name != "can-counters" {
                assert!(property.set(&mut properties, setting));
            }
        }
        properties
    })
}

/// Every frame that a drive sends, with its millisecond.
fn sent(drive: &mut Drive, out: &mut Vec<(u64, Frame)>) {
    while let Some(waiting) = drive.sent() {
        let at = waiting.ready.since_start().as_nanos() / 1_000_000;
        out.push((at, waiting.frame));
    }
}

/// Frames compared so far: a comparison of nothing proves nothing.
static COMPARED: AtomicUsize = AtomicUsize::new(0);

fn play(properties: Properties, events: &[Event]) -> Result<(), TestCaseError> {
    let mut drive = Drive::new(properties, Inputs::default(), Instant::START);
    let mut reference = Reference::new(properties, Inputs::default());
    let mut inputs = Inputs::default();
    let (mut seen, mut expected) = (Vec::new(), Vec::new());
    let mut now = 0;
    for event in events {
        let at = Instant::START + Span::from_millis(now);
        match event {
            Event::Frame(frame) => {
                let _ = drive.receive(at, frame);
                expected.extend(reference.frame(frame).into_iter().map(|f| (now, f)));
            }
            Event::Input(place, on) => {
                let switch = inputs.switch(Inputs::SWITCHES[*place]).expect("an input");
                *switch = *on;
                drive.set_inputs(at, inputs);
                reference.inputs = inputs;
            }
            Event::Fault(bit) => {
                inputs.faults = if *bit == 32 { 0 } else { 1 << bit };
                drive.set_inputs(at, inputs);
                reference.inputs = inputs;
            }
            Event::Wait(millis) => {
                for _ in 0..*millis {
                    now += 1;
                    expected.extend(reference.millisecond().into_iter().map(|f| (now, f)));
                    // A bus that is never full: what is sent leaves at once.
                    if drive
                        .next_scan()
                        .is_some_and(|at| at <= Instant::START + Span::from_millis(now))
                    {
                        drive.advance(Instant::START + Span::from_millis(now));
                        sent(&mut drive, &mut seen);
                    }
                }
            }
        }
        sent(&mut drive, &mut seen);
        prop_assert_eq!(seen.last(), expected.last(), "after {:?}", event);
    }
    prop_assert_eq!(&seen, &expected);
    COMPARED.fetch_add(seen.len(), Ordering::Relaxed);
    drive.advance(Instant::START + Span::from_millis(now));
    for number in 0..=255 {
        prop_assert_eq!(
            drive.register(number),
            reference.read(number),
            "register {:02X}",
            number
        );
    }
    Ok(())
}

fn agree(cases: u32) {
    let strategy = (properties(), events());
    property("against_reference", cases, &strategy, |(p, events)| {
        play(p, &events)
    });
}

#[test]
fn random_frames_agree_with_the_reference() {
    agree(150);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn many_random_frames_agree_with_the_reference() {
    agree(40_000);
}
