//! Places of taps and interposers that the command line refuses, with the reason.

use std::process::Command;

#[test]
fn what_is_refused() {
    for (arguments, part) in [
        (
            &["--tap", "2->0=127.0.0.1:0"][..],
            "a ring of 4 has no such link",
        ),
        (
            &["--tap", "4->3=127.0.0.1:0"],
            "a ring of 4 has no such link",
        ),
        (
            &["--cut", "master->3=127.0.0.1:0"],
            "a link between two drives",
        ),
        (&["--tap", "2:2->1=127.0.0.1:0"], "the bench has one ring"),
        (&["--tap", "3:2->1=127.0.0.1:0"], "there is no ring 3"),
        (&["--tap", "2->1"], "a link and a place expected"),
        (&["--tap", "2->1="], "a link and a place expected"),
        (&["--tap", "21=x:0"], "is not a link"),
        (&["--tap", "2->1=a:0,b:0"], "one place expected for a tap"),
        (
            &["--cut", "2->1=a:0,b:0,c:0"],
            "one place expected for a tap",
        ),
        (
            &["--tap", "2->1=a:0", "--cut", "2->1=b:0"],
            "uses this link already",
        ),
        (&["--cut", "2->1=0.0.0.0:0"], "--allow-remote"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
            .args([
                "sim",
                "--rig",
                "sim:4",
                "--tcp",
                "127.0.0.1:0",
                "--for",
                "1s",
            ])
            .args(arguments)
            .output()
            .expect("the program");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(part), "{arguments:?}: {said}");
    }
}
