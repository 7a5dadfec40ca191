//! A drive alone, which hears what a drive on a segment has heard.

use crate::record::{FrameEnd, LineFrame};
use crate::unitek::{Drive, Inputs};
use harness_proto::can::BitRate;
use harness_proto::time::Instant;
use harness_proto::unitek::Reply;

/// Inputs of a drive that were changed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    pub(super) number: usize,
    /// How many frames were in the record.
    pub(super) behind: usize,
    pub(super) at: Instant,
    /// The inputs from then on.
    pub(super) inputs: Inputs,
}

#[derive(Debug)]
pub(super) struct Replay {
    /// Its place on the segment.
    place: usize,
    drive: Drive,
    rate: BitRate,
}

impl Replay {
    pub(super) const fn new(place: usize, drive: Drive, rate: BitRate) -> Self {
        Self { place, drive, rate }
    }

    /// Hears the record, and compares every frame and the contents at the end with those of the drive on the segment.
    pub(super) fn compare(
        mut self,
        record: &[LineFrame],
        changes: &[Change],
        number: usize,
        undisturbed: bool,
        on_segment: &Drive,
    ) {
        let mut changes = changes
            .iter()
            .filter(|change| change.number == number)
            .peekable();
        for (index, line) in record.iter().enumerate() {
            while let Some(change) = changes.next_if(|change| change.behind <= index) {
                self.drive.set_inputs(change.at, change.inputs);
            }
            if line.from.map(usize::from) == Some(self.place) {
                self.sends(line);
            } else {
                self.waits(line, undisturbed);
                if line.ended == FrameEnd::Good {
                    // What it ignores is its own affair.
                    let _ = self.drive.receive(line.at, &line.frame);
                }
            }
        }
        changes.for_each(|change| self.drive.set_inputs(change.at, change.inputs));
        let (alone, other) = (self.drive.held(), on_segment.held());
        let differing = (0..=u8::MAX).find(|&n| alone[usize::from(n)] != other[usize::from(n)]);
        if let Some(differing) = differing {
            panic!("drive {number}: register {differing:02X} is influenced by another station");
        }
        assert_eq!(self.drive.identifiers(), on_segment.identifiers());
    }

    /// The frame on the segment is the one that the drive alone sends, and a reply.
    fn sends(&mut self, line: &LineFrame) {
        self.drive.advance(line.start);
        let wants = self.drive.wants().map(|waiting| waiting.frame);
        assert_eq!(
            wants,
            Some(line.frame),
            "{line:?}: alone it sends another frame"
        );
        let ready = self.drive.wants().map(|waiting| waiting.ready);
        assert!(ready <= Some(line.start), "{line:?} was not ready");
        let reply = Reply::decode(&line.frame, self.drive.identifiers().1);
        assert!(reply.is_ok(), "{line:?} is no reply (4.5)");
        let plain = self.rate.time_of(line.frame.wire_bits() - 3);
        // It repeats a frame that ended with an error, and one that is doubled.
        let repeats = matches!(line.ended, FrameEnd::Error(_)) || line.at.since(line.start) > plain;
        if !repeats {
            let _ = self.drive.sent();
        }
    }

    /// Another station's frame goes only before a frame of the drive that loses against it.
    fn waits(&mut self, line: &LineFrame, undisturbed: bool) {
        self.drive.advance(line.start);
        if let Some(waiting) = self
            .drive
            .wants()
            .filter(|waiting| undisturbed && waiting.ready <= line.start)
        {
            let wins = waiting.frame.arbitration() < line.frame.arbitration();
            assert!(!wins, "{line:?} went before {}", waiting.frame);
        }
    }
}
