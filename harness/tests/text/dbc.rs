//! The DBC file of drives on CAN, read and written by cantools. The crate `harness-judges` holds it against another reader and the table of registers.

use std::path::{Path, PathBuf};
use std::process::Command;

fn dbc(drives: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["dbc", "--drives", drives])
        .output()
        .expect("the program");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

/// A Python that has cantools, found as for python-can; without one, prints that the test `who` is skipped.
fn cantools(who: &str) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin/python");
    let given = std::env::var_os("DRIVEBENCH_PYTHON").map(PathBuf::from);
    let imports = |python: &PathBuf| {
        let output = Command::new(python)
            .args(["-c", "import cantools"])
            .output();
        output.is_ok_and(|output| output.status.success())
    };
    let found = given
        .into_iter()
        .chain([own, "python3".into()])
        .find(imports);
    crate::debian::told(found.is_some(), "cantools", who);
    found
}

/// The frames of the manual's examples (ex 3, 7, 10), read and written by cantools.
#[test]
fn cantools_reads_and_writes_examples() {
    let who = "cantools_reads_and_writes_examples";
    let Some(python) = cantools(who) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("drives.dbc");
    std::fs::write(&path, dbc("1")).expect("room");
    let program = "
import cantools, sys
db = cantools.database.load_file(sys.argv[1])
tx = lambda text: db.get_message_by_name('DriveTx').decode(bytes.fromhex(text), allow_truncated=True)
rx = lambda text: db.get_message_by_name('DriveRx').decode(bytes.fromhex(text), allow_truncated=True)
def show(all):
    print(' '.join(f'{name}={float(value):.3f}' if isinstance(value, (int, float)) else f'{name}={value}' for name, value in all.items()))
show(tx('30CD0C00'))
show(tx('3000C000'))
status = tx('408001000000')
print(' '.join(name for name, value in status.items() if str(value) == 'yes'))
show(rx('3D30FF'))
show(rx('3D4064'))
show(rx('31CD0C'))
print(db.get_message_by_name('DriveRx').encode({'REGID': 0x3D, 'READ': 'STATUS', 'INTERVAL': 100}).hex())
print(db.get_message_by_name('DriveRx').encode({'REGID': 0x31, 'SPEED_CMD': -50.0}).hex())
";
    let output = Command::new(python)
        .args(["-c", program])
        .arg(&path)
        .output()
        .expect("python");
    let said = String::from_utf8_lossy(&output.stdout);
    let wrong = String::from_utf8_lossy(&output.stderr);
    let expected = "\
REGID=48.000 SPEED_ACTUAL=10.001
REGID=48.000 SPEED_ACTUAL=-50.002
STATUS_P_N STATUS_N_I
REGID=61.000 READ=SPEED_ACTUAL INTERVAL=stop
REGID=61.000 READ=STATUS INTERVAL=100.000
REGID=49.000 SPEED_CMD=10.001
3d40640000
3100c00000
";
    assert_eq!(said, expected, "{wrong}");
}
