//! The forms: small examples as snapshots, the picture's XML and size, the rules of each form.

use super::{DAMAGED, built_in, root, run, status, written};
use harness::capture::Capture;
use harness::report::vcd::Signals;
use harness::shown::{FileForm, RowPlacing};
use quick_xml::Reader;
use quick_xml::events::Event;

/// A read and a damaged byte in a ring of two.
const SMALL: &str = "title small\nring 2\ndrive 1 memory FE13 = 88\n! 1->0 byte 9: flip 0\n\
    > 88 FF C0 13 FE D1\n> 80*4 81\n+5ms > 80\n";

fn picture(capture: &Capture, title: &str, scale: RowPlacing) -> String {
    text(written(capture, FileForm::Svg(scale, None), title))
}

fn waves(capture: &Capture, signals: Signals) -> String {
    text(written(capture, FileForm::Vcd(signals), ""))
}

fn rows(capture: &Capture) -> String {
    text(written(capture, FileForm::Csv, ""))
}

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).expect("text")
}

fn snapshot(name: &str, text: &str) {
    insta::with_settings!({
        snapshot_path => root().join("snapshots/captures"),
        prepend_module_to_snapshot => false,
        omit_expression => true,
        snapshot_suffix => "",
    }, {
        insta::assert_snapshot!(name, text);
    });
}

#[test]
fn small_examples() {
    let capture = run(SMALL);
    snapshot("small.csv", &rows(&capture));
    snapshot("small.vcd", &waves(&capture, Signals::All));
    snapshot("small.svg", &picture(&capture, "small", RowPlacing::Index));
    snapshot(
        "small-by-time.svg",
        &picture(&capture, "small", RowPlacing::Time),
    );
}

/// Names of elements with the text in them; panics where it is no XML.
fn elements(text: &str) -> Vec<(String, String)> {
    let mut reader = Reader::from_str(text);
    let mut open: Vec<(String, String)> = Vec::new();
    let mut closed = Vec::new();
    loop {
        match reader.read_event().expect("well-formed") {
            Event::Start(start) => {
                let attributes = start.attributes();
                attributes.for_each(|a| drop(a.expect("an attribute")));
                let name = String::from_utf8(start.name().as_ref().to_vec()).expect("text");
                open.push((name, String::new()));
            }
            Event::Empty(element) => {
                let name = String::from_utf8(element.name().as_ref().to_vec()).expect("text");
                element
                    .attributes()
                    .for_each(|a| drop(a.expect("an attribute")));
                closed.push((name, String::new()));
            }
            Event::End(_) => closed.push(open.pop().expect("an open element")),
            Event::Text(text) => {
                if let Some((_, inner)) = open.last_mut() {
                    inner.push_str(&text.decode().expect("text"));
                }
            }
            Event::GeneralRef(name) => {
                if let Some((_, inner)) = open.last_mut() {
                    inner.push_str(&format!("&{};", String::from_utf8_lossy(&name)));
                }
            }
            Event::Eof => break,
            other => panic!("{other:?} in a picture"),
        }
    }
    assert!(open.is_empty(), "{open:?} is not closed");
    closed
}

#[test]
fn every_picture_is_xml_and_readable() {
    let scenarios = [
        "9.7-parity-error",
        "9.8-check-sequence",
        "9.9-broken-ring-2-1",
        "10.1-read-byte",
        "9.5-several-commands",
    ];
    for name in scenarios {
        for scale in [RowPlacing::Index, RowPlacing::Time] {
            let picture = picture(&built_in(name), name, scale);
            let all = elements(&picture);
            let count = |wanted: &str| all.iter().filter(|(name, _)| name == wanted).count();
            assert_eq!(count("desc"), 1, "{name}");
            // One for the picture, one for each byte or group of them.
            assert!(count("title") > 10, "{name}");
            assert_eq!(count("script"), 0);
            assert!(picture.contains("role=\"img\"") && picture.contains("prefers-color-scheme"));
            assert!(picture.len() < 1_000_000, "{name}: {} bytes", picture.len());
        }
    }
}

#[test]
fn the_fault_is_marked_and_described() {
    let picture = picture(&built_in("9.7-parity-error"), "", RowPlacing::Index);
    let description = elements(&picture)
        .into_iter()
        .find(|(name, _)| name == "desc")
        .expect("a description");
    assert!(
        description
            .1
            .contains("Fault: 98-&gt;97 byte 10: 13 sent, 12 received (parity)"),
        "{}",
        description.1
    );
    assert!(
        description
            .1
            .contains("Fault: 97-&gt;96 byte 10: detected parity")
    );
    assert!(picture.contains("zero of the error mode (ND21 9.7)"));
}

#[test]
fn hostile_titles_stay_text() {
    let capture = run(SMALL);
    let hostile = "</title><script>alert(1)</script>\"'&amp;\u{0}\u{1b}]0;\u{ffff}<![CDATA[ x ]]>";
    let picture = picture(&capture, hostile, RowPlacing::Index);
    let all = elements(&picture);
    assert!(all.iter().all(|(name, _)| name != "script"));
    let (_, title) = all.iter().find(|(name, _)| name == "title").expect("one");
    assert!(title.starts_with("&lt;/title&gt;&lt;script&gt;"), "{title}");
    assert!(!picture.contains('\u{0}') && !picture.contains('\u{1b}'));
}

/// However long a run is, its picture stays small, and says what it leaves out.
#[test]
fn a_long_run_is_cut() {
    let text = format!(
        "title long\nring 100\n{}",
        "> 88 9C C0 13 FE D1\n> 80*20\n".repeat(120)
    );
    let capture = run(&text);
    for scale in [RowPlacing::Index, RowPlacing::Time] {
        let picture = picture(&capture, "long", scale);
        assert!(picture.len() < 2_000_000, "{} bytes", picture.len());
        assert!(picture.contains("Only the beginning is drawn."));
        elements(&picture);
    }
}

/// What a dump's line says, read by the rules of a UART, is what the trace says.
#[test]
fn the_dump_of_a_line_is_read_back() {
    let capture = run(DAMAGED);
    let text = waves(&capture, Signals::Lines);
    assert!(!text.contains("\nb"), "no vectors");
    let code = text
        .lines()
        .find_map(|line| {
            line.strip_prefix("$var wire 1 ")?
                .strip_suffix(" 1_to_0_line $end")
        })
        .expect("the link");
    let mut edges = vec![];
    let mut now = 0_u64;
    for line in text.lines().skip_while(|line| *line != "#0") {
        if let Some(time) = line.strip_prefix('#') {
            now = time.parse().expect("a time");
        } else if let Some(level) = line.strip_suffix(code).filter(|level| level.len() == 1) {
            edges.push((now, level == "1"));
        }
    }
    assert_eq!(edges[0], (0, true), "always #0 first, and idle");
    let read = uart(&edges);
    let link = &capture.traces[0].channels[1];
    let arrived = link.octets().iter().filter(|byte| byte.received.is_some());
    let expected: Vec<_> = arrived
        .map(|byte| {
            // A line does not show that its receiver was slow.
            let status = Some(status(byte)).filter(|status| *status != "overrun");
            (byte.received.expect("arrived"), status.unwrap_or("ok"))
        })
        .collect();
    assert_eq!(read, expected);
    for status in ["parity", "framing", "break"] {
        assert!(read.iter().any(|(_, read)| *read == status), "{status}");
    }
}

/// A receiver of 8O1 at 38400 bit/s, over edges at ticks of 100 ns.
fn uart(edges: &[(u64, bool)]) -> Vec<(u8, &'static str)> {
    let bit = |halves: u64| halves * 1_302_083 / 10_000;
    let level = |at: u64| edges[edges.partition_point(|(time, _)| *time <= at) - 1].1;
    let mut read = Vec::new();
    let mut at = 0;
    while let Some((start, _)) = edges.iter().find(|(time, level)| *time >= at && !level) {
        let sample = |place: u64| level(start + bit(2 * place + 1));
        let byte = (0..8)
            .map(|place| u8::from(sample(place + 1)) << place)
            .sum::<u8>();
        let ones = byte.count_ones() + u32::from(sample(9));
        let status = match (sample(10), ones) {
            (false, 0) => "break",
            (false, _) => "framing",
            (true, ones) if ones % 2 == 0 => "parity",
            _ => "ok",
        };
        read.push((byte, status));
        // From the middle of the stop bit on, where the line is idle again.
        at = start + bit(21);
        if !level(at) {
            let idle = edges.iter().find(|(time, level)| *time >= at && *level);
            at = idle.map_or(u64::MAX, |(time, _)| *time);
        }
    }
    read
}
