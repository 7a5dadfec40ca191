//! Captures: what the links of a ring carried, read from a file of any program.
//!
//! [`read`] takes the files of many programs (`import` has the table of formats). Its bus shows, compares and judges it, and turns it into a scenario.
//!
//! Every file gives a capture or an error that names the place. The memory of a capture is bounded by the size of its file, and
//! that by [`MAX_FILE`].

pub mod files;
pub mod frame_diff;
pub mod frames;
pub mod gap;
pub mod import;
pub mod json;
mod judged;
pub mod live;
pub mod order;
pub mod pcap;
pub mod pcapng;
pub mod recorder;
pub mod runs;
pub mod senders;
pub mod tape;
pub mod telegrams;

pub use import::{ChannelTarget, ImportedCapture, NamedLink, ReadSettings, UartFormat};

pub use judged::{JudgeOptions, JudgedCapture, JudgedFrames, judged_frames, replayed_frames};
pub use recorder::{AWAY, Carries, LiveRecorder, Piece, RecordedPlace};
pub use tape::Tape;

use crate::counted::counted;
use crate::regular::{self, Links};
use harness_proto::line::{Format, Rate};
use harness_proto::novobus::address::MAX_DRIVES;
use harness_proto::profibus::BusRate;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use harness_sim::record::{Carried, Channel, Remark, Trace};
use std::io::Read;
use std::path::{Path, PathBuf};

/// The longest file that is read, in bytes.
pub const MAX_FILE: u64 = 256 * 1024 * 1024;

/// What the links of one or two rings carried.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Capture {
    /// The rate of the line: as the file says, as the times say, or 38400.
    pub rate: Rate,
    /// The rings; of each the links that were captured, in ring order.
    pub traces: Vec<Trace>,
    /// When the capture began and ended, if the file says so.
    pub listened: Option<CaptureSpan>,
    /// Whether the times are those of the line: of a log without times only the order is known.
    pub timed: bool,
}

/// When a capture began and ended, apart from what was heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaptureSpan {
    /// Silence before the first byte.
    pub before: Span,
    /// The end of the capture.
    pub until: Instant,
}

/// Why a file is not a capture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CaptureError {
    /// It cannot be read.
    #[error("failed to read {0}: {1}")]
    File(String, String),
    /// It is too long.
    #[error("the file is longer than {MAX_FILE} bytes; cut it into parts")]
    TooLong,
    /// It is of another kind.
    #[error(
        "the file is no capture that can be read; it looks like {looks}. These formats are read: {formats}"
    )]
    Foreign {
        /// What it looks like, and what to do about it.
        looks: String,
        /// The formats that are read.
        formats: String,
    },
    /// Something in it cannot be.
    #[error("at byte {offset} of the file: {what}")]
    At {
        /// Where, counted from 0.
        offset: usize,
        what: String,
    },
    /// Something in its data of a link is impossible.
    #[error("{place}: {what}")]
    Link {
        /// Which link, and which byte of it.
        place: String,
        what: String,
    },
}

/// Reads a file, or the files of one capture: parts of it one after another, or a file for each channel.
///
/// # Errors
/// [`CaptureError`].
pub fn read_files(
    paths: &[PathBuf],
    settings: &ReadSettings,
) -> Result<ImportedCapture, CaptureError> {
    let mut files = Vec::new();
    let mut left = MAX_FILE;
    for path in paths {
        let failed = |error: std::io::Error| {
            CaptureError::File(path.display().to_string(), error.to_string())
        };
        let file = regular::open_input(path).map_err(failed)?;
        let mut bytes = Vec::new();
        file.take(left + 1)
            .read_to_end(&mut bytes)
            .map_err(failed)?;
        left = left
            .checked_sub(bytes.len() as u64)
            .ok_or(CaptureError::TooLong)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        files.push((name.into_owned(), bytes));
    }
    import::read_files(files, settings)
}

/// Reads the bytes of a file; the rate is taken where it does not say one.
///
/// # Errors
/// [`CaptureError`], but not that of the file itself.
pub fn read(bytes: &[u8], rate: Option<Rate>) -> Result<Capture, CaptureError> {
    let settings = ReadSettings {
        rate,
        ..ReadSettings::default()
    };
    read_with(bytes, &settings).map(|imported| imported.capture)
}

/// Reads the bytes of a file.
///
/// # Errors
/// [`CaptureError`], but not that of the file itself.
pub fn read_with(bytes: &[u8], settings: &ReadSettings) -> Result<ImportedCapture, CaptureError> {
    if bytes.len() as u64 > MAX_FILE {
        return Err(CaptureError::TooLong);
    }
    import::read(bytes, settings)
}

/// Whether to read a file as a capture and not as a scenario: any file that does not look like a scenario.
#[must_use]
pub fn is_capture(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = regular::open(path, Links::Follow)
        .and_then(|file| file.take(4_096).read_to_end(&mut start));
    let named = path.extension().is_some_and(|extension| extension == "scn");
    read.is_ok() && !named && import::is_capture(&start)
}

/// The ends of a link by its name: `98->97`, `master->99`, `2:0->master`; with the ring, counted from 0.
pub fn ends(name: &str) -> Option<(usize, Option<u8>, Option<u8>)> {
    let (ring, link) = match name.strip_prefix("2:") {
        Some(link) => (1, link),
        None => (0, name),
    };
    let (from, to) = link.split_once("->")?;
    let (from, to) = (end(from)?, end(to)?);
    adjacent(from, to).then_some((ring, from, to))
}

/// `master`, or a drive's number.
pub fn end(text: &str) -> Option<Option<u8>> {
    if text == "master" {
        return Some(None);
    }
    let number: u16 = text.parse().ok()?;
    let drive = u8::try_from(number).ok()?;
    (number < MAX_DRIVES).then_some(Some(drive))
}

/// Whether a link can have these ends (ND21 8.5).
pub(crate) fn adjacent(from: Option<u8>, to: Option<u8>) -> bool {
    match (from, to) {
        (None, Some(_)) | (Some(0), None) => true,
        (Some(from), Some(to)) => from == to + 1,
        _ => false,
    }
}

/// A link of a capture that is being read.
pub(crate) struct LinkRead {
    from: Option<u8>,
    to: Option<u8>,
    pub bytes: Vec<LineByte>,
}

/// Puts a capture together of its links.
#[derive(Default)]
pub(crate) struct Assembly {
    /// In ring order: that of falling numbers of the receiver, the master being the last.
    rings: [Vec<Option<LinkRead>>; 2],
}

impl Assembly {
    /// The link with these ends and its bytes so far.
    pub(crate) fn link(&mut self, ring: usize, from: Option<u8>, to: Option<u8>) -> &mut LinkRead {
        let place = to.map_or(256, |drive| 255 - usize::from(drive));
        let links = &mut self.rings[ring.min(1)];
        if links.len() <= place {
            links.resize_with(place + 1, || None);
        }
        links[place].get_or_insert_with(|| LinkRead {
            from,
            to,
            bytes: Vec::new(),
        })
    }

    /// The capture; `sizes` where the file says how many drives there are.
    pub(crate) fn finish(
        self,
        sizes: [Option<u8>; 2],
        remarks: [Vec<Remark>; 2],
        rate: Option<Rate>,
    ) -> Result<Capture, CaptureError> {
        let mut traces = Vec::new();
        for ((links, size), remarks) in self.rings.into_iter().zip(sizes).zip(remarks) {
            let links: Vec<_> = links.into_iter().flatten().collect();
            let highest = |link: &LinkRead| link.from.max(link.to).map_or(1, |drive| drive + 1);
            let Some(least) = links.iter().map(highest).max() else {
                continue;
            };
            let first = links.iter().find(|link| link.from.is_none());
            let by_first = first.and_then(|link| link.to).map(|drive| drive + 1);
            let drives = size.or(by_first).unwrap_or(least);
            if drives < least || by_first.is_some_and(|count| count != drives) {
                return Err(CaptureError::Link {
                    place: format!("a ring of {drives} drives"),
                    what: format!("a link of drive {} is none of it", least - 1),
                });
            }
            let channels = links.into_iter();
            let channels = channels.map(|link| Channel::of_octets(link.from, link.to, link.bytes));
            traces.push(Trace {
                stations: drives,
                channels: channels.collect(),
                remarks,
                seams: Vec::new(),
            });
        }
        let mut capture = Capture {
            rate: rate.unwrap_or_default(),
            traces,
            listened: None,
            timed: true,
        };
        capture.check()?;
        if rate.is_none() {
            capture.rate = capture.guessed_rate();
        }
        Ok(capture)
    }
}

impl Capture {
    /// Bytes of a link come one after another.
    fn check(&self) -> Result<(), CaptureError> {
        for (ring, trace) in self.traces.iter().enumerate() {
            for link in &trace.channels {
                let early = link
                    .octets()
                    .windows(2)
                    .position(|two| two[1].at < two[0].at);
                if let Some(place) = early {
                    let name = crate::report::pcapng::name(ring, link);
                    return Err(CaptureError::Link {
                        place: format!("link {name}, byte {}", place + 2),
                        what: "it comes before the byte in front of it".to_owned(),
                    });
                }
            }
        }
        Ok(())
    }

    /// The fastest rate at which no byte comes sooner after another than it can.
    fn guessed_rate(&self) -> Rate {
        let links = self.traces.iter().flat_map(|trace| &trace.channels);
        let gaps = links.flat_map(|link| link.octets().windows(2));
        let closest = gaps.map(|two| two[1].at.since(two[0].at)).min();
        let fits = |rate: &Rate| {
            let byte = rate.byte_time();
            // A tenth for clocks that differ.
            closest.is_some_and(|gap| gap.units() >= byte.units() / 10 * 9)
        };
        let slowest_first = Rate::ALL.into_iter().rev();
        let near = |rate: &Rate| {
            closest.is_some_and(|gap| gap.units() <= rate.byte_time().units() / 10 * 11)
        };
        slowest_first
            .clone()
            .find(|rate| fits(rate) && near(rate))
            .unwrap_or_default()
    }

    /// How many bytes there are on all links.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let links = self.traces.iter().flat_map(|trace| &trace.channels);
        links.map(|link| link.octets().len()).sum()
    }

    /// Where more than a quarter of the octets of a line was received with an error, in a sentence: that is no cable, but a wrong rate, format
    /// or channel, and what is not damaged there may be wrong as well.
    #[must_use]
    pub(crate) fn mostly_damaged(&self) -> Option<String> {
        // What a simulation has damaged is known to the bit.
        let is_damaged = |byte: &&LineByte| byte.error.is_some() && byte.sent == byte.received;
        let line = |octets: &[&Channel]| {
            let octets = octets.iter().flat_map(|channel| channel.octets());
            let damaged = octets.clone().filter(is_damaged).count();
            (damaged, octets.count())
        };
        let lines = self.traces.iter().flat_map(|trace| {
            let all: Vec<&Channel> = trace.channels.iter().collect();
            match Carries::of(std::slice::from_ref(trace)) {
                Carries::Link => all.into_iter().map(|channel| line(&[channel])).collect(),
                Carries::Line | Carries::Frames => vec![line(&all)],
            }
        });
        let mut bad = lines.filter(|(damaged, all)| damaged * 4 > *all);
        bad.next().map(|(damaged, all)| {
            format!(
                "{damaged} of {} of a line are damaged, more than a quarter: it is no evidence; check rate, format and channel",
                counted(all, "octet")
            )
        })
    }

    /// When the last byte had passed.
    #[must_use]
    pub fn end(&self) -> Instant {
        let links = self.traces.iter().flat_map(|trace| &trace.channels);
        let last = links.filter_map(|link| match &link.carried {
            Carried::Octets(octets) => octets.last().map(|byte| byte.at),
            Carried::Frames(frames) => frames.last().map(|frame| frame.at),
        });
        last.max().unwrap_or(Instant::START)
    }
}

/// The formats that a line of octets may have: that of a bus whose stations share it, or that of a ring. The usual one first.
pub fn line_formats(shared: bool) -> Vec<Format> {
    match shared {
        true => {
            let usual = BusRate::default();
            let others = BusRate::ALL.into_iter().filter(|rate| *rate != usual);
            std::iter::once(usual)
                .chain(others)
                .map(BusRate::format)
                .collect()
        }
        false => Rate::ALL.into_iter().map(Format::from).collect(),
    }
}

/// A byte of a link, its time in nanoseconds since the start.
pub(crate) fn line_byte(
    nanos: u64,
    sent: Option<u8>,
    received: Option<u8>,
    error: Option<harness_proto::line::LineError>,
) -> LineByte {
    let at = Instant::START + Span::from_nanos(nanos);
    LineByte::seen(at, sent, received, error)
}
