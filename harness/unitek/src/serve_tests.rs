//! Clients of a simulated bus in virtual time: nothing here depends on the speed of a machine.

use super::serve::{SharedDrives, bench};
use harness_bench::scenario::source::Source;
use harness_bench::serve::ControlAnswer;
use harness_bench::serve::frames::{FrameServer, MOST_CLIENTS, Protocol, SharedBus};
use harness_proto::time::{Instant, Span};
use std::time::Duration;

fn at(micros: u64) -> Instant {
    Instant::START + Span::from_micros(micros)
}

/// A server with drives as delivered; its time began 1000.5 s after 1970.
fn server(drives: u8) -> FrameServer<SharedDrives> {
    let started = Duration::from_millis(1_000_500);
    let plan = bench(Some(drives), None).expect("no header");
    FrameServer::new(SharedDrives::new(plan), started)
}

/// A client that has opened its channel.
fn slcan(server: &mut FrameServer<SharedDrives>, opening: &str) -> usize {
    let client = server.come(Protocol::Slcan).expect("a place");
    assert_eq!(server.receive(client, opening.as_bytes()), [""; 0]);
    took(server, client);
    client
}

/// A client that has said nothing behind `rawmode`.
fn silent(server: &mut FrameServer<SharedDrives>) -> usize {
    let client = server.come(Protocol::Socketcand).expect("a place");
    assert_eq!(took(server, client), "< hi >");
    assert_eq!(
        server.receive(client, b"< open vcan0 >< rawmode >"),
        [""; 0]
    );
    assert_eq!(took(server, client), "< ok >< ok >");
    client
}

fn socketcand(server: &mut FrameServer<SharedDrives>) -> usize {
    let client = silent(server);
    assert_eq!(server.receive(client, b"< echo >"), [""; 0]);
    assert_eq!(took(server, client), "< echo >");
    client
}

/// What the client reads now.
fn took(server: &mut FrameServer<SharedDrives>, client: usize) -> String {
    let text = String::from_utf8_lossy(server.transmit(client)).into_owned();
    server.transmitted(client, text.len());
    text
}

/// Lets time pass as the shell does: from deadline to deadline.
fn run(server: &mut FrameServer<SharedDrives>, until: Instant) {
    server.advance(server.deadline().min(until));
    while server.deadline() < until {
        server.advance(server.deadline());
    }
    server.advance(until);
}

/// A client that waits after the answer to `rawmode` finds no frame in its segment, and gets what it was not sent in time, with right times.
#[test]
fn frames_are_held_back_behind_the_answer_to_rawmode() {
    let mut server = server(1);
    let one = slcan(&mut server, "O\r");
    // A cycle of 10 ms.
    server.receive(one, b"t20133D300A\r");
    run(&mut server, at(5_000));
    let waiting = silent(&mut server);
    for until in [30_000, 60_000, 104_999] {
        run(&mut server, at(until));
        assert_eq!(took(&mut server, waiting), "", "{until}");
    }
    assert_eq!(server.deadline(), at(105_000));
    run(&mut server, at(105_000));
    let held = took(&mut server, waiting);
    let times: Vec<_> = held
        .split("< frame 181 ")
        .skip(1)
        .map(|line| &line[..9])
        .collect();
    assert_eq!(times.len(), 10, "{held}");
    assert_eq!((times[0], times[9]), ("1000.5101", "1000.6001"), "{held}");

    // A client that speaks has read the answer.
    let speaking = silent(&mut server);
    run(&mut server, at(130_000));
    assert_eq!(took(&mut server, speaking), "");
    server.receive(speaking, b"< echo >");
    run(&mut server, at(130_001));
    let heard = took(&mut server, speaking);
    assert!(
        heard.starts_with("< echo >< frame 181 1000.6101"),
        "{heard}"
    );
    assert_eq!(heard.matches("frame").count(), 2, "{heard}");
    run(&mut server, at(139_000));
    assert_eq!(took(&mut server, speaking).matches("frame").count(), 1);
}

/// The lower identifier wins, each client hears the other and not itself, and the drive answers after both.
#[test]
fn frames_of_clients_go_through_the_arbitration() {
    let mut server = server(1);
    let [one, two] = [slcan(&mut server, "S6\rO\r"), slcan(&mut server, "O\r")];
    server.advance(at(1_500));
    server.receive(one, b"t20133D1B00\r");
    server.receive(two, b"t1000\r");
    run(&mut server, at(10_000));
    assert_eq!(took(&mut server, one), "z\rt1000\rt18141BD80100\r");
    assert_eq!(took(&mut server, two), "z\rt20133D1B00\rt18141BD80100\r");
}

/// A frame is handed over when its last bit has passed, and not before.
#[test]
fn frames_come_when_they_have_ended() {
    let mut server = server(1);
    let one = slcan(&mut server, "Z1\rO\r");
    let two = socketcand(&mut server);
    server.advance(at(2_000));
    server.receive(one, b"t20133D1B00\r");
    // 77 bits of request, of which 3 are the intermission: see the test of the simulated bench.
    let bits = |text: &str| {
        text.parse::<harness_proto::can::Frame>()
            .expect("a frame")
            .wire_bits()
    };
    let request = u64::from(bits("201#3D1B00"));
    let reply = u64::from(bits("181#1BD80100"));
    run(&mut server, at(2_000 + 2 * (request - 3) - 1));
    assert_eq!(took(&mut server, two), "");
    assert_eq!(server.deadline(), at(2_000 + 2 * (request - 3)));
    run(&mut server, at(2_000 + 2 * (request - 3)));
    let stamp = 502_000 + 2 * (request - 3);
    assert_eq!(
        took(&mut server, two),
        format!("< frame 201 1000.{stamp} 3D1B00 >")
    );
    run(&mut server, at(2_000 + 2 * (request + reply - 3)));
    assert_eq!(took(&mut server, one), "z\rt18141BD801000002\r");
}

/// Without a drive that listens nothing is acknowledged: a listener does not do it either. An error that repeats is reported once.
#[test]
fn a_frame_that_nobody_acknowledges() {
    let mut server = server(1);
    let one = slcan(&mut server, "O\r");
    let listener = slcan(&mut server, "L\r");
    assert_eq!(
        server.bus().control("! drive 1: off"),
        Some(ControlAnswer::Ok)
    );
    server.receive(one, b"t20133D1B00\r");
    run(&mut server, at(50_000));
    assert_eq!(took(&mut server, one), "z\r");
    server.receive(one, b"F\rF\r");
    assert_eq!(took(&mut server, one), "FA0\rF00\r");
    assert_eq!(took(&mut server, listener), "");
    assert_eq!(server.receive(listener, b"t2010\r"), [""; 0]);
    assert_eq!(took(&mut server, listener), "\x07");
    // A station that acknowledges: the frame is sent after all.
    let daemon = socketcand(&mut server);
    run(&mut server, at(60_000));
    assert!(took(&mut server, daemon).contains("< frame 201 "));
    // And again without one: the daemon's client is told once.
    server.receive(one, b"C\r");
    run(&mut server, at(70_000));
    server.receive(daemon, b"< send 100 0 >");
    run(&mut server, at(90_000));
    let told = took(&mut server, daemon);
    assert_eq!(told.matches("< error 020 1000.5").count(), 1, "{told}");
}

/// A client that does not read costs bounded memory, and the others lose nothing.
#[test]
fn a_client_that_does_not_read_loses_frames() {
    let mut server = server(1);
    let [slow, quick] = [slcan(&mut server, "O\r"), slcan(&mut server, "O\r")];
    server.receive(quick, b"t20133D3001\r");
    let mut came = 0;
    for second in 1..=10 {
        run(&mut server, at(second * 1_000_000));
        came += took(&mut server, quick).matches("t181").count();
    }
    assert_eq!((came, server.lost(quick)), (9_999, 0));
    assert!(server.transmit(slow).len() <= 64 << 10);
    assert!(server.lost(slow) > 4_000, "{}", server.lost(slow));
    // It is read again only when there is room for its answers.
    assert!(server.room(slow) < 64);
}

/// A client that sends faster than the bus is not read meanwhile; nothing is lost.
#[test]
fn a_client_that_sends_fast_waits() {
    let mut server = server(1);
    let [fast, other] = [slcan(&mut server, "O\r"), slcan(&mut server, "O\r")];
    let mut left = "t1000\r".repeat(2_000).into_bytes();
    let mut heard = 0;
    let mut time = 0;
    while heard < 2_000 {
        let count = server.room(fast).min(left.len()).min(4_096);
        let part: Vec<u8> = left.drain(..count).collect();
        server.receive(fast, &part);
        let waiting = SharedBus::host(server.bus(), fast)
            .expect("a place")
            .waiting();
        assert!(waiting < 64 + 4_096 / 6 + 1, "{waiting}");
        time += 1_000;
        assert!(time < 1_000_000, "{heard} heard");
        run(&mut server, at(time));
        took(&mut server, fast);
        heard += took(&mut server, other).matches("t1000").count();
    }
    assert_eq!(heard, 2_000);
}

#[test]
fn a_client_at_another_rate_hears_nothing_and_is_told() {
    let mut server = server(1);
    let right = slcan(&mut server, "O\r");
    let wrong = server.come(Protocol::Slcan).expect("a place");
    let said = server.receive(wrong, b"S5\rO\rt20133D1B00\r").join("");
    assert!(
        said.contains("250 kbit/s, and the bus runs at 500 kbit/s"),
        "{said}"
    );
    server.receive(right, b"t20133D1B00\r");
    run(&mut server, at(10_000));
    assert_eq!(took(&mut server, right), "z\rt18141BD80100\r");
    assert_eq!(took(&mut server, wrong), "\r\rz\r");
    server.receive(wrong, b"F\rC\rS6\rO\r");
    server.receive(wrong, b"t20133D1B00\r");
    run(&mut server, at(20_000));
    assert_eq!(took(&mut server, wrong), "FA0\r\r\r\rz\rt18141BD80100\r");
    let said = server.receive(wrong, b"C\rs0000\r").join("");
    assert!(said.contains("SJA1000"), "{said}");
}

/// A channel that is open cannot be opened, set up or timed again; a closed one sends nothing.
#[test]
fn commands_out_of_place_are_refused() {
    let mut server = server(1);
    let one = server.come(Protocol::Slcan).expect("a place");
    server.receive(one, b"t2010\rF\rC\rN\rO\rO\rL\rS6\rZ1\rC\rC\r\r");
    assert_eq!(
        took(&mut server, one),
        "\x07\x07\x07NSIM1\r\r\x07\x07\x07\x07\r\x07\r"
    );
}

#[test]
fn places_are_limited_and_used_again() {
    let mut server = server(1);
    let all: Vec<_> = (0..MOST_CLIENTS)
        .map(|_| slcan(&mut server, "O\r"))
        .collect();
    assert_eq!(server.come(Protocol::Slcan), None);
    server.receive(all[3], b"t1230\r");
    server.go(all[3]);
    run(&mut server, at(10_000));
    assert!(
        took(&mut server, all[0]).contains("t1230"),
        "it goes its way"
    );
    assert_eq!(server.come(Protocol::Socketcand), Some(all[3]));
}

/// An adapter stamps frames by a clock of its own. It goes on where the bus stood still because the computer did.
#[test]
fn stamps_go_on_while_the_computer_stands_still() {
    let mut server = server(1);
    let client = slcan(&mut server, "S6\rZ1\rO\r");
    assert_eq!(server.receive(client, b"t20133D1B0A\r"), [""; 0]);
    let stamps = |text: &str| -> Vec<u64> {
        let frames = text.split('\r').filter(|line| line.starts_with("t181"));
        let stamp = |line: &str| u64::from_str_radix(&line[line.len() - 4..], 16).expect("a stamp");
        frames.map(stamp).collect()
    };
    run(&mut server, at(100_000));
    let before = stamps(&took(&mut server, client));
    assert!(
        matches!(before[..], [.., last] if (90..=100).contains(&last)),
        "{before:?}"
    );
    // It stands still for 5 s, and the bus makes up for one of them.
    run(&mut server, at(5_100_000));
    took(&mut server, client);
    run(&mut server, at(5_200_000));
    let behind = stamps(&took(&mut server, client));
    assert!(
        matches!(behind[..], [first, .., last] if first >= 5_100 && last >= 5_190),
        "{behind:?}"
    );
}

/// A bus on which nothing happens is looked at once a second; a program that was stopped resumes where it was.
#[test]
fn an_idle_bus_rests_and_a_late_server_resumes() {
    let mut server = server(1);
    let one = slcan(&mut server, "O\r");
    run(&mut server, at(10_000));
    assert_eq!(server.deadline(), at(1_010_000));
    server.receive(one, b"t20133D3064\r");
    server.advance(at(3_600_000_000));
    let came = took(&mut server, one).matches("t181").count();
    assert!((9..=10).contains(&came), "a second was made up for: {came}");
}

/// Lines of control act on drives beside the clients, and an event is sent for what they do (ex 10-1).
#[test]
fn lines_of_control_act_on_drives() {
    let mut server = server(1);
    let one = slcan(&mut server, "O\r");
    server.receive(one, b"t2013520C00\rt2013511000\r");
    run(&mut server, at(10_000));
    took(&mut server, one);
    let mut control = |line: &str| server.bus().control(line).map(|answer| answer.to_string());
    assert_eq!(control("drive 1 input limit1 high").as_deref(), Some("ok"));
    assert_eq!(
        control("? drive 1 register 52 = 0000000C").as_deref(),
        Some("ok")
    );
    let no = control("? drive 1 register 51 = 0").expect("an answer");
    assert!(no.starts_with("no: register 51 (MODE) reads 0010"), "{no}");
    assert_eq!(
        control("state 1 MODE 52").as_deref(),
        Some("ok MODE=0010 STATUS_MASK=0000000C")
    );
    let state = control("state 1").expect("an answer");
    assert!(
        state.starts_with("ok MODE=0010 STATUS=00000105 ERR_BITMAP1=00000000 "),
        "{state}"
    );
    for line in [
        "state 2",
        "state",
        "state 1 NONSENSE",
        "? drive 2 register 51 = 0",
        "> 201 51 00 00",
        "+5ms drive 1 restart",
        "hello",
        "read 1 MODE",
    ] {
        let answer = control(line).expect("an answer");
        assert!(answer.starts_with("error: "), "{line}: {answer}");
    }
    assert_eq!((control("  "), control("# nothing")), (None, None));
    run(&mut server, at(20_000));
    assert_eq!(took(&mut server, one), "t1816400501000000\r");
    assert_eq!(
        server.bus().control("! frame 1: lost"),
        Some(ControlAnswer::Ok)
    );
    server.receive(one, b"t20133D1B00\rt20133D5100\r");
    run(&mut server, at(30_000));
    assert_eq!(took(&mut server, one), "z\rz\rt181451100000\r");
}

/// A header describes the drives; those that `--drives` asks for are added.
#[test]
fn a_header_describes_the_drives() {
    let source = |text: &str| Source::new("desk.scn", text);
    let nodes = |drives, text: &str| {
        let plan = bench(drives, Some(&source(text))).expect("a header");
        let drives = plan.setup.drives.iter();
        let nodes = drives.map(|drive| (drive.node, drive.identifiers.0));
        nodes.collect::<Vec<_>>()
    };
    assert_eq!(nodes(None, "rate 250\n"), [(1, 0x201)]);
    assert_eq!(nodes(None, "drive 3 rx 210 tx 190\n"), [(3, 0x210)]);
    assert_eq!(
        nodes(Some(2), "drive 2 rx 210 tx 190\n> 210 51 04 00\n"),
        [(2, 0x210), (1, 0x201)]
    );
    let plan = bench(
        None,
        Some(&source("rate 250\ndrive 1 register 1B = 0200\n")),
    )
    .expect("a header");
    let mut server = FrameServer::new(SharedDrives::new(plan), Duration::ZERO);
    assert_eq!(server.about(), "1 drive, 250 kbit/s");
    let one = slcan(&mut server, "S5\rO\r");
    server.receive(one, b"t20133D1B00\r");
    run(&mut server, at(10_000));
    assert_eq!(took(&mut server, one), "z\rt18141B000200\r");
    assert!(bench(None, Some(&source("drive 1 colour = red\n"))).is_err());
}
