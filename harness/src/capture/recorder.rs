//! Captures in pcapng that are written as they come: whole after each write, also where the program is killed.

use crate::report::pcapng::{
    Block, COMMENT, END, IF_NAME, IF_SPEED, IF_TSRESOL, INTERFACE, LINK_TYPE, NANOSECONDS, PACKET,
    header, packet,
};
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use std::io::{self, Write};

/// The event of a packet without a byte: a change of the state of the line.
const STATE: u8 = 0x00;

/// A capture that is being written: an interface a link, a packet a byte.
pub(crate) struct LiveRecorder<W> {
    out: W,
    block: Block,
    /// Blocks that are not written yet: they leave in one piece.
    waiting: Vec<u8>,
    /// Bytes written.
    written: u64,
}

impl<W: Write> LiveRecorder<W> {
    /// Begins a capture of these links.
    ///
    /// # Errors
    /// Those of `out`.
    pub(crate) fn start(out: W, links: &[String], rate: Rate) -> io::Result<Self> {
        let mut own = Self {
            out,
            block: Block::default(),
            waiting: Vec::new(),
            written: 0,
        };
        own.block.section(&mut own.waiting)?;
        for link in links {
            own.block.begin(INTERFACE);
            own.block.put(&LINK_TYPE.to_le_bytes());
            own.block.put(&[0; 6]);
            own.block.option(IF_NAME, link.as_bytes());
            let speed = u64::from(rate.bits_per_second());
            own.block.option(IF_SPEED, &speed.to_le_bytes());
            own.block.option(IF_TSRESOL, &[NANOSECONDS]);
            own.block.option(END, &[]);
            own.block.end(&mut own.waiting)?;
        }
        own.flush()?;
        Ok(own)
    }

    /// A byte of a link; its time counts from 1970.
    ///
    /// # Errors
    /// None: blocks are kept until [`flush`](Self::flush).
    pub(crate) fn byte(&mut self, link: usize, byte: &LineByte) -> io::Result<()> {
        packet(&mut self.block, link, byte);
        self.block.end(&mut self.waiting)
    }

    /// Something that happened to a link beside its bytes, in words.
    ///
    /// # Errors
    /// None: blocks are kept until [`flush`](Self::flush).
    pub(crate) fn event(&mut self, link: usize, nanos: u64, words: &str) -> io::Result<()> {
        let at = Instant::START + Span::from_nanos(nanos);
        self.block.begin(PACKET);
        let link = u32::try_from(link).unwrap_or(u32::MAX);
        self.block.put(&link.to_le_bytes());
        header(&mut self.block, at, STATE, 0);
        self.block.option(COMMENT, words.as_bytes());
        self.block.option(END, &[]);
        self.block.end(&mut self.waiting)
    }

    /// Writes what waits, in one piece.
    ///
    /// # Errors
    /// Those of `out`.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.write_all(&self.waiting)?;
        self.written += self.waiting.len() as u64;
        self.waiting.clear();
        self.out.flush()
    }

    /// Bytes of the file so far.
    pub(crate) const fn written(&self) -> u64 {
        self.written
    }
}
