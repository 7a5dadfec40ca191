//! `drivebench sim --bus unitek` as clients of others see it: real sockets, real pseudo terminals, the real program.
//!
//! Every wait has an end that a loaded machine does not reach.

use crate::serve::{Sim, connect, path};
use harness::link::frames::{AdapterPlace, AdapterSettings, FrameLink};
use harness::link::{Line, Link};
use harness::medium::Out;
use harness_proto::can::BitRate;
use harness_proto::can::{CanEvent, Frame, Id};
use harness_proto::time::{Instant, Span};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Command;
use std::sync::Arc;

const BUS: [&str; 2] = ["--bus", "unitek"];

fn start(arguments: &[&str]) -> Sim {
    Sim::start(&[&BUS, arguments].concat())
}

/// Reads up to `end`.
fn until(stream: &mut impl Read, end: &str) -> String {
    let mut text = String::new();
    let mut byte = [0];
    while !text.ends_with(end) {
        stream.read_exact(&mut byte).expect("more");
        text.push(char::from(byte[0]));
    }
    text
}

/// Python-can, as a vehicle's controller would use it, over every way in.
#[test]
fn python_can_talks_to_a_drive() {
    let Some(python) = crate::python::with("can", "SLCAN and socketcand as it speaks them") else {
        return;
    };
    let terminal = path("slcan-python");
    let mut sim = start(&[
        "--slcan",
        "127.0.0.1:0",
        "--socketcand",
        "127.0.0.1:0",
        "--slcan-pty",
        terminal.to_str().expect("text"),
    ]);
    let slcan = format!("socket://{}", sim.address());
    let socketcand = sim.address();
    let terminal = sim.address();
    for (interface, channel) in [
        ("slcan", slcan),
        ("slcan", terminal),
        ("socketcand", socketcand),
    ] {
        let script = concat!(
            env!("TREE"),
            "/harness/drivebench/tests/served/python_can.py"
        );
        let mut command = Command::new(&python);
        let output = command.args([script, interface, &channel]).output();
        let output = output.expect("python");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{interface} {channel}: {said}");
        assert_eq!(output.stdout, b"done\n", "{interface} {channel}: {said}");
    }
}

/// Clients of both languages share one bus, and Ctrl-C ends it cleanly.
#[test]
fn clients_of_both_languages_share_a_bus() {
    let mut sim = start(&[
        "--drives",
        "2",
        "--slcan",
        "127.0.0.1:0",
        "--socketcand",
        "127.0.0.1:0",
    ]);
    let line = sim.line();
    assert!(
        line.starts_with("slcan: 2 drives, 500 kbit/s at 127.0.0.1:"),
        "{line}"
    );
    let mut slcan = connect(line.split(' ').next_back().expect("a word"));
    let mut daemon = connect(&sim.address());
    assert_eq!(until(&mut daemon, ">"), "< hi >");
    daemon.write_all(b"< open can0 >< rawmode >").expect("sent");
    assert_eq!(until(&mut daemon, "ok >"), "< ok >");
    assert_eq!(until(&mut daemon, "ok >"), "< ok >");
    slcan.write_all(b"S6\rO\rt20233D1B00\r").expect("sent");
    assert_eq!(until(&mut slcan, "z\r"), "\r\rz\r");
    // Node 2 answers; the daemon's client hears request and reply.
    assert_eq!(until(&mut slcan, "\r"), "t18241BD80100\r");
    assert!(until(&mut daemon, ">").starts_with("< frame 202 "));
    let reply = until(&mut daemon, ">");
    assert!(
        reply.starts_with("< frame 182 ") && reply.ends_with(" 1BD80100 >"),
        "{reply}"
    );
    daemon.write_all(b"< send 201 3 3d 1b 0 >").expect("sent");
    assert_eq!(until(&mut slcan, "\r"), "t20133D1B00\r");
    assert_eq!(until(&mut slcan, "\r"), "t18141BD80100\r");
    sim.signal("-INT");
    assert_eq!(sim.code(), Some(130));
}

/// A mistake is answered, said once to people, and nothing else suffers by it.
#[test]
fn mistakes_of_clients_are_named() {
    let mut sim = start(&["--slcan", "127.0.0.1:0", "--socketcand", "127.0.0.1:0"]);
    let slcan = sim.address();
    let mut wrong = connect(&slcan);
    wrong.write_all(b"GET / HTTP/1.1\r\n\r\n").expect("sent");
    assert_eq!(until(&mut wrong, "\r"), "\x07\r");
    assert!(sim.said().ends_with("came"));
    let said = sim.said();
    assert!(
        said.contains("received \"GET / HTTP/1.1\"") && said.contains("t, T, r, R"),
        "{said}"
    );
    let mut daemon = connect(&sim.address());
    assert_eq!(until(&mut daemon, ">"), "< hi >");
    daemon.write_all(b"< rawmode >< hello >").expect("sent");
    let answer = until(&mut daemon, " >");
    assert!(answer.starts_with("< error no bus is open"), "{answer}");
    let answer = until(&mut daemon, " >");
    assert!(answer.starts_with("< error received"), "{answer}");
    let mut right = connect(&slcan);
    right.write_all(b"O\rV\rt2010\r").expect("sent");
    assert_eq!(until(&mut right, "z\r"), "\rV1010\rz\r");
}

/// Floods of characters that are no line cost a line, and the other clients are served.
#[test]
fn a_flood_is_dropped() {
    let mut sim = start(&["--slcan", "127.0.0.1:0"]);
    let address = sim.address();
    let mut flood = connect(&address);
    let junk = [b'x'; 1 << 16];
    for _ in 0..64 {
        flood.write_all(&junk).expect("taken");
    }
    flood.write_all(b"\rV\r").expect("sent");
    assert_eq!(until(&mut flood, "\r"), "\x07V1010\r");
    let mut right = connect(&address);
    right.write_all(b"V\r").expect("sent");
    assert_eq!(until(&mut right, "\r"), "V1010\r");
}

#[test]
fn options_that_do_not_fit_are_refused() {
    for (arguments, words) in [
        (&["--bus", "unitek", "--tcp", "127.0.0.1:0"][..], "--slcan"),
        (&["--slcan", "127.0.0.1:0"][..], "--bus unitek"),
        (
            &["--bus", "unitek", "--slcan", "0.0.0.0:0"][..],
            "--allow-remote",
        ),
        (&["--bus", "unitek", "--slcan", "nowhere"][..], "HOST:PORT"),
        (
            &["--bus", "nordac", "--slcan", "127.0.0.1:0"][..],
            "--tcp or --pty",
        ),
    ] {
        let mut sim = Sim::start(arguments);
        assert_eq!(sim.code(), Some(2), "{arguments:?}");
        let said = sim.said();
        assert!(said.contains(words), "{said}");
    }
}

/// A client that sends and closes at once has sent.
#[test]
fn what_a_client_sent_last_goes_its_way() {
    let mut sim = start(&["--slcan", "127.0.0.1:0"]);
    let address = sim.address();
    let mut listener = connect(&address);
    listener.write_all(b"L\rV\r").expect("sent");
    until(&mut listener, "V1010\r");
    let mut short = TcpStream::connect(&address).expect("the server listens");
    short.write_all(b"O\rt2013D40000\rC\r").expect("sent");
    drop(short);
    assert_eq!(until(&mut listener, "\r"), "t2013D40000\r");
}

/// The bench's own link over every way in: a request and its reply, and nothing that a listener says.
#[test]
fn the_bench_s_own_link_talks_to_a_drive() {
    let terminal = path("slcan-link");
    let terminal = terminal.to_str().expect("text");
    let slcan = ["--slcan", "127.0.0.1:0", "--slcan-pty", terminal];
    let mut sim = start(&[&slcan[..], &["--socketcand", "127.0.0.1:0"]].concat());
    let (slcan, socketcand) = (sim.address(), sim.address());
    for place in [
        AdapterPlace::slcan(&slcan),
        AdapterPlace::slcan(terminal),
        AdapterPlace::Socketcand {
            address: socketcand,
            channel: "can0".to_owned(),
        },
    ] {
        let settings = |listen_only| AdapterSettings {
            place: place.clone(),
            rate: BitRate::K500,
            listen_only,
            may_acknowledge: false,
        };
        let drive = vec![(Id::base(0x181).expect("small"), 1)];
        let open = |settings| FrameLink::open(&settings, drive.clone(), Arc::default());
        let mut link = open(settings(false)).expect("an adapter");
        link.begin();
        let asked: Frame = "201#3D1B00".parse().expect("a frame");
        link.send(0, Out::Frames(&[asked]));
        let long = Instant::START + Span::from_millis(60_000);
        let reply = loop {
            if let Some(reply) = link.receive(0) {
                break reply;
            }
            assert!(link.wait(long) && link.now() < long, "{:?}", link.trouble());
        };
        let (at, heard) = reply;
        let expected: Frame = "181#1BD80100".parse().expect("a frame");
        assert_eq!(heard.frame(), Some(CanEvent::Frame(expected)));
        assert!(at <= link.now());
        let trace = link.trace(0);
        let from = |frame: &harness_sim::record::LineFrame| (frame.from, frame.frame);
        let carried: Vec<_> = trace.channels[0].frames().iter().map(from).collect();
        assert_eq!(carried, [(None, asked), (Some(1), expected)]);
        drop(link);
        let mut listener = open(settings(true)).expect("an adapter");
        listener.send(0, Out::Frames(&[asked]));
        assert_eq!(listener.refused(), 1, "{place:?}");
    }
}

/// Header lines describe the drives, and lines of control act on them while a client listens (ex 10-1).
#[test]
fn drives_are_set_up_and_acted_on() {
    let setup = path("can-setup.scn");
    std::fs::write(&setup, "rate 250\ndrive 3 rx 210 tx 190\n").expect("room");
    let setup = setup.to_str().expect("text");
    let places = ["--slcan", "127.0.0.1:0", "--control", "127.0.0.1:0"];
    let mut sim = start(&[&["--setup", setup][..], &places].concat());
    let line = sim.line();
    assert!(
        line.starts_with("slcan: 1 drive, 250 kbit/s at 127.0.0.1:"),
        "{line}"
    );
    let mut slcan = connect(line.split(' ').next_back().expect("a word"));
    let mut control = connect(&sim.address());
    slcan
        .write_all(b"S5\rO\rt2103520C00\rt2103511000\rt21033D5100\r")
        .expect("sent");
    assert_eq!(until(&mut slcan, "00\r"), "\r\rz\rz\rz\rt190451100000\r");
    control
        .write_all(b"drive 3 input limit1 high\nstate 3 MODE\n")
        .expect("sent");
    assert_eq!(until(&mut control, "\n"), "ok\n");
    assert_eq!(until(&mut control, "\n"), "ok MODE=0010\n");
    assert_eq!(until(&mut slcan, "\r"), "t1906400501000000\r");
    let wrong = path("can-wrong.scn");
    std::fs::write(&wrong, "drive 1 colour = red\n").expect("room");
    let wrong = wrong.to_str().expect("text");
    let mut sim = start(&["--setup", wrong, "--slcan", "127.0.0.1:0"]);
    assert_eq!(sim.code(), Some(2));
}
