//! Probes in a record.

use harness::evidence::RecordLine as Written;
use harness::library::Entry;
use harness::link::{Line as _, Link, LinkEvent, Recording, Replay};
use harness::scenario::source::Source;
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};

fn link() -> Box<dyn Link> {
    let text = "title two\nring 2\ndrive 0..last model plain\n> 80\n";
    let source = Source::from_bytes("two".to_owned(), text.into()).expect("a text");
    let entry = Entry::new(source, None).expect("a scenario");
    entry.settled.simulate()
}

/// A probe is recorded with what was sent, and played back only for the same bytes.
#[test]
fn a_probe_is_played_back_for_the_same_bytes() {
    let bytes = [0x80, 0x80, 0x88];
    let mut link = link();
    let mut events = Vec::new();
    let mut recording = Recording::new(&mut *link, &mut events);
    recording.begin();
    let came = recording.probe(0, &bytes);
    assert_eq!(came.len(), bytes.len());
    let written: Vec<_> = events.iter().filter_map(Written::of).collect();
    let read: Vec<_> = written.iter().filter_map(Written::event).collect();
    assert_eq!(read, events);
    let replay = || {
        Replay::new(
            read.clone(),
            Rate::default(),
            Span::ZERO,
            vec![2],
            Vec::new(),
        )
    };
    let mut same = replay();
    same.begin();
    assert_eq!(same.probe(0, &bytes), came);
    assert_eq!((same.trouble(), same.left()), (None, None));
    let mut other = replay();
    other.begin();
    assert!(other.probe(0, &[0x80; 3]).is_empty());
    assert!(other.trouble().is_some());
}

/// Records name no bytes of a probe that sends SYNCO.
#[test]
fn a_probe_of_synco_is_written_by_its_number() {
    let probe = LinkEvent::Probe(0, Instant::START, vec![0x80; 8], Vec::new());
    let line = Written::of(&probe).expect("a line");
    let text = serde_json::to_string(&line).expect("JSON");
    assert_eq!(
        text,
        r#"{"kind":"probe","ring":1,"t":0,"count":8,"bytes":[]}"#
    );
    assert_eq!(line.event(), Some(probe));
    let wrong = text.replace(r#""count":8"#, r#""count":8,"sent":"88""#);
    let line: Written = serde_json::from_str(&wrong).expect("a line");
    assert_eq!(line.event(), None, "1 byte is not 8");
}
