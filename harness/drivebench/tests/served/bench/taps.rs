//! Taps let scenarios be judged that look at the error mode of single drives (ND21 9.7).

use super::Desk;
use crate::program::{ended, said, verify};
use crate::ring::Served;
use std::net::TcpListener;

/// An address that nothing listens at.
fn free() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a socket");
    listener.local_addr().expect("an address").to_string()
}

/// The summary names the taps that would let more scenarios be played, and how many; with these taps that many more are judged.
#[test]
fn taps_unlock_what_is_said_of_them() {
    let names = [
        "10.1-read-byte-wrong",
        "10.1-read-word-wrong",
        "10.3-and-wrong",
        "10.3-or-wrong",
    ];
    let places = [free(), free()];
    let taps = ["2->1", "1->0"].map(|link| link.to_owned());
    let options: Vec<_> = taps
        .iter()
        .zip(&places)
        .map(|(link, at)| format!("{link}={at}"))
        .collect();
    let served = Served::start(
        "nd21",
        &[3],
        "tcp",
        true,
        &["--tap", &options[0], "--tap", &options[1]],
    );
    let desk = Desk::of(&served);
    let arguments = [&["run", "--allow-motion"][..], &names].concat();
    let without = desk.run(&arguments);
    ended(&without, 5, "0 passed, 0 failed, 4 skipped");
    ended(
        &without,
        5,
        "more scenarios with: taps at 1->0 and 2->1 (4)\n",
    );
    let path = desk.path("desk.toml");
    let mut text = std::fs::read_to_string(&path).expect("a rig");
    for (link, at) in taps.iter().zip(&places) {
        text += &format!(
            "[[tap]]\nlink = \"{link}\"\ntransport = \"tcp\"\nport = \"{at}\"\nmarks = \"in-band\"\n"
        );
    }
    std::fs::write(&path, &text).expect("room");
    // What a busy computer hands over too late is inconclusive.
    let judged = (0..5).any(|number| {
        let kept = desk.path(&format!("kept-{number}"));
        let name = kept.to_str().expect("a name");
        let with = desk.run(&[&arguments[..], &["--evidence", name]].concat());
        let said = said(&with);
        assert!(
            !said.contains("skipped") && said.contains("0 failed"),
            "{said}"
        );
        ended(&verify(&kept), 0, "0 things wrong");
        with.status.code() == Some(0)
    });
    assert!(judged, "five runs, and in each something was not seen");
    // One tap is not enough, and the summary says what the other one adds.
    let (one, _) = text.rsplit_once("[[tap]]").expect("two taps");
    std::fs::write(&path, one).expect("room");
    let half = desk.run(&arguments);
    ended(&half, 5, "more scenarios with: a tap at 1->0 (4)\n");
}

/// Every client of a tap on a pseudo terminal gets the bytes of its link, also the program's own, which opens the port more than once.
#[test]
fn a_tap_on_a_pseudo_terminal_gives_its_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |link: &str| folder.path().join(link).display().to_string();
    let links = ["2->1", "1->0"];
    let options = links.map(|link| format!("{link}={}", place(link)));
    let taps = ["--tap", &options[0], "--tap", &options[1]];
    let served = Served::start("nd21", &[3], "pty", true, &taps);
    let desk = Desk::of(&served);
    let path = desk.path("desk.toml");
    let mut text = std::fs::read_to_string(&path).expect("a rig");
    for link in links {
        let port = place(link);
        text += &format!(
            "[[tap]]\nlink = \"{link}\"\ntransport = \"pty\"\nport = \"{port}\"\nmarks = \"in-band\"\n"
        );
    }
    std::fs::write(&path, &text).expect("room");
    for number in 0..3 {
        let kept = desk.path(&format!("kept-{number}"));
        let name = kept.to_str().expect("a name");
        let run = ["run", "9.2-synco", "--evidence", name];
        // Of a busy computer the verdict is not that of the taps.
        let _verdict = desk.run(&run);
        let capture = std::fs::read_to_string(kept.join("captures/9.2-synco.1.json"));
        let capture: serde_json::Value =
            serde_json::from_str(&capture.expect("a capture")).expect("JSON");
        for link in 0..4 {
            let bytes = &capture["links"][link]["bytes"];
            assert!(
                bytes.as_array().is_some_and(|list| !list.is_empty()),
                "{link}"
            );
        }
    }
}
