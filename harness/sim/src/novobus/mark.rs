//! What the drives of a ring remark, in the bits of a [`Remark`].

use crate::record::Remark;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::error_mode::Marks;

/// A remark as an ND21 means it.
pub trait Mark {
    /// What it remarked.
    fn marks(&self) -> Marks;

    /// The error for which the drive is, or last was, in the error mode.
    fn cause(&self) -> Option<BusError>;
}

/// The bits of a remark: the marks, and above them the place of the cause in [`BusError::ALL`], counted from 1.
#[must_use]
pub fn bits(marks: Marks, cause: Option<BusError>) -> u16 {
    let cause = cause.map_or(0, |cause| cause as u16 + 1);
    u16::from(marks.bits()) | cause << 8
}

impl Mark for Remark {
    fn marks(&self) -> Marks {
        Marks::from_bits(self.bits.to_le_bytes()[0])
    }

    fn cause(&self) -> Option<BusError> {
        let place = usize::from(self.bits >> 8).checked_sub(1)?;
        BusError::ALL.get(place).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::time::Instant;

    #[test]
    fn every_remark_is_read_as_it_was_made() {
        let causes = BusError::ALL.into_iter().map(Some).chain([None]);
        for (cause, mark) in causes.zip([Marks::DETECTED, Marks::CHECKSUM].into_iter().cycle()) {
            let marks = mark.and(Marks::UPSTREAM);
            let remark = Remark {
                station: 0,
                piece: 1,
                answered_as: None,
                at: Instant::START,
                bits: bits(marks, cause),
            };
            assert_eq!((remark.marks(), remark.cause()), (marks, cause));
        }
    }
}
