//! Served rings in virtual time: the clock is a number.

use super::*;
use crate::language::parse::header::parse_setup;
use crate::simulate;
use harness_bench::medium::ErrorMarks;
use harness_bench::scenario::plan::plan;
use harness_bench::scenario::source::Source;
use harness_bench::web::{LiveCell, LiveNews, LiveOrder, MAX_ROWS};
use proptest::prelude::*;

/// A read of the byte FE13 of drive 0 in a ring of three, and its answer (ND21 10.1): 00 with its negated sum.
const READ: [u8; 6] = [0x88, 0xFD, 0xC0, 0x13, 0xFE, 0xD1];
const ANSWER: [u8; 6] = [0x88, 0x00, 0xC0, 0x13, 0x00, 0x2D];

/// 17 zeros and the check sequence (ND21 9.8).
const RECOVERY: [u8; 22] = [
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0x44, 0x72, 0x4C, 0x41,
];

const HEADER: &str = "drive 0..last model nd21\ndrive 0..last input GPIN3 GPIN5 high\n";

fn server(header: &str, sizes: &[u8], pace: Pace, marks: ErrorMarks) -> Server {
    let source = Source {
        name: "test".to_owned(),
        text: header.into(),
    };
    let scenario = parse_setup(&source, sizes).expect("a header");
    let plan = plan(&scenario, &source, None).expect("a plan");
    let link = simulate::bench(&plan);
    let mut server = Server::new(plan, link, pace, marks);
    for ring in 0..sizes.len() {
        server.come(ring);
    }
    server
}

fn at(millis: u64) -> Instant {
    Instant::START + Span::from_millis(millis)
}

fn taken(server: &mut Server, ring: usize) -> Vec<u8> {
    let bytes = server.transmit(ring).to_vec();
    server.transmitted(ring, bytes.len());
    bytes
}

/// Lets the clock go from deadline to deadline, as the shell does.
fn run(server: &mut Server, until: Instant) {
    loop {
        let next = server.deadline();
        if next >= until {
            break;
        }
        server.advance(next);
    }
    server.advance(until);
}

/// The last byte of the answer has come a byte time a link after the last byte was sent (ND21 8.4), and no sooner.
#[test]
fn an_answer_takes_the_time_of_the_line() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    server.advance(at(5));
    server.receive(0, &READ).expect("no marks");
    let byte = server.link.byte_time();
    let last = at(5) + byte * 9;
    server.advance(last - Span::from_units(1));
    assert_eq!(taken(&mut server, 0), ANSWER[..5]);
    server.advance(last);
    assert_eq!(taken(&mut server, 0), ANSWER[5..]);
}

/// Woken at its deadlines only, a ring gives the last byte of an answer when it has come, and others within a millisecond; an idle ring
/// sleeps.
#[test]
fn deadlines_are_prompt_when_busy_and_rare_when_idle() {
    for drives in [1, 3, 100] {
        let mut server = server(HEADER, &[drives], Pace::Line, ErrorMarks::None);
        let byte = server.link.byte_time();
        let bytes = 600;
        server.receive(0, &vec![0x80; bytes]).expect("no marks");
        // Each drive passes a byte on when it has received it (ND21 8.2).
        let home = at(0) + byte * (bytes as u64 + u64::from(drives));
        let (mut wakes, mut late) = (0, Span::ZERO);
        while server.transmit(0).len() < bytes {
            let before = server.transmit(0).len();
            let next = server.deadline();
            server.advance(next);
            wakes += 1;
            if server.transmit(0).len() > before {
                let oldest = home - byte * (bytes - before - 1) as u64;
                late = late.max(server.clock.since(oldest));
            }
        }
        assert_eq!(server.clock, home, "{drives} drives");
        assert!(late <= BATCH, "{drives} drives: {late}");
        // 600 bytes are sent in 172 ms. From 4 ms before their end, which are 14 bytes, each byte has its own moment, and there is a look
        // for each that is not on the last link.
        assert!(
            wakes <= 168 + 2 * (14 + u64::from(drives)) + 4,
            "{drives} drives: {wakes}"
        );
        assert_eq!(server.deadline(), server.clock + IDLE);
    }
}

/// A client that has sent little may wait for each byte that arrives, so the shell is awake for it. Nothing is awaited if the client has
/// sent far ahead, or if there is no client.
#[test]
fn a_byte_that_somebody_may_wait_for_is_awaited() {
    let mut server = server(HEADER, &[1], Pace::Line, ErrorMarks::None);
    let byte = server.link.byte_time();
    assert_eq!(server.awaited(), None, "nothing is under way");
    server.receive(0, &[0x80]).expect("no marks");
    server.advance(at(0) + byte);
    assert_eq!(server.awaited(), Some(at(0) + byte * 2));
    assert_eq!(server.deadline(), at(0) + byte * 2);
    run(&mut server, at(5));
    assert_eq!(server.awaited(), None, "it has come");
    server.receive(0, &[0x80; 100]).expect("no marks");
    server.advance(at(5) + byte);
    assert_eq!(server.awaited(), None, "the line is taken for long");
    server.go(0);
    server.advance(at(5) + byte * 100);
    assert_eq!(server.awaited(), None, "nobody is there");
}

/// ND21 9.7, 9.8: a byte that the client marks as damaged is a parity error for the first drive; the ring spells its address out,
/// and the check sequence after 17 zeros brings it back.
#[test]
fn a_marked_byte_is_a_parity_error_for_the_first_drive() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::InBand);
    server.receive(0, &[0x80, 0xFF, 0x00, 0x80]).expect("marks");
    server.receive(0, &[0x80; 40]).expect("marks");
    run(&mut server, at(30));
    let answer = taken(&mut server, 0);
    assert_eq!(answer[..2], [0x80, 0x00]);
    assert_eq!(answer.last(), Some(&0x02));
    let check = server.control("? error 0502 at 2");
    assert_eq!(check, Some(ControlAnswer::Ok));

    // The sequence's own FF is doubled in both directions.
    let mut sequence = RECOVERY.to_vec();
    sequence.insert(17, 0xFF);
    server.receive(0, &sequence).expect("marks");
    server.receive(0, &READ).expect("marks");
    run(&mut server, at(60));
    let answer = taken(&mut server, 0);
    let end = [&[0xFF, 0xFF, 0x44, 0x72, 0x4C, 0x41][..], &ANSWER[..]].concat();
    assert!(answer.ends_with(&end), "{answer:02X?}");
    let check = server.control("? drives 0..last normal");
    assert_eq!(check, Some(ControlAnswer::Ok));
}

/// FF 00 00 is a break of one byte: the first drive sees a framing error, and the byte behind it is whole.
#[test]
fn a_marked_zero_is_a_break() {
    let mut server = server(HEADER, &[1], Pace::Line, ErrorMarks::InBand);
    server.receive(0, &[0xFF, 0, 0, 0x80]).expect("marks");
    run(&mut server, at(5));
    assert_eq!(taken(&mut server, 0), [0, 0]);
    let check = server.control("? error 0503 at 0");
    assert_eq!(check, Some(ControlAnswer::Ok));
}

/// A byte that comes back damaged is marked, or bare where the stream has no marks.
#[test]
fn what_comes_back_damaged() {
    for (marks, expected) in [
        (ErrorMarks::InBand, &[0xFF, 0x00, 0x81, 0x80][..]),
        (ErrorMarks::None, &[0x81, 0x80][..]),
    ] {
        let mut server = server(HEADER, &[2], Pace::Line, marks);
        assert_eq!(
            server.control("! 0->master: flip 0"),
            Some(ControlAnswer::Ok)
        );
        server.receive(0, &[0x80, 0x80]).expect("no mark");
        run(&mut server, at(5));
        assert_eq!(taken(&mut server, 0), expected);
    }
}

#[test]
fn a_foreign_stream_is_noticed_and_the_rest_is_taken() {
    let mut server = server(HEADER, &[1], Pace::Line, ErrorMarks::InBand);
    let error = server.receive(0, &[0x80, 0xFF, 0x12, 0x80]);
    assert_eq!(error, Err(BadMark { byte: 0x12 }));
    run(&mut server, at(5));
    assert_eq!(taken(&mut server, 0), [0x80, 0x80]);
}

/// Half a second of bytes waits, no more; what has left makes room again.
#[test]
fn a_fast_client_is_held_back() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    let room = server.room(0);
    assert_eq!(room, 1745);
    server.receive(0, &vec![0x80; room]).expect("no marks");
    assert_eq!(server.room(0), 0);
    server.advance(at(100));
    assert_eq!(server.room(0), 349);
}

/// What a client does not read is bounded and counted.
#[test]
fn a_client_that_does_not_read_loses_bytes() {
    let mut server = server(HEADER, &[1], Pace::Free, ErrorMarks::None);
    for turn in 0..80 {
        server.receive(0, &[0x80; 1000]).expect("no marks");
        run(&mut server, at(turn + 1));
    }
    assert_eq!(server.transmit(0).len(), UNREAD);
    assert_eq!(server.lost(0), 80_000 - UNREAD as u64);
    server.go(0);
    assert_eq!(server.lost(0), 0);
}

/// Bytes leap, so that the clock stands still; silence takes its time (ND21 9.9: zeros after 10 ms and 10 ms more).
#[test]
fn free_pace_leaps_over_bytes_and_not_over_silence() {
    let header = format!("{HEADER}drive 0..last memory Flags2 = 04\n");
    let mut server = server(&header, &[3], Pace::Free, ErrorMarks::None);
    server.receive(0, &READ).expect("no marks");
    server.advance(Instant::START);
    assert_eq!(taken(&mut server, 0), ANSWER);
    run(&mut server, at(15));
    assert_eq!(taken(&mut server, 0), [0_u8; 0]);
    run(&mut server, at(40));
    let zeros = taken(&mut server, 0);
    assert!(zeros.starts_with(&[0; 8]), "{zeros:02X?}");
}

/// A program that was stopped for an hour does not compute an hour of motion before it answers.
#[test]
fn a_long_stop_is_not_made_up_for() {
    let mut server = server(HEADER, &[1], Pace::Line, ErrorMarks::None);
    server.advance(at(3_600_000));
    assert_eq!(server.time(), at(1_000) + SETTLED);
    server.receive(0, &[0x80]).expect("no marks");
    server.advance(at(3_600_001));
    assert_eq!(taken(&mut server, 0), [0x80]);
}

#[test]
fn two_rings_have_two_clients_and_one_clock() {
    let second = HEADER.replace("0..last", "2:0..last");
    let header = format!("{HEADER}{second}");
    let mut server = server(&header, &[3, 2], Pace::Line, ErrorMarks::None);
    assert_eq!((server.rings(), server.drives(1)), (2, 2));
    server.receive(0, &[0x80]).expect("no marks");
    server.receive(1, &[0x80, 0x80]).expect("no marks");
    run(&mut server, at(5));
    assert_eq!(taken(&mut server, 0), [0x80]);
    assert_eq!(taken(&mut server, 1), [0x80, 0x80]);
    assert_eq!(server.control("! drive 2:1: off"), Some(ControlAnswer::Ok));
    server.receive(0, &[0x80]).expect("no marks");
    server.receive(1, &[0x80]).expect("no marks");
    run(&mut server, at(10));
    assert_eq!(taken(&mut server, 0), [0x80]);
    assert_eq!(taken(&mut server, 1), [0_u8; 0]);
}

/// A client that goes takes nothing with it and leaves nothing behind.
#[test]
fn the_next_client_gets_none_of_the_last_ones_bytes() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::InBand);
    server.receive(0, &[0x80, 0xFF]).expect("half a mark");
    run(&mut server, at(5));
    server.go(0);
    server.receive(0, &[]).expect("nothing");
    run(&mut server, at(10));
    server.come(0);
    server.receive(0, &[0x80]).expect("whole");
    run(&mut server, at(20));
    assert_eq!(taken(&mut server, 0), [0x80]);
}

#[test]
fn lines_of_control() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    for (line, answer) in [
        ("drive 0 input GPIN5 low", Some("ok")),
        ("? drive 0 nist = 0rpm +-5rpm  # it stands", Some("ok")),
        ("? drive 2 mode go", Some("ok")),
        (
            "? drive 0 memory FF08 = 1234",
            Some("no: cell FF08 of drive 0 holds 00, expected 12"),
        ),
        (
            "state 2",
            Some(
                "ok bus=normal mode=go GPO1=low GPO2=low ready=closed analogue-output=0 encoder=0 display=blank",
            ),
        ),
        ("state 1:2 nist FF08:2", Some("ok nist=0000 FF08=0000")),
        ("   # nothing", None),
        ("", None),
    ] {
        let given = server.control(line).map(|answer| answer.to_string());
        assert_eq!(given.as_deref(), answer, "{line}");
    }
    for (line, part) in [
        (
            "drive 9 input GPIN5 high",
            "column 7: there is no drive 9 in a ring of 3",
        ),
        ("! 1->0: frop", "did you mean `drop`?"),
        ("> 80", "the bytes are the master's"),
        ("wait 5ms", "can be done at once"),
        ("+5ms ! drive 1: off", "no time is allowed in front"),
        ("? received 3 bytes", "counts bytes"),
        ("drive 0 model plain", "after the first step"),
        ("ring 3", "error: column 1"),
        ("\u{1}", "is not a text"),
        ("state", "`state` and a drive of the bench expected"),
        ("state 3", "`state` and a drive of the bench expected"),
        ("state 2:0", "`state` and a drive of the bench expected"),
        ("state 0 nisd", "nist"),
        ("state 0 EE_pole", "is in the EEPROM"),
    ] {
        let given = server.control(line).expect("an answer").to_string();
        assert!(given.starts_with("error: "), "{line}: {given}");
        assert!(given.contains(part), "{line}: {given}");
        assert!(!given.contains('\n'), "{line}: {given}");
    }
}

/// The state tells an error of the bus by its code (ND21 14.11.14), and whether a drive turns.
#[test]
fn the_state_of_a_drive_follows_what_happens() {
    let mut server = server(HEADER, &[2], Pace::Line, ErrorMarks::None);
    // Nominal value 1500 rpm, written to drive 1 (ND21 10.2), then a byte with a parity error.
    let mut telegram = vec![0x8C, 0xFF, 0x63, 0x52, 0x06, 0x08, 0xFF];
    let sum = telegram[2..]
        .iter()
        .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    telegram.push(sum);
    server.receive(0, &telegram).expect("no marks");
    run(&mut server, at(2_000));
    let state = |server: &mut Server, line: &str| {
        let answer = server.control(line).expect("an answer");
        answer.to_string()
    };
    let turning = state(&mut server, "state 1 nsoll nist");
    assert!(turning.starts_with("ok nsoll=0652 nist=06"), "{turning}");
    assert_eq!(state(&mut server, "state 0 nist"), "ok nist=0000");
    assert_eq!(
        server.control("! master->1: flip p"),
        Some(ControlAnswer::Ok)
    );
    server.receive(0, &[0x80]).expect("no marks");
    run(&mut server, at(2_010));
    let broken = state(&mut server, "state 1");
    assert!(broken.starts_with("ok bus=0502 "), "{broken}");
}

/// A fault at a time happens then, however far the clock jumps; the drive without power passes nothing on.
#[test]
fn a_fault_at_a_time() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    let armed = server.control("! drive 1 @20ms: off");
    assert_eq!(armed, Some(ControlAnswer::Ok));
    server.receive(0, &[0x80]).expect("no marks");
    run(&mut server, at(15));
    assert_eq!(taken(&mut server, 0), [0x80]);
    run(&mut server, at(30));
    server.receive(0, &[0x80]).expect("no marks");
    run(&mut server, at(60));
    assert_eq!(taken(&mut server, 0), [0_u8; 0]);
}

/// The cells of a picture, byte times that are folded included.
fn shown(news: &LiveNews) -> (u64, usize) {
    let folded = news.rows.iter().map(|row| row.fold).sum();
    (folded, news.rows.iter().map(|row| row.cells.len()).sum())
}

/// ND21 10.1: a read in a ring of three. Each of the four links carries its six bytes, and the last row is the checking byte of the answer at
/// the master.
#[test]
fn a_page_shows_each_byte_on_each_link() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    server.watch(true);
    server.receive(0, &READ).expect("no marks");
    run(&mut server, at(20));
    let news = server.news();
    assert_eq!(shown(&news), (0, 24));
    // The first byte reaches the master three byte times behind the first drive.
    let last = news.rows.last().expect("rows");
    assert_eq!((news.rows.len(), last.cells.len()), (9, 1));
    assert_eq!(last.cells[0], LiveCell(3, "+2D".to_owned(), 'd'));
    assert_eq!(news.traffic[3], ["0->master", "6", "6", "0"]);
    assert_eq!(shown(&server.news()), (0, 0));
    server.receive(0, &[0x80; 10]).expect("no marks");
    run(&mut server, at(40));
    assert_eq!(shown(&server.news()), (13, 0));
}

/// ND21 9.7: the zeros, and the address of the drive behind the damaged link; the check sequence ends it (9.8).
#[test]
fn a_page_tells_which_drive_saw_the_fault() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    server.go(0);
    server.watch(true);
    for place in 0..3 {
        let order = LiveOrder::Fault { place, fault: 0 };
        let said = server.order(order).expect("a fault");
        assert!(said.contains("No master is connected"), "{said}");
        let until = server.clock + Span::from_millis(40);
        run(&mut server, until);
        let notes = server.news().notes;
        let expected = format!("Address {:02X} has reached the master", 2 - place);
        assert!(
            notes.len() == 1 && notes[0].starts_with(&expected),
            "{notes:?}"
        );
        server
            .order(LiveOrder::Play { script: 3 })
            .expect("the check sequence");
        let until = server.clock + Span::from_millis(40);
        run(&mut server, until);
        let stations = server.news().stations;
        assert!(
            stations.iter().all(|row| row[1] == "normal"),
            "{stations:?}"
        );
    }
}

/// ND21 9.7: the marks of the print stand in front of the bytes of the drive that makes them, also on a page that was opened later.
#[test]
fn a_page_shows_the_marks_of_the_print() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    server.go(0);
    server.receive(0, &[0x80; 7]).expect("no marks");
    run(&mut server, at(20));
    server.watch(true);
    let fault = LiveOrder::Fault { place: 1, fault: 0 };
    server.order(fault).expect("a fault");
    run(&mut server, at(60));
    let rows = server.news().rows;
    // Behind drive 1, which detects the fault, and behind drive 0, which sees its zeros.
    let column = |wanted: usize| {
        let cells = rows.iter().flat_map(|row| &row.cells);
        let of = cells
            .filter(|cell| cell.0 == wanted)
            .map(|cell| cell.1.as_str());
        of.collect::<Vec<_>>()
    };
    let marked = |column: &[&str]| {
        let marked = column.iter().filter(|text| text.len() > 2);
        marked.map(|text| (*text).to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(marked(&column(2)), ["!00", "#00"]);
    assert_eq!(marked(&column(3)), ["!00", "*00", "#00"]);
    // The 17th zero of drive 0 is marked, and the bytes behind it are numbers.
    let master = column(3);
    let seventeenth = master
        .iter()
        .position(|text| *text == "#00")
        .expect("a mark");
    let zeros = master[..=seventeenth]
        .iter()
        .filter(|text| text.ends_with("00"));
    assert_eq!(zeros.count(), 17);
    assert_eq!(master[seventeenth + 1], "01");
}

/// A link that is cut open is shown as such, with nothing in it.
#[test]
fn a_page_shows_where_a_ring_is_cut() {
    let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
    server.add(Inner {
        ring: 0,
        link: 1,
        role: ClientRole::Cut,
    });
    let columns = server.scene().picture.expect("a picture").columns;
    assert_eq!(columns, ["master->2", "2->1 (cut)", "1->0", "0->master"]);
    assert_eq!(server.scene().places[1].name, "2->1");
    server.watch(true);
    server.receive(0, &READ).expect("no marks");
    run(&mut server, at(20));
    let rows = server.news().rows;
    assert!(!rows.is_empty());
    for row in rows {
        let cut = row.cells.iter().filter(|cell| cell.0 == 1);
        assert_eq!(
            cut.collect::<Vec<_>>(),
            [&LiveCell(1, "//".to_owned(), 'c')]
        );
    }
}

/// A page that is opened beside a line at full speed gets the newest rows, and the number of the others.
#[test]
fn a_picture_has_bounds() {
    let mut server = server(HEADER, &[3], Pace::Free, ErrorMarks::None);
    server.watch(true);
    for turn in 0..5 {
        server.receive(0, &[0x81; 1000]).expect("no marks");
        run(&mut server, at(10 * (turn + 1)));
    }
    let news = server.news();
    assert_eq!(news.rows.len(), MAX_ROWS);
    assert!(news.left_out > 1000, "{}", news.left_out);
    server.watch(false);
    assert_eq!(server.news().rows, []);
}

proptest! {
    /// However the bytes are cut up and whenever the server is asked, the same bytes come back.
    #[test]
    fn cuts_and_looks_change_nothing(
        bytes in proptest::collection::vec(any::<u8>(), 1..60),
        cuts in proptest::collection::vec((1_usize..20, 0_u64..3), 1..60),
        free in any::<bool>(),
    ) {
        let pace = if free { Pace::Free } else { Pace::Line };
        let mut whole = server(HEADER, &[4], Pace::Line, ErrorMarks::None);
        whole.receive(0, &bytes).expect("no marks");
        run(&mut whole, at(200));
        let mut cut = server(HEADER, &[4], pace, ErrorMarks::None);
        let (mut rest, mut heard, mut clock) = (&bytes[..], Vec::new(), 0);
        for (length, millis) in cuts {
            let (head, tail) = rest.split_at(length.min(rest.len()));
            cut.receive(0, head).expect("no marks");
            rest = tail;
            clock += millis;
            cut.advance(at(clock));
            heard.extend(taken(&mut cut, 0));
        }
        cut.receive(0, rest).expect("no marks");
        run(&mut cut, at(clock + 200));
        heard.extend(taken(&mut cut, 0));
        prop_assert_eq!(taken(&mut whole, 0), heard);
    }

    /// A page that is opened, read and closed at any time changes no byte for the master or for a tap.
    #[test]
    fn a_page_changes_nothing(
        bytes in proptest::collection::vec(any::<u8>(), 1..60),
        looks in proptest::collection::vec((0_u8..3, 0_u64..4), 1..40),
    ) {
        let tap = Inner { ring: 0, link: 1, role: ClientRole::Tap };
        let [mut alone, mut beside] = [(); 2].map(|()| {
            let mut server = server(HEADER, &[3], Pace::Line, ErrorMarks::None);
            server.add(tap);
            server.come(1);
            server.receive(0, &bytes).expect("no marks");
            server
        });
        let mut clock = 0;
        for (what, millis) in looks {
            clock += millis;
            run(&mut beside, at(clock));
            match what {
                0 => beside.watch(true),
                1 => beside.watch(false),
                _ => drop(beside.news()),
            }
        }
        for server in [&mut alone, &mut beside] {
            run(server, at(clock + 100));
        }
        for seat in 0..2 {
            prop_assert_eq!(taken(&mut alone, seat), taken(&mut beside, seat));
        }
    }

    /// No line of control is too odd for an answer of one line.
    #[test]
    fn every_line_is_answered(line in "(! |\\? |drive )?[ -~äöü\t]{0,40}") {
        let mut server = server(HEADER, &[2], Pace::Line, ErrorMarks::None);
        if let Some(answer) = server.control(&line) {
            prop_assert!(!answer.to_string().contains('\n'));
        }
    }
}
