//! Lines out of a stream of bytes.

use crate::scenario::source::MAX_LINE;

/// A line without its end, or how many bytes a line has that is too long.
pub(super) type ReadLine = Result<String, usize>;

/// The bytes of an unfinished line. A line that is too long is not kept.
#[derive(Debug, Default)]
pub(super) struct LineBuffer {
    begun: Vec<u8>,
    length: usize,
}

impl LineBuffer {
    /// Takes bytes and returns the lines that they complete. Invalid UTF-8 is replaced, so such a line is not one of the
    /// language.
    pub(super) fn push(&mut self, bytes: &[u8]) -> Vec<ReadLine> {
        let mut lines = Vec::new();
        for &byte in bytes {
            if byte == b'\n' {
                lines.extend(self.end());
            } else {
                self.length = self.length.saturating_add(1);
                if self.length <= MAX_LINE {
                    self.begun.push(byte);
                }
            }
        }
        lines
    }

    /// The stream has ended: what was begun is a line too.
    pub(super) fn end(&mut self) -> Option<ReadLine> {
        let length = std::mem::take(&mut self.length);
        let begun = std::mem::take(&mut self.begun);
        match length {
            0 => None,
            1..=MAX_LINE => Some(Ok(String::from_utf8_lossy(&begun).into_owned())),
            _ => Some(Err(length)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_whole_and_long_ones_are_counted() {
        let mut lines = LineBuffer::default();
        assert!(lines.push(b"ab").is_empty());
        let both = lines.push(b"c\n\nde\nf");
        assert_eq!(both, [Ok("abc".to_owned()), Ok("de".to_owned())]);
        assert_eq!(lines.end(), Some(Ok("f".to_owned())));
        let mut long = vec![b'x'; MAX_LINE + 5];
        long.push(b'\n');
        assert_eq!(lines.push(&long), [Err(MAX_LINE + 5)]);
        assert_eq!(lines.end(), None);
    }
}
