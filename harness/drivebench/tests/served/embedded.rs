//! The crate as another program uses it: the drives of a rig.

use harness::{Drives, Error, Served};
use std::fs::write;
use tempfile::tempdir;

/// What the rig's file denies does not reach the wire, and the safe state is what is left.
#[test]
fn a_rig_s_limits_hold() {
    let folder = tempdir().expect("a folder");
    let served = Served::ring(2, "", "127.0.0.1:0").expect("a ring");
    let rig = folder.path().join("desk.toml");
    let text = format!(
        "schema = 1\n[rig]\nid = \"embedded-{}\"\n[ring.1]\ntransport = \"tcp\"\nport = \"{}\"\ndrives = 2\n\
         [limits]\nallow_motion = true\nmax_speed = \"500 rpm\"\n",
        std::process::id(),
        served.address()
    );
    write(&rig, text).expect("a file");
    let drives = Drives::open(rig.to_str().expect("text"), true).expect("a rig");
    drives
        .delete_error(1)
        .expect("an error of the check sequence");
    let denied = drives.write(1, "nsoll=1500rpm");
    let Err(Error::Drive(why)) = denied else {
        panic!("beyond max_speed: {denied:?}");
    };
    assert!(why.contains("max_speed"), "{why}");
    drives.close().expect("its safe state");
}
