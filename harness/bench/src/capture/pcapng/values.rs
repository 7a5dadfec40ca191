//! Values of packets: times in any resolution, and comments.

use crate::capture::recorder::AWAY;
use crate::report::pcapng::NANOSECONDS;
use crate::scenario::run::record::from_hex;

/// What the transmitter sent, if a comment says it: `sent 12`, `sent nothing`.
pub(super) fn sent(comment: &[u8]) -> Option<Option<u8>> {
    let stated = std::str::from_utf8(comment.strip_prefix(b"sent ")?).ok()?;
    match from_hex(stated).as_deref() {
        Some([byte]) => Some(Some(*byte)),
        _ => (stated == "nothing").then_some(None),
    }
}

/// Events of a capture noted at most.
const NOTED: usize = 10;

/// The remarks of a capture besides bytes and frames, in sentences.
pub(super) fn noted(events: Vec<String>) -> Vec<String> {
    let more = events.len().saturating_sub(NOTED);
    let events = events.into_iter().filter(|event| !event.is_empty());
    let mut notes: Vec<_> = events.collect();
    notes.truncate(NOTED);
    if more > 0 {
        notes.push(format!("{more} more events"));
    }
    notes
}

/// Whether bytes or frames are missing after an event: they were lost, or the adapter was away.
pub(super) fn means_loss(event: &str) -> bool {
    event.contains(" lost: ") || event == AWAY
}

/// A time in nanoseconds; `None` where it is out of all range. A resolution is a power of 10, or of 2 with its high bit set.
pub(in crate::capture) fn nanoseconds(ticks: u64, resolution: u8, offset: i64) -> Option<u64> {
    const SECOND: u128 = 1_000_000_000;
    // The most nanoseconds that an `Instant` can hold.
    const MOST: u128 = u64::MAX as u128 / 4;
    let ticks = u128::from(ticks);
    let nanos = if resolution == NANOSECONDS {
        ticks
    } else if resolution & 0x80 == 0 {
        ticks.checked_mul(SECOND)? / 10_u128.checked_pow(u32::from(resolution))?
    } else {
        ticks
            .checked_mul(SECOND)?
            .checked_shr(u32::from(resolution & 0x7F))?
    };
    let offset = i128::from(offset) * 1_000_000_000;
    let nanos = i128::try_from(nanos).ok()?.checked_add(offset)?;
    let nanos = u128::try_from(nanos).ok()?;
    (nanos <= MOST).then(|| u64::try_from(nanos).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolutions() {
        assert_eq!(nanoseconds(1_500, 6, 0), Some(1_500_000));
        assert_eq!(nanoseconds(1_500, 9, 2), Some(2_000_001_500));
        assert_eq!(nanoseconds(1 << 20, 0x80 | 20, 0), Some(1_000_000_000));
        assert_eq!(nanoseconds(5, 9, -1), None);
        assert_eq!(nanoseconds(u64::MAX, 0, 0), None);
        assert_eq!(nanoseconds(1, 127, 0), None);
    }

    #[test]
    fn comments() {
        assert_eq!(sent(b"sent 1f"), Some(Some(0x1F)));
        assert_eq!(sent(b"sent nothing"), Some(None));
        assert_eq!(sent(b"sent 1"), None);
        assert_eq!(sent(b"look at this"), None);
    }
}
