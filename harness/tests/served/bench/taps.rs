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
        "more scenarios with: a tap at 1->0 and a tap at 2->1 (4)\n",
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
