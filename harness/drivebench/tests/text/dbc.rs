//! The DBC file of drives on CAN, read and written by cantools, and converted by canmatrix. The crate `harness-judges` holds it against another reader and the table of registers.

use std::process::Command;

fn dbc(drives: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["dbc", "--drives", drives])
        .output()
        .expect("the program");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

/// What a program in Python prints for the DBC of one drive; `None` where `modules` are not installed, and the test `who` says so.
fn python(modules: &str, program: &str, who: &str) -> Option<String> {
    let python = crate::python::with(modules, who)?;
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("drive.dbc");
    std::fs::write(&path, dbc("1")).expect("room");
    let output = Command::new(python)
        .args(["-c", program])
        .arg(&path)
        .output()
        .expect("python");
    let wrong = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{wrong}");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The frames of the manual's examples (ex 3, 7, 10), read and written by cantools.
#[test]
fn cantools_reads_and_writes_examples() {
    let who = "cantools_reads_and_writes_examples";
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
    let Some(said) = python("cantools", program, who) else {
        return;
    };
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
    assert_eq!(said, expected);
}

/// canmatrix makes KCD and ARXML of it, which have every signal. A multiplexer inside another leaves ARXML empty, and makes a set point of a
/// read request in KCD.
#[test]
fn canmatrix_converts_it() {
    let who = "canmatrix_converts_it";
    let program = "
import sys
import canmatrix.formats, cantools
path = sys.argv[1]
matrix = canmatrix.formats.loadp_flat(path)
for kind in ('kcd', 'arxml'):
    canmatrix.formats.dumpp({'': matrix}, f'{path}.{kind}')
own = {frame.name: {signal.name for signal in frame.signals} for frame in matrix.frames}
autosar = canmatrix.formats.loadp_flat(f'{path}.arxml')
for frame in autosar.frames:
    name = frame.name.removeprefix('FRAME_')
    print(name, frame.size, {signal.name for signal in frame.signals} == own[name])
db = cantools.database.load_file(f'{path}.kcd')
for text in ('3D3064', '31CD0C', 'D478563412'):
    print(db.get_message_by_name('DriveRx').decode(bytes.fromhex(text), decode_choices=False, allow_truncated=True))
print(db.get_message_by_name('DriveTx').decode(bytes.fromhex('30CD0C00'), allow_truncated=True))
";
    let Some(said) = python("cantools, canmatrix", program, who) else {
        return;
    };
    let expected = "\
DriveRx 5 True
DriveTx 6 True
{'REGID': 61, 'READ': 48, 'INTERVAL': 100}
{'REGID': 49, 'SPEED_CMD': 10.00091245}
{'REGID': 212, 'VAR4': 305419896}
{'REGID': 48, 'SPEED_ACTUAL': 10.00091245}
";
    assert_eq!(said, expected);
}
