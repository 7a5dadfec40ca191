//! Captures in pcapng that are written as they come: whole after each write, also where the program is killed.

use crate::report::pcapng::{Block, COMMENT, END, LINK_TYPE, PACKET, header, packet};
use crate::report::pcapng_telegrams::{self, MOST, octet_time};
use crate::report::{pcapng_frames, pcapng_telegrams::RECEIVED};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Carried, Channel, LineByte, LineFrame, Trace};
use std::io::{self, Write};

/// The event of a packet without a byte: a change of the state of the line.
const STATE: u8 = 0x00;

/// The event of an adapter that was pulled out.
pub const AWAY: &str = "the adapter was pulled out";

/// What an interface of a capture carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carries {
    /// The octets of a link of a ring.
    Link,
    /// The octets of a line that stations share.
    Line,
    Frames,
}

impl Carries {
    /// What these traces carried: frames, octets for all stations, or octets of links.
    pub fn of(traces: &[Trace]) -> Self {
        let mut channels = traces.iter().flat_map(|trace| &trace.channels);
        let carries_frames = |channel: &Channel| matches!(channel.carried, Carried::Frames(_));
        if channels.clone().any(carries_frames) {
            return Self::Frames;
        }
        match channels.any(|channel| channel.from.is_none() && channel.to.is_none()) {
            true => Self::Line,
            false => Self::Link,
        }
    }
}

/// An interface of a capture that is being written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedPlace {
    /// Its name: a link such as `98->97`, or that of a bus.
    pub name: String,
    pub carries: Carries,
    pub bits_per_second: u32,
}

/// What was heard at a place; times count from 1970.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// An octet of a link.
    Octet(LineByte),
    /// Octets of a shared line that followed each other, and the station that sent them; `None` is a master.
    Telegram(Option<u8>, Vec<LineByte>),
    Frame(LineFrame),
    /// Something else that happened, in words: nanoseconds, and the words.
    Event(u64, String),
}

impl Piece {
    /// The same, heard so much later.
    pub fn later(&self, span: Span) -> Self {
        let byte = |octet: &LineByte| LineByte {
            at: octet.at + span,
            ..*octet
        };
        match self {
            Self::Octet(octet) => Self::Octet(byte(octet)),
            Self::Telegram(from, octets) => {
                Self::Telegram(*from, octets.iter().map(byte).collect())
            }
            Self::Frame(frame) => Self::Frame(LineFrame {
                start: frame.start + span,
                at: frame.at + span,
                ..*frame
            }),
            Self::Event(nanos, words) => {
                Self::Event(nanos.saturating_add(span.as_nanos()), words.clone())
            }
        }
    }
}

/// A capture that is being written: an interface a place, a packet an octet of a ring, a telegram or a frame.
pub struct LiveRecorder<W> {
    out: W,
    block: Block,
    places: Vec<RecordedPlace>,
    /// Blocks that are not written yet: they leave in one piece.
    waiting: Vec<u8>,
    written: u64,
}

impl<W: Write> LiveRecorder<W> {
    /// Begins a capture of these places.
    ///
    /// # Errors
    /// Writing to `out` fails.
    pub fn start(out: W, places: &[RecordedPlace]) -> io::Result<Self> {
        let mut recorder = Self {
            out,
            block: Block::default(),
            places: places.to_vec(),
            waiting: Vec::new(),
            written: 0,
        };
        recorder.block.section(&mut recorder.waiting)?;
        for place in places {
            let link_type = match place.carries {
                Carries::Link | Carries::Line => LINK_TYPE,
                Carries::Frames => pcapng_frames::LINK_TYPE,
            };
            let (block, speed) = (&mut recorder.block, place.bits_per_second.into());
            block.interface(link_type, &place.name, Some(speed));
            block.end(&mut recorder.waiting)?;
        }
        recorder.flush()?;
        Ok(recorder)
    }

    /// Keeps what was heard at the place with this number.
    ///
    /// # Errors
    /// None: blocks are kept until [`flush`](Self::flush).
    pub fn piece(&mut self, place: usize, piece: &Piece) -> io::Result<()> {
        let (block, out) = (&mut self.block, &mut self.waiting);
        let recorded = self.places.get(place);
        let carries = recorded.map(|place| place.carries);
        match piece {
            Piece::Octet(byte) => packet(block, place, byte),
            Piece::Telegram(_, octets) => {
                let octet = recorded.and_then(|place| octet_time(place.bits_per_second.into()));
                for part in octets.chunks(MOST) {
                    pcapng_telegrams::packet(block, place, RECEIVED, part, octet);
                    block.end(out)?;
                }
                return Ok(());
            }
            Piece::Frame(frame) => pcapng_frames::packet(block, place, frame),
            Piece::Event(nanos, words) if carries == Some(Carries::Frames) => {
                pcapng_frames::event(block, place, *nanos, words);
            }
            Piece::Event(nanos, words) => {
                block.begin(PACKET);
                let place = u32::try_from(place).unwrap_or(u32::MAX);
                block.put(&place.to_le_bytes());
                header(block, Instant::START + Span::from_nanos(*nanos), STATE, 0);
                block.option(COMMENT, words.as_bytes());
                block.option(END, &[]);
            }
        }
        block.end(out)
    }

    /// Keeps when the capture began and ended at each place, in nanoseconds since 1970.
    ///
    /// # Errors
    /// None: blocks are kept until [`flush`](Self::flush).
    pub(crate) fn statistics(&mut self, began: u64, ended: u64) -> io::Result<()> {
        for place in 0..u32::try_from(self.places.len()).unwrap_or(0) {
            self.block.statistics(place, began, ended);
            self.block.end(&mut self.waiting)?;
        }
        Ok(())
    }

    /// Writes what waits, in one piece.
    ///
    /// # Errors
    /// Writing to `out` fails.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.write_all(&self.waiting)?;
        self.written += self.waiting.len() as u64;
        self.waiting.clear();
        self.out.flush()
    }

    /// Bytes written to the file so far.
    pub const fn written(&self) -> u64 {
        self.written
    }
}
