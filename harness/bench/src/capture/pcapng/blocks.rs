//! The numbers and options of blocks.

use super::{CaptureError, END, PcapngReader};

impl PcapngReader<'_> {
    pub(super) fn take<const N: usize>(
        &self,
        offset: usize,
        end: usize,
    ) -> Result<[u8; N], CaptureError> {
        let bytes = self.bytes.get(offset..offset.saturating_add(N));
        match bytes.and_then(|bytes| <[u8; N]>::try_from(bytes).ok()) {
            Some(bytes) if offset + N <= end => Ok(bytes),
            _ => self.wrong(
                offset,
                format!("{N} bytes are expected here; the file or the block ends before"),
            ),
        }
    }

    pub(super) fn u16(&self, offset: usize, end: usize) -> Result<u16, CaptureError> {
        let bytes = self.take(offset, end)?;
        Ok(if self.big {
            u16::from_be_bytes(bytes)
        } else {
            u16::from_le_bytes(bytes)
        })
    }

    pub(in crate::capture) fn u32(&self, offset: usize, end: usize) -> Result<u32, CaptureError> {
        let bytes = self.take(offset, end)?;
        Ok(if self.big {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    pub(super) fn u64(&self, offset: usize, end: usize) -> Result<u64, CaptureError> {
        let bytes = self.take(offset, end)?;
        Ok(if self.big {
            u64::from_be_bytes(bytes)
        } else {
            u64::from_le_bytes(bytes)
        })
    }

    /// Calls `each` with every option from `start` on: its code, and where its value begins and ends.
    pub(super) fn options(
        &self,
        start: usize,
        end: usize,
        mut each: impl FnMut(u16, usize, usize) -> Result<(), CaptureError>,
    ) -> Result<(), CaptureError> {
        let mut at = start;
        while at < end {
            let code = self.u16(at, end)?;
            let length = usize::from(self.u16(at + 2, end)?);
            if code == END {
                return Ok(());
            }
            let value = at + 4;
            if value + length > end {
                return self.wrong(
                    at,
                    format!("an option of {length} bytes does not fit into its block"),
                );
            }
            each(code, value, value + length)?;
            at = value + length.next_multiple_of(4);
        }
        Ok(())
    }
}
