//! The guard: attacks on it, its effect on ordinary traffic, and the safe state.

mod attack;
mod safe_state;
mod speed;
mod traffic;
mod trouble;

use crate::driver::{Axis, OpenRings, Options};
use crate::gate::{GuardsRings as _, guard_rings};
use crate::link::BesideTheBus as _;
use crate::link::SimulatedLink;
use harness_bench::guard::Guarded;
use harness_bench::link::{Line as _, Link, Recording};
use harness_bench::medium::Out;
use harness_proto::can::Frame;
use harness_proto::line::Rate;
use harness_proto::nd21::io::Input;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::guard::Limits;
use harness_proto::novobus::properties::Properties;
use harness_sim::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory};
use harness_sim::novobus::bench::Bench;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::ring::Ring;

fn size(drives: u64) -> RingSize {
    RingSize::new(drives).expect("1 to 250")
}

fn axis(number: u16) -> Axis {
    Axis::from_number(number).expect("an axis")
}

/// A ring of ND21 that are ready to turn.
fn ring(drives: u64) -> Ring<Drive> {
    Ring::new(size(drives), Rate::Baud38400, |_| {
        let mut eeprom = factory::eeprom();
        eeprom[0x23] = 0xFB;
        harness_sim::nd21::set_parity(&mut eeprom);
        let choices = Nd21Properties::default();
        let mut drive = Nd21Drive::new(Properties::default(), choices, eeprom);
        drive.stimulate(Stimulus::Input(Input::Gpin3, true));
        drive.stimulate(Stimulus::Input(Input::Gpin5, true));
        Drive::Nd21(drive)
    })
}

fn link(drives: u64) -> SimulatedLink {
    SimulatedLink::new(Bench::one(ring(drives)))
}

/// The same behind a guard, synchronised.
fn guarded(drives: u64, limits: Limits) -> Guarded<SimulatedLink> {
    let mut guarded = guard_rings(link(drives), limits);
    guarded.synchronise();
    assert_eq!(guarded.drives(0), size(drives).drives());
    guarded
}

fn bus(line: &mut Guarded<SimulatedLink>, drives: u64) -> OpenRings<'_> {
    OpenRings::open(Box::new(line), &[size(drives)], Options::default()).expect("an open bus")
}

/// A simulation is shown by the link itself, through a guard and by a whole recording; a recording as of a rig hides it.
#[test]
fn only_a_recording_of_a_rig_hides_the_simulation() {
    let sees = |link: &dyn Link| {
        let cell = link.peek(0, 1, 0xFE00);
        assert_eq!(cell.is_some(), link.error_of(0, 1).is_some());
        cell.is_some()
    };
    assert!(sees(&link(2)));
    let mut guarded = guard_rings(link(2), Limits::default());
    assert!(sees(&guarded));
    let mut events = Vec::new();
    assert!(sees(&Recording::whole(&mut guarded, &mut events)));
    assert!(!sees(&Recording::new(&mut guarded, &mut events)));
}

/// The guard of rings judges bytes; nothing leaves through a guard that does not judge it.
#[test]
fn no_frame_passes() {
    let frames: [Frame; 1] = ["201#3D4000".parse().expect("a frame")];
    let mut guarded = guard_rings(link(2), Limits::default());
    assert!(!guarded.permits(0, Out::Frames(&frames)));
    guarded.send(0, Out::Frames(&frames));
    assert_eq!(guarded.inner().carried(), 0);
    let trouble = guarded.trouble().expect("trouble").to_string();
    assert!(trouble.contains("frames are not sent"), "{trouble}");
}
