//! Talks to drives through the driver: here simulated ones. `Drives::open("desk.toml", true)` opens those of a rig instead.

use harness::{Drives, Error};
use std::time::Duration;

fn main() -> Result<(), Error> {
    let drives = Drives::simulated(3, "")?;
    for axis in drives.axes() {
        let state = drives.state(axis)?;
        println!("drive {axis}: {}", state.mode());
    }
    drives.write(1, "nsoll=300rpm")?;
    drives.wait(Duration::from_secs(1));
    let speed = drives.read(1, "nist")?;
    println!("drive 1 turns at {speed}");
    assert!(
        speed
            .number()
            .is_some_and(|rpm| (250.0..350.0).contains(&rpm))
    );
    drives.stop(1)?;
    drives.close()
}
