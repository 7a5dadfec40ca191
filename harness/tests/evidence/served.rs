//! Evidence of a ring that another process serves, in real time.

use super::ring::Served;
use super::{Desk, ended, said};
use harness::port::Endpoint;

pub(crate) fn desk(served: &Served) -> Desk {
    let Endpoint::Tcp(address) = &served.endpoints[0] else {
        panic!("a socket")
    };
    Desk::new(&format!(
        "drives = {}\ntransport = \"tcp\"\nport = \"{address}\"\nmarks = \"in-band\"\ntime_tolerance = \"20ms\"\n",
        served.sizes[0]
    ))
}

/// The driver's part depends on the time of every look at the port, so the record must hold these.
#[test]
fn untouched_evidence_of_the_driver_verifies() {
    let served = Served::start("nd21", &[3], "tcp", true, &[]);
    let desk = desk(&served);
    let played = desk.run(&[
        "run",
        "--rig",
        "desk.toml",
        "--allow-motion",
        "12.2-driver-read-write",
        "11.6-driver-jobs",
        "12.5-driver-eeprom",
        "9.2-synco",
        "9.7-parity-error",
        "--evidence",
        "kept",
    ]);
    assert!(
        matches!(played.status.code(), Some(0 | 5)),
        "{}",
        said(&played)
    );
    ended(&desk.run(&["verify", "kept"]), 0, "0 things wrong");
}
