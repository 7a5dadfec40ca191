//! The statistics of an interface: when a capture began and ended.

use super::super::{CaptureError, CaptureSpan};
use super::{PcapngReader, nanoseconds};
use crate::report::pcapng::{ISB_ENDTIME, ISB_STARTTIME};
use harness_proto::time::{Instant, Span};

pub(super) use crate::report::pcapng::STATISTICS;

impl PcapngReader<'_> {
    /// When the capture began and ended at an interface.
    pub(super) fn statistics(&mut self, start: usize, end: usize) -> Result<(), CaptureError> {
        let number = usize::try_from(self.u32(start, end)?).unwrap_or(usize::MAX);
        let place = self.section.saturating_add(number);
        let Some(Some(interface)) = self.interfaces.get(place) else {
            return Ok(());
        };
        let (resolution, offset) = (interface.resolution, interface.offset);
        let (mut began, mut ended) = (None, None);
        self.options(start + 12, end, |code, from, to| {
            if code == ISB_STARTTIME || code == ISB_ENDTIME {
                let (high, low) = (self.u32(from, to)?, self.u32(from + 4, to)?);
                let ticks = (u64::from(high) << 32) | u64::from(low);
                let nanos = nanoseconds(ticks, resolution, offset);
                match code {
                    ISB_STARTTIME => began = nanos,
                    _ => ended = nanos,
                }
            }
            Ok(())
        })?;
        if let (Some(began), Some(ended)) = (began, ended) {
            let (first, last) = self.listened.unwrap_or((began, ended));
            self.listened = Some((first.min(began), last.max(ended)));
        }
        Ok(())
    }
}

/// When a capture began and ended, by the time of its first byte and that from which its times count, in nanoseconds.
pub(super) fn listened_to((began, ended): (u64, u64), first: u64, base: u64) -> CaptureSpan {
    CaptureSpan {
        before: Span::from_nanos(first.saturating_sub(began)),
        until: Instant::START + Span::from_nanos(ended.saturating_sub(base)),
    }
}
