//! Rings that a thread serves in real time, over sockets and pseudo terminals.

mod inner;
mod scenarios;

use crate::drives::simulated;
use crate::serve::Server;
use harness_bench::medium::ErrorMarks;
use harness_bench::port::{PortAddress, PortSettings, Wire, open};
use harness_bench::scenario::source::Source;
use harness_bench::serve::{Inner, Pace, ServeOptions, ServedAt, ServedThread};
use harness_proto::line::Rate;

/// Rings that are served until this value is dropped.
struct ServedRings {
    thread: ServedThread,
    _folder: tempfile::TempDir,
}

impl ServedRings {
    /// Serves rings of these sizes with this setup over `tcp` or `pty`, and links between their stations.
    fn start(setup: &str, sizes: &[u8], transport: &str, marks: bool, inner: Vec<Inner>) -> Self {
        let source = Source::from_bytes("setup".to_owned(), setup.into()).expect("a text");
        let (plan, link) = simulated(&source, Some(sizes)).expect("a setup");
        let marks = match marks {
            true => ErrorMarks::InBand,
            false => ErrorMarks::None,
        };
        let mut server = Server::new(plan, link, Pace::Line, marks);
        let seats = sizes.len() + inner.len();
        inner.into_iter().for_each(|link| server.add(link));
        let folder = tempfile::tempdir().expect("a folder");
        let places = (0..seats).map(|seat| match transport {
            "pty" => ServedAt::Pty(folder.path().join(format!("seat{seat}"))),
            _ => ServedAt::Tcp("127.0.0.1:0".to_owned()),
        });
        let options = ServeOptions {
            places: places.collect(),
            ..ServeOptions::default()
        };
        Self {
            thread: ServedThread::start(server, options).expect("places"),
            _folder: folder,
        }
    }

    /// A client of a seat: of a ring, or of a link behind the rings.
    fn wire(&self, seat: usize, marks: bool) -> Wire {
        let place = &self.thread.places()[seat];
        let address = match place.starts_with('/') {
            true => PortAddress::Pty(place.into()),
            false => PortAddress::Tcp(place.clone()),
        };
        wire(&address, marks)
    }
}

fn wire(address: &PortAddress, marks: bool) -> Wire {
    let settings = PortSettings {
        address: address.clone(),
        format: Rate::default().into(),
        marks,
        low_latency: false,
    };
    open(&settings).unwrap_or_else(|error| panic!("{address}: {error}"))
}

/// A ring that only a page shows has no place that is waited for.
#[test]
fn a_ring_that_is_served_nowhere_has_no_place() {
    let source = Source::from_bytes("setup".to_owned(), Vec::new()).expect("a text");
    let (plan, link) = simulated(&source, Some(&[2])).expect("a setup");
    let server = Server::new(plan, link, Pace::Line, ErrorMarks::None);
    let options = ServeOptions {
        places: vec![ServedAt::Nowhere],
        ..ServeOptions::default()
    };
    let thread = ServedThread::start(server, options).expect("a thread");
    assert_eq!(thread.places(), [""; 0]);
}
