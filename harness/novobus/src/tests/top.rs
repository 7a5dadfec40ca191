//! Pages as plain text: the view is a function of what was read, of the keys and of the size.

use crate::driver::Axis;
use crate::tests::ROOT;
use crate::top::{DriveReading, FORM, RingReading};
use harness_bench::top::view::{page, render, text};
use harness_bench::top::{HeadLine, Heading, Key, Press, Snapshot, Top};
use harness_proto::nd21::State;
use harness_proto::nd21::bits::{flags, flags2, status};
use harness_proto::novobus::master::Counters;
use harness_proto::time::Span;
use ratatui_core::backend::TestBackend;
use ratatui_core::buffer::Buffer;
use ratatui_core::layout::Rect;
use ratatui_core::style::Color;
use ratatui_core::terminal::Terminal;
use std::path::Path;

/// Compares with a page that is kept; `UPDATE_SNAPSHOTS=1` writes it.
#[track_caller]
fn kept(name: &str, page: &str) {
    let path = Path::new(ROOT).join("snapshots/top").join(name);
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::write(&path, page).expect("written");
    }
    let before = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        before == page,
        "{} differs; UPDATE_SNAPSHOTS=1 writes it:\n{page}",
        path.display()
    );
}

fn at(seconds: u64) -> Span {
    Span::from_millis(seconds * 1_000)
}

fn state(status: u8, flags: u8, flags2: u8, error: u16) -> State {
    State {
        status,
        flags,
        flags2,
        error,
    }
}

fn drive(ring: usize, number: u8, state: State, speed: f64) -> DriveReading {
    DriveReading {
        axis: Axis::new(ring, number).expect("an axis"),
        state,
        speed: Some(speed),
        position: Some(f64::from(number) * 1.5 - 2.25),
        torque: Some(speed / 1_000.0),
    }
}

/// Puts what a drive showed in the place of what it showed before.
fn put(reading: &mut Snapshot, drive: DriveReading) {
    let place = usize::from(drive.axis.number());
    reading.drives.insert(place, drive.row());
}

fn heading(rings: &[&str]) -> Heading {
    let rings = (1..).zip(rings);
    Heading {
        rig: "lab-1".to_owned(),
        form: &FORM,
        parts: rings
            .map(|(number, what): (usize, _)| format!("ring {number}: {what}"))
            .collect(),
    }
}

fn ring(disturbed: u64) -> RingReading {
    let counters = |sent, disturbed| Counters {
        sent,
        idle: sent / 2,
        telegrams: sent / 10,
        received: sent,
        line_errors: disturbed * 2,
        done: sent / 9,
        repeated: disturbed,
        disturbed,
        corrected: disturbed,
        ..Counters::default()
    };
    RingReading::between(&counters(0, 0), &counters(6_982, disturbed), at(2))
}

/// Four drives: one turns, one stands, one is blocked, one is in error.
fn four() -> Snapshot {
    let mut reading = Snapshot {
        at: at(3_725),
        parts: vec![ring(3).lines()],
        ..Snapshot::default()
    };
    let go = state(0, 0, flags2::OK | flags2::MONITORING, 0);
    // They come in any order.
    put(&mut reading, drive(0, 2, go, 1_499.9));
    put(
        &mut reading,
        drive(0, 0, state(status::STOP, flags::STOP, 0, 0), 0.0),
    );
    put(
        &mut reading,
        drive(0, 3, state(status::ERROR, flags::BLOCK, 0, 0x0508), -12.5),
    );
    put(
        &mut reading,
        drive(0, 1, state(status::BLOCK, flags::BLOCK, 0, 0), 0.0),
    );
    reading.disturbed("the link from drive 2 to drive 1 is damaged (ND21 9.7)".to_owned());
    reading.at = at(3_730);
    reading.disturbed("answers come too late".to_owned());
    reading.disturbed("the link from drive 2 to drive 1 is damaged (ND21 9.7)".to_owned());
    reading
}

fn of_four() -> Top {
    let mut top = Top::new(heading(&["4 drives, serial /dev/ttyUSB0, 38400 8O1"]));
    top.take(four());
    top
}

/// A long ring, every seventh drive in error, every fifth at a speed of its own.
fn hundred() -> Top {
    let mut reading = Snapshot {
        at: at(61),
        parts: vec![ring(0).lines()],
        ..Snapshot::default()
    };
    for number in 0..100 {
        let shown = match number % 7 {
            0 => state(
                status::ERROR,
                flags::BLOCK,
                0,
                0x0500 + u16::from(number % 4),
            ),
            _ => state(0, 0, 0, 0),
        };
        let speed = if number % 5 == 0 {
            f64::from(number) * -10.0
        } else {
            50.0
        };
        put(&mut reading, drive(0, number, shown, speed));
    }
    let mut top = Top::new(heading(&["100 drives, tcp lab:4001, 38400 8O1"]));
    top.take(reading);
    top
}

fn drawn(top: &mut Top, width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a terminal");
    terminal
        .draw(|frame| harness_bench::top::view::draw(top, false, frame))
        .expect("drawn");
    let page = text(terminal.backend().buffer());
    assert_eq!(page.lines().count(), usize::from(height));
    page
}

fn press(top: &mut Top, keys: &str) {
    for key in keys.chars() {
        let key = match key {
            '\n' => Key::Enter,
            '\u{8}' => Key::Backspace,
            key => Key::Char(key),
        };
        assert_eq!(top.press(key), Press::Stay);
    }
}

/// The numbers of the drives in sight, in their order.
fn numbers(top: &Top) -> Vec<String> {
    top.rows().iter().map(|row| row.cells[0].clone()).collect()
}

#[test]
fn a_page_of_a_common_terminal() {
    kept("four-80x24.txt", &drawn(&mut of_four(), 80, 24));
    kept("hundred-80x24.txt", &drawn(&mut hundred(), 80, 24));
}

/// The error of a drive can be read beside its number and its state, and what is hidden is counted as often as it was.
#[test]
fn a_page_of_a_very_small_terminal() {
    let page = drawn(&mut of_four(), 40, 10);
    assert!(page.contains("0508 NBtimeout"), "{page}");
    kept("four-40x10.txt", &page);
    let mut reading = four();
    for number in 0..6 {
        for _ in 0..=number {
            reading.disturbed(format!("what was disturbed in way {number}"));
        }
    }
    let mut top = of_four();
    top.take(reading);
    let page = drawn(&mut top, 40, 10);
    // Of 3 and 21 disturbances two kinds are shown.
    let shown: u64 = page
        .lines()
        .filter_map(|line| line.split_once(" times"))
        .filter_map(|(before, _)| before.rsplit(' ').next()?.parse::<u64>().ok())
        .sum();
    let hidden = page.lines().find_map(|line| {
        let rest = line.strip_prefix("and ")?;
        rest.split(' ').next()?.parse::<u64>().ok()
    });
    // The second one was there once.
    assert_eq!(shown + 1 + hidden.expect("hidden ones"), 24, "{page}");
    kept("many-40x10.txt", &page);
}

#[test]
fn a_page_of_a_large_terminal() {
    kept("four-120x40.txt", &drawn(&mut of_four(), 120, 40));
    kept("hundred-120x40.txt", &drawn(&mut hundred(), 120, 40));
}

#[test]
fn a_page_without_a_terminal_shows_every_drive_and_no_keys() {
    let page = page(&mut hundred(), 120);
    assert!(page.contains("   99  go"), "{page}");
    assert!(!page.contains("quit"), "{page}");
    kept(
        "four-once.txt",
        &harness_bench::top::view::page(&mut of_four(), 120),
    );
}

#[test]
fn the_help_names_every_key() {
    let mut top = of_four();
    press(&mut top, "?");
    kept("help-80x24.txt", &drawn(&mut top, 80, 24));
    // Any key closes it, and does nothing else.
    assert_eq!(top.press(Key::Char('q')), Press::Stay);
    assert!(drawn(&mut top, 80, 24).contains("error, status"));
}

/// ND21 8.4: two rings, drives that have not been read, and what the transport told of without bytes.
#[test]
fn two_rings_of_which_little_is_known() {
    let mut top = Top::new(heading(&["2 drives, simulated", "1 drive, simulated"]));
    kept("nothing-80x24.txt", &drawn(&mut top, 80, 24));
    let unplaced = HeadLine {
        text: "  4 line errors told of without their bytes".to_owned(),
        is_error: true,
    };
    let mut reading = Snapshot {
        at: at(1),
        parts: vec![ring(0).lines(), ring(1).lines(), vec![unplaced]],
        ..Snapshot::default()
    };
    let nothing = DriveReading {
        speed: None,
        position: None,
        torque: None,
        ..drive(1, 0, state(status::RESET, 0, 0, 0x0FFF), 0.0)
    };
    put(&mut reading, nothing);
    reading.disturbed("ring 2: nothing comes back".to_owned());
    top.take(reading);
    kept("two-rings-80x24.txt", &drawn(&mut top, 80, 24));
}

#[test]
fn a_filter_is_typed_kept_and_taken_away() {
    let mut top = of_four();
    press(&mut top, "/TIMEX\u{8}");
    assert_eq!(numbers(&top), ["3"], "upper and lower case are the same");
    assert!(drawn(&mut top, 80, 24).contains("filter: TIME_"));
    // Letters are text here, and no commands.
    press(&mut top, "q");
    assert_eq!(numbers(&top), Vec::<String>::new());
    assert!(drawn(&mut top, 80, 24).contains("no drive has `TIMEq` in its row"));
    press(&mut top, "\u{8}\n");
    assert_eq!(numbers(&top), ["3"]);
    assert!(drawn(&mut top, 80, 24).contains("with `TIME`"));
    press(&mut top, "/");
    assert_eq!(top.press(Key::Escape), Press::Stay);
    assert_eq!(numbers(&top).len(), 4);
    // It is bounded.
    press(&mut top, "/");
    (0..500).for_each(|_| press(&mut top, "x"));
    assert!(drawn(&mut top, 80, 24).contains(&"x".repeat(60)));
    assert!(!drawn(&mut top, 200, 24).contains(&"x".repeat(61)));
}

#[test]
fn a_drive_is_stopped_by_its_name_and_all_by_none() {
    let mut top = of_four();
    press(&mut top, "px");
    assert!(
        drawn(&mut top, 80, 24).contains("stop drive: _  Enter stops all drives, Esc goes back")
    );
    // Letters are text here, and a name that no drive has orders nothing.
    press(&mut top, "q7\n");
    assert!(drawn(&mut top, 80, 24).contains("stop drive: q7_  no drive has this name"));
    press(&mut top, "\u{8}\u{8}2");
    assert!(drawn(&mut top, 80, 24).contains("stop drive: 2_  Enter stops this drive"));
    assert!(top.is_paused());
    assert_eq!(top.press(Key::Enter), Press::Stop(Some(2)));
    assert!(!top.is_paused(), "it shows what comes of the order");
    press(&mut top, "x3");
    assert_eq!(top.press(Key::Escape), Press::Stay);
    press(&mut top, "x");
    assert_eq!(top.press(Key::Enter), Press::Stop(None));
    // A drive that a filter hides is stopped too.
    press(&mut top, "/TIME\nx0");
    assert_eq!(top.press(Key::Enter), Press::Stop(Some(0)));
    let mut reading = four();
    reading.done("drive 0: software stop (ND21 12.6)".to_owned());
    top.take(reading);
    assert!(drawn(&mut top, 80, 24).contains("drive 0: software stop (ND21 12.6) at 01:02:10"));
}

#[test]
fn only_drives_in_error() {
    let mut top = hundred();
    press(&mut top, "e");
    assert_eq!(numbers(&top).len(), 15);
    assert!(drawn(&mut top, 80, 24).contains("errors only"));
    press(&mut top, "e");
    assert_eq!(numbers(&top).len(), 100);
}

/// A code without the error mode is shown: the display is dark then, but the cell holds it (ND21 11.8, 14.10.1).
#[test]
fn a_code_without_the_error_mode_is_an_error_that_the_display_does_not_show() {
    let mut top = Top::new(heading(&[]));
    let mut reading = Snapshot::default();
    put(&mut reading, drive(0, 0, state(0, 0, 0, 0x0508), 0.0));
    top.take(reading);
    press(&mut top, "e");
    let row = &top.rows()[0];
    assert_eq!(row.cells[1..3], ["go", "-"]);
    assert!(row.cells[6].contains("0508"), "{row:?}");
}

#[test]
fn every_order() {
    let mut top = of_four();
    assert_eq!(numbers(&top), ["0", "1", "2", "3"]);
    press(&mut top, "s");
    assert_eq!(numbers(&top), ["3", "1", "0", "2"], "by state");
    press(&mut top, "s");
    assert_eq!(
        numbers(&top),
        ["2", "3", "0", "1"],
        "by speed, whichever way they turn"
    );
    press(&mut top, "s");
    assert_eq!(numbers(&top), ["3", "0", "1", "2"], "by error");
    press(&mut top, "s");
    assert_eq!(numbers(&top), ["0", "1", "2", "3"]);
}

#[test]
fn scrolling_ends_at_the_last_drive() {
    let mut top = hundred();
    let first = |top: &mut Top| {
        let page = drawn(top, 80, 24);
        let row = page
            .lines()
            .skip_while(|line| !line.contains("error, status"))
            .nth(1);
        let row = row.unwrap_or_default().split_whitespace().next();
        row.unwrap_or_default().parse::<usize>().expect("a drive")
    };
    assert_eq!(first(&mut top), 0);
    let room = drawn(&mut top, 80, 24).lines().count() - 5 - 2;
    for (key, expected) in [
        (Key::Up, 0),
        (Key::Down, 1),
        (Key::PageDown, 1 + room),
        (Key::PageUp, 1),
        (Key::Char('k'), 0),
        (Key::End, 100 - room),
        (Key::Down, 100 - room),
        (Key::PageUp, 100 - 2 * room),
        (Key::Home, 0),
        (Key::Char('j'), 1),
    ] {
        assert_eq!(top.press(key), Press::Stay);
        assert_eq!(first(&mut top), expected, "{key:?}");
    }
    // What is filtered away takes the rows with it.
    top.press(Key::End);
    press(&mut top, "e");
    assert_eq!(first(&mut top), 0);
    // A larger terminal shows more at the end.
    press(&mut top, "e");
    top.press(Key::End);
    assert!(drawn(&mut top, 80, 50).contains("-100 of 100"));
}

#[test]
fn a_pause_holds_the_page_and_misses_nothing() {
    let mut top = of_four();
    press(&mut top, "p");
    let before = drawn(&mut top, 80, 24);
    assert!(before.contains("paused"));
    let mut later = four();
    put(&mut later, drive(0, 0, state(0, 0, 0, 0), 777.0));
    top.take(later);
    assert_eq!(drawn(&mut top, 80, 24), before);
    press(&mut top, "p");
    let after = drawn(&mut top, 80, 24);
    assert!(
        after.contains("777.0") && !after.contains("paused"),
        "{after}"
    );
}

#[test]
fn disturbances_are_counted_by_kind_and_can_be_forgotten() {
    let mut top = of_four();
    let page = drawn(&mut top, 120, 40);
    assert!(
        page.contains("drive 1 is damaged (ND21 9.7) 2 times, last at 01:02:10"),
        "{page}"
    );
    press(&mut top, "c");
    assert!(!drawn(&mut top, 120, 40).contains("damaged"));
    let mut reading = four();
    reading.at = at(4_000);
    reading.disturbed("answers come too late".to_owned());
    top.take(reading);
    let page = drawn(&mut top, 120, 40);
    assert!(
        page.contains("too late 2 times, last at 01:06:40"),
        "{page}"
    );
    // Kinds without an end are only counted.
    let mut many = Snapshot::default();
    (0..1_000).for_each(|n| many.disturbed(format!("kind {n}")));
    assert_eq!((many.events.len(), many.others), (64, 936));
    top.take(many);
    press(&mut top, "c");
    assert!(drawn(&mut top, 80, 24).contains("and 936 other messages"));
}

#[test]
fn what_ends_the_view() {
    let ends = [
        (Key::Char('q'), Press::Quit),
        (Key::Escape, Press::Quit),
        (Key::Interrupt, Press::Interrupt),
        (Key::Char('z'), Press::Stay),
        (Key::Enter, Press::Stay),
    ];
    for (key, end) in ends {
        assert_eq!(of_four().press(key), end, "{key:?}");
    }
    // Ctrl-C ends it also where letters are text.
    let mut top = of_four();
    press(&mut top, "/");
    assert_eq!(top.press(Key::Interrupt), Press::Interrupt);
}

/// Rates are those between two moments, rounded; nothing is divided by nothing.
#[test]
fn rates_of_a_line() {
    let now = Counters {
        sent: 3_491,
        idle: 2_491,
        telegrams: 100,
        done: 33,
        ..Counters::default()
    };
    let second = RingReading::between(&Counters::default(), &now, at(1));
    let figures = |ring: &RingReading| (ring.bytes, ring.telegrams, ring.jobs, ring.share);
    assert_eq!(figures(&second), (3_491, 100, 33, 286));
    let still = RingReading::between(&now, &now, Span::ZERO);
    assert_eq!(figures(&still), (0, 0, 0, 0));
    let most = Counters {
        sent: u64::MAX,
        ..Counters::default()
    };
    assert_eq!(
        RingReading::between(&Counters::default(), &most, Span::ZERO).bytes,
        u64::MAX
    );
}

/// An error is red if colours are on, and bold if they are off.
#[test]
fn errors_are_seen_without_colours_too() {
    for colour in [true, false] {
        let area = Rect::new(0, 0, 80, 24);
        let mut buffer = Buffer::empty(area);
        render(&mut of_four(), colour, area, &mut buffer);
        let red = buffer.content().iter().any(|cell| cell.fg == Color::Red);
        assert_eq!(red, colour);
    }
}

/// No size is too small, and none makes it panic.
#[test]
fn terminals_of_every_size() {
    for mut top in [of_four(), hundred(), Top::new(heading(&[]))] {
        for width in [0, 1, 5, 20, 79, 300] {
            for height in [0, 1, 2, 3, 7, 12, 100] {
                let area = Rect::new(0, 0, width, height);
                let mut buffer = Buffer::empty(area);
                render(&mut top, true, area, &mut buffer);
                assert_eq!(text(&buffer).lines().count(), usize::from(height));
            }
        }
    }
}
