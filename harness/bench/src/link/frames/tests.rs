//! The link against adapters and servers made of a socket and a script.

use super::*;
use crate::link::Link;
use crate::medium::Pieces;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::Mutex;

/// What an adapter answers to a command.
type Dialect = fn(&str) -> &'static str;

/// More than anything here takes.
const LONG: Span = Span::from_millis(60_000);

/// What a client has sent so far.
type Transcript = Arc<Mutex<Vec<String>>>;

/// A server that answers each piece of a client's stream, up to one of these characters, with what `answer` gives.
fn server(
    greeting: &'static str,
    ends: &'static [u8],
    answer: impl Fn(&str) -> &'static str + Send + 'static,
) -> (String, Transcript) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let said = Transcript::default();
    let list = Arc::clone(&said);
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        let _sent = stream.write_all(greeting.as_bytes());
        let mut piece = String::new();
        let mut byte = [0];
        while let Ok(1) = stream.read(&mut byte) {
            piece.push(char::from(byte[0]));
            if ends.contains(&byte[0]) {
                let reply = answer(piece.trim_end());
                list.lock()
                    .expect("a list")
                    .push(std::mem::take(&mut piece));
                if stream.write_all(reply.as_bytes()).is_err() {
                    return;
                }
            }
        }
    });
    (address, said)
}

fn slcan(answer: impl Fn(&str) -> &'static str + Send + 'static) -> (String, Transcript) {
    server("", b"\r", answer)
}

/// An adapter that does everything; what it sends on the bus comes back as a frame of a drive.
fn good(command: &str) -> &'static str {
    match command {
        "V" => "V1013\r",
        "F" => "F00\r",
        "t20133D4000" => "z\rt1814408101000005\r",
        command if command.starts_with('t') => "z\r",
        _ => "\r",
    }
}

fn settings(address: &str, listen_only: bool) -> AdapterSettings {
    AdapterSettings {
        place: AdapterPlace::slcan(address),
        rate: BitRate::K500,
        listen_only,
        may_acknowledge: false,
    }
}

fn opened(settings: &AdapterSettings) -> FrameLink {
    let senders = vec![(can::Id::base(0x181).expect("small"), 1)];
    FrameLink::open(settings, senders, Arc::default()).expect("an adapter")
}

fn refused(settings: &AdapterSettings) -> String {
    FrameLink::open(settings, Vec::new(), Arc::default())
        .expect_err("no adapter")
        .to_string()
}

fn frame(text: &str) -> Frame {
    text.parse().expect("a frame")
}

/// Waits for something to come, or for trouble.
fn next(link: &mut FrameLink) -> Option<can::CanEvent> {
    let end = link.now() + LONG;
    while link.now() < end {
        if let Some((_, heard)) = link.receive(0) {
            return heard.frame();
        }
        if !link.wait(end) {
            return link.receive(0).and_then(|(_, heard)| heard.frame());
        }
    }
    None
}

fn lost(link: &FrameLink) -> &str {
    match link.trouble() {
        Some(Trouble::Lost(why)) => why,
        other => panic!("{other:?}"),
    }
}

/// Waits until the link ends.
fn ended(link: &mut FrameLink) -> &str {
    let end = link.now() + LONG;
    while link.now() < end && link.wait(end) {
        while link.receive(0).is_some() {}
    }
    lost(link)
}

#[test]
fn an_adapter_is_opened_asked_and_closed() {
    let (address, said) = slcan(good);
    let mut link = opened(&settings(&address, false));
    link.begin();
    let asked = frame("201#3D4000");
    link.send(0, Out::Frames(&[asked]));
    assert_eq!(
        next(&mut link),
        Some(can::CanEvent::Frame(frame("181#40810100")))
    );
    let trace = link.trace(0);
    let carried: Vec<_> = trace.channels[0]
        .frames()
        .iter()
        .map(|carried| (carried.from, carried.frame))
        .collect();
    assert_eq!(carried, [(None, asked), (Some(1), frame("181#40810100"))]);
    drop(link);
    let commands: Vec<_> = loop {
        let all = said.lock().expect("a list").clone();
        if all.last().is_some_and(|last| last == "C\r") && all.len() > 4 {
            break all.into_iter().filter(|line| line != "F\r").collect();
        }
        std::thread::yield_now();
    };
    assert_eq!(
        commands,
        [
            "N\r",
            "C\r",
            "V\r",
            "S6\r",
            "Z1\r",
            "O\r",
            "t20133D4000\r",
            "C\r"
        ]
    );
}

/// Nothing is sent, and the adapter is opened so that it does not even acknowledge.
#[test]
fn a_listener_sends_nothing() {
    let (address, said) = slcan(|command| match command {
        "L" => "\rt1811AA\r",
        command => good(command),
    });
    let mut link = opened(&settings(&address, true));
    let out = [frame("201#3D4000")];
    assert!(!link.permits(0, Out::Frames(&out)));
    link.send(0, Out::Frames(&out));
    assert_eq!(link.refused(), 1);
    // It is on the bus as soon as the channel is open.
    assert_eq!(next(&mut link), Some(can::CanEvent::Frame(frame("181#AA"))));
    drop(link);
    let said = said.lock().expect("a list").join("");
    assert!(
        said.contains("L\r") && !said.contains("O\r") && !said.contains('t'),
        "{said}"
    );
}

/// An adapter without version, time stamps and status is accepted.
#[test]
fn a_poor_adapter_will_do() {
    let (address, _) = slcan(|command| match command {
        "V" | "Z1" | "F" => "\x07",
        "t20133D4000" => "\rt181440810100\r",
        _ => "\r",
    });
    let mut link = opened(&settings(&address, false));
    link.send(0, Out::Frames(&[frame("201#3D4000")]));
    assert_eq!(
        next(&mut link),
        Some(can::CanEvent::Frame(frame("181#40810100")))
    );
    assert_eq!(link.trouble(), None);
}

/// The firmware of CANable: it has no `L`, `Z`, `F` and `N`, and answers `V` with its commit and its repository.
fn canable(command: &str) -> &'static str {
    match command {
        "V" => "b158aa7 github.com/normaldotcom/canable-fw.git\r\r",
        "t20133D4000" => "\rt181440810100\r",
        command if command.starts_with(['O', 'C', 'S', 'M', 't']) => "\r",
        _ => "\x07",
    }
}

/// The same without a word for what was done, as in that of CANable 2.
fn canable_2(command: &str) -> &'static str {
    match command {
        "V" => "b158aa7 canable2\r",
        "t20133D4000" => "t181440810100\r",
        "O" => "t1811AA\r",
        _ => "",
    }
}

fn opening(said: &Transcript, last: &str) -> String {
    let said = said.lock().expect("a list").concat().replace('\r', " ");
    let end = said.find(last).expect("said") + last.len();
    said[..end].to_owned()
}

/// Both are asked as they can be; the mode that they keep while they have power is set back.
#[test]
fn the_firmware_of_canable_is_an_adapter() {
    let dialects: [(Dialect, &str, Listening); 2] = [
        (canable, "N C V S6 Z1 L M1 O", Listening::Only("M1")),
        (canable_2, "N C V V S6 M1 O", Listening::Unconfirmed("M1")),
    ];
    for (dialect, listening, mode) in dialects {
        let (address, said) = slcan(dialect);
        let mut link = opened(&settings(&address, false));
        for _ in 0..10 {
            link.send(0, Out::Frames(&[frame("201#3D4000")]));
            let reply = Some(can::CanEvent::Frame(frame("181#40810100")));
            assert!(std::iter::from_fn(|| next(&mut link)).any(|event| Some(event) == reply));
        }
        assert_eq!(
            (link.listening(), link.trouble()),
            (Listening::MayAcknowledge, None)
        );
        assert!(
            opening(&said, "O").ends_with("S6 Z1 M0 O") || opening(&said, "O").ends_with("S6 M0 O")
        );

        let (address, said) = slcan(dialect);
        let link = opened(&settings(&address, true));
        assert_eq!(link.listening(), mode);
        assert_eq!(opening(&said, "O"), listening);
        drop(link);
        while !said.lock().expect("a list").concat().ends_with("C\rM0\r") {
            std::thread::yield_now();
        }
    }
}

/// What cannot be confirmed is refused, unless it is permitted.
#[test]
fn listening_only_is_proven_or_permitted() {
    let mute = |command: &str| match command {
        "V" => "version 7 of another firmware\r",
        _ => "",
    };
    let deaf = |command: &str| match command {
        "L" => "\x07",
        command => good(command),
    };
    let dialects: [(Dialect, &str, &str); 2] = [
        (mute, "to confirm that it listens only", "M1 O"),
        (deaf, "to listen only (L)", "L O"),
    ];
    for (dialect, words, opens) in dialects {
        let (address, said) = slcan(dialect);
        let why = refused(&settings(&address, true));
        assert!(
            why.contains(words) && why.contains("--may-acknowledge"),
            "{why}"
        );
        assert!(!said.lock().expect("a list").concat().contains('O'));
        let (address, said) = slcan(dialect);
        let permitted = AdapterSettings {
            may_acknowledge: true,
            ..settings(&address, true)
        };
        let mut link = opened(&permitted);
        assert_eq!(link.listening(), Listening::MayAcknowledge);
        assert!(opening(&said, "O").ends_with(opens));
        link.send(0, Out::Frames(&[frame("201#3D4000")]));
        assert_eq!(link.refused(), 1);
    }
}

/// S7 is 750 kbit/s there, and nothing tells whether bit timing registers are taken.
#[test]
fn an_adapter_is_not_opened_at_another_rate() {
    let rate = |bits| BitRate::from_bits_per_second(bits).expect("a rate");
    let dialects: [(Dialect, u32); 3] = [
        (canable, 800_000),
        (canable_2, 800_000),
        (canable_2, 400_000),
    ];
    for (dialect, bits) in dialects {
        let (address, said) = slcan(dialect);
        let settings = AdapterSettings {
            rate: rate(bits),
            ..settings(&address, false)
        };
        let why = refused(&settings);
        assert!(
            why.contains("refuses the rate") && why.contains("1000 kbit/s"),
            "{why}"
        );
        assert!(
            !said
                .lock()
                .expect("a list")
                .concat()
                .contains(['S', 's', 'O'])
        );
    }
}

/// RFC 854: a server begins with its options.
#[test]
fn a_port_behind_telnet_is_named() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let client = std::thread::spawn(move || {
        let (mut client, _) = listener.accept().expect("a client");
        client
            .write_all(&[0xFF, 0xFD, 0x2C, 0xFF, 0xFB, 0x00])
            .expect("room");
        client
    });
    let why = refused(&settings(&address, false));
    assert!(
        why.contains("speaks telnet or RFC 2217: its first bytes are FF FD 2C")
            && why.contains("carry the bytes alone"),
        "{why}"
    );
    drop(client.join());
}

#[test]
fn what_is_no_adapter_is_named() {
    let (echo, _) = slcan(|command| match command {
        "N" => "N\r",
        "C" => "C\r",
        _ => "V\r",
    });
    let why = refused(&settings(&echo, false));
    assert!(why.contains("its own commands come back"), "{why}");
    let (once, _) = slcan(|command| match command {
        "C" => "23.5 degrees\r",
        _ => "",
    });
    let why = refused(&settings(&once, false));
    assert!(why.contains("received \"23.5 degrees\""), "{why}");

    let (silent, _) = slcan(|_| "");
    let why = refused(&settings(&silent, false));
    assert!(
        why.contains("does not answer C and V: SLCAN adapter expected"),
        "{why}"
    );
    let (text, _) = server("", b"\r", |_| "t18\r");
    let why = refused(&settings(&text, false));
    assert!(
        why.contains("is no SLCAN adapter: received \"t18\""),
        "{why}"
    );
    let (no_rate, _) = slcan(|command| {
        if command == "S6" {
            "\x07"
        } else {
            good(command)
        }
    });
    let why = refused(&settings(&no_rate, false));
    assert!(why.contains("refuses the rate 500 kbit/s"), "{why}");
    let (no_listening, _) = slcan(|command| {
        if command == "L" {
            "\x07"
        } else {
            good(command)
        }
    });
    let why = refused(&settings(&no_listening, true));
    assert!(
        why.contains("refuses to listen only") && why.contains("listen_only"),
        "{why}"
    );
    let odd = AdapterSettings {
        rate: BitRate::K625,
        ..settings(&no_rate, false)
    };
    assert!(refused(&odd).contains("cannot run at 625 kbit/s"));
    let nowhere = settings("127.0.0.1:1", false);
    assert!(refused(&nowhere).contains("failed to connect"));
    assert!(refused(&settings("/dev/there-is-none", false)).contains("no port"));
}

/// A frame that is refused, a lost connection and a stream that is none of SLCAN end the link; lost frames are counted.
#[test]
fn trouble_of_an_adapter_is_the_bench_s() {
    let (full, _) = slcan(|command| match command {
        "t20133D4000" => "\x07",
        command => good(command),
    });
    let mut link = opened(&settings(&full, false));
    link.send(0, Out::Frames(&[frame("201#3D4000")]));
    assert!(ended(&mut link).contains("refused to send 201#3D4000"));
    let (overrun, _) = slcan(|command| match command {
        "F" => "F08\rt1810\r",
        command => good(command),
    });
    let mut link = opened(&settings(&overrun, false));
    assert_eq!(next(&mut link), Some(can::CanEvent::Frame(frame("181#"))));
    assert_eq!(link.take_unplaced(), 1);
    let (garbage, _) = slcan(|command| match command {
        "F" => "t181zz\r",
        command => good(command),
    });
    let mut link = opened(&settings(&garbage, false));
    assert!(ended(&mut link).contains("received \"t181zz\""));
}

fn socketcand(answer: impl Fn(&str) -> &'static str + Send + 'static) -> AdapterSettings {
    let (address, _) = server("< hi >", b">", answer);
    AdapterSettings {
        place: AdapterPlace::Socketcand {
            address,
            channel: "can0".to_owned(),
        },
        rate: BitRate::K500,
        listen_only: false,
        may_acknowledge: false,
    }
}

#[test]
fn a_server_of_socketcand_is_opened_and_asked() {
    let mut link = opened(&socketcand(|message| match message {
        "< send 201 3 3d 40 0 >" => "< frame 181 17.000001 40810100 >",
        "< send 100 0 >" => "< error 040 18.0 >",
        _ => "< ok >",
    }));
    let remote = [frame("201#R3")];
    assert!(
        !link.permits(0, Out::Frames(&remote)),
        "there are none in this language"
    );
    link.send(0, Out::Frames(&[frame("201#3D4000")]));
    assert_eq!(
        next(&mut link),
        Some(can::CanEvent::Frame(frame("181#40810100")))
    );
    link.send(0, Out::Frames(&[frame("100#")]));
    assert_eq!(
        next(&mut link),
        Some(can::CanEvent::Error(CanError::BusOff))
    );
    assert!(lost(&link).contains("bus-off"));
}

#[test]
fn what_is_no_server_of_socketcand_is_named() {
    let why = refused(&socketcand(|_| "< error could not open bus >"));
    assert!(
        why.contains("refuses < open > (could not open bus): name a bus"),
        "{why}"
    );
    let why = refused(&socketcand(|_| ""));
    assert!(
        why.contains("does not answer < open >: server of socketcand expected"),
        "{why}"
    );
    let why = refused(&socketcand(|_| "hello >"));
    assert!(
        why.contains("is no server of socketcand: received \"hello >\""),
        "{why}"
    );
}

/// What a watchdog sends is coded as the adapter has it.
#[test]
fn last_words_are_coded() {
    let (address, said) = slcan(good);
    let link = opened(&settings(&address, false));
    let frames = Pieces::Frames(vec![frame("201#510400"), frame("201#310000")]);
    for words in link.last_words().expect("a descriptor") {
        words.say(&frames).expect("sent");
    }
    loop {
        let said = said.lock().expect("a list").join("");
        if said.contains("t2013510400\rt2013310000\r") {
            return;
        }
        std::thread::yield_now();
    }
}

#[test]
fn an_interruption_ends_sending_and_can_be_taken_back() {
    let (address, _) = slcan(good);
    let interrupt = Arc::new(AtomicBool::new(false));
    let mut link = FrameLink::open(
        &settings(&address, false),
        Vec::new(),
        Arc::clone(&interrupt),
    )
    .expect("an adapter");
    interrupt.store(true, Ordering::Relaxed);
    assert!(!link.wait(link.now()));
    assert_eq!(link.trouble(), Some(&Trouble::Interrupted));
    link.resume();
    link.send(0, Out::Frames(&[frame("201#3D4000")]));
    assert_eq!(
        next(&mut link),
        Some(can::CanEvent::Frame(frame("181#40810100")))
    );
    let stopped = FrameLink::open(&settings(&address, false), Vec::new(), interrupt);
    assert!(matches!(stopped, Err(AdapterError::Interrupted)));
}

/// What an adapter says of itself ends nothing, and only what may have been lost is doubtful.
#[test]
fn ordinary_messages_disturb_nothing() {
    let mut link = opened(&socketcand(|message| match message {
        "< send 100 0 >" => "< error 002 18.0 >< error 004 18.0 >< frame 181 18.0 AA >",
        _ => "< ok >",
    }));
    link.send(0, Out::Frames(&[frame("100#")]));
    assert_eq!(next(&mut link), Some(can::CanEvent::Frame(frame("181#AA"))));
    assert_eq!((link.take_unplaced(), link.take_doubtful()), (0, 1));
    assert_eq!(link.take_reports().messages, 1);
}
