//! Talks to drives through the driver: here simulated ones. `Drives::open("desk.toml", true)` opens those of a rig instead.

use harness::Drives;
use std::io::Write;
use std::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout();
    let drives = Drives::simulated(3, "")?;
    for axis in drives.axes() {
        let state = drives.state(axis)?;
        writeln!(out, "drive {axis}: {}", state.mode())?;
    }
    drives.write(1, "nsoll=300rpm")?;
    drives.wait(Duration::from_secs(1));
    let speed = drives.read(1, "nist")?;
    writeln!(out, "drive 1 turns at {speed}")?;
    assert!(
        speed
            .number()
            .is_some_and(|rpm| (250.0..350.0).contains(&rpm))
    );
    drives.stop(1)?;
    drives.close()?;
    Ok(())
}

#[test]
fn the_example_holds() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
