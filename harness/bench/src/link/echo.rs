//! What a half-duplex adapter hears of itself: it is compared with what was sent, and is no part of what was received.

use super::Trouble;
use crate::port::Outgoing;
use harness_proto::line::Received;
use std::collections::VecDeque;

/// The octets that an adapter has been given and has not given back.
#[derive(Debug, Default)]
pub struct Echo {
    owed: VecDeque<u8>,
}

impl Echo {
    /// The adapter was given something.
    pub fn sent(&mut self, outgoing: Outgoing) {
        match outgoing {
            Outgoing::Byte(octet) | Outgoing::WrongParity(octet) => self.owed.push_back(octet),
            // A break is heard as 00 with an error.
            Outgoing::Break(_) => self.owed.push_back(0),
        }
    }

    /// How many octets the adapter still owes.
    pub(crate) fn owed(&self) -> usize {
        self.owed.len()
    }

    /// Removes the adapter's echo from what was received. The echo comes first, since stations answer whole telegrams only.
    ///
    /// # Errors
    /// [`Trouble::Garbled`]: it gives back something else. The octets from there on stay.
    pub fn remove(&mut self, came: &mut Vec<Received>, name: &str) -> Result<(), Trouble> {
        let pairs = came.iter().zip(&self.owed);
        let same = pairs.take_while(|(came, owed)| came.byte == **owed);
        let same = same.count();
        let wrong = came.get(same).zip(self.owed.get(same));
        let wrong = wrong.map(|(came, owed)| {
            Trouble::Garbled(format!(
                "{name}: the adapter gave back {:02X} where {owed:02X} was sent: set `echo = false` if it does not hear itself; otherwise \
                 another station sends at the same time, or the line is not terminated",
                came.byte
            ))
        });
        self.owed.drain(..same);
        came.drain(..same);
        wrong.map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An adapter that has heard nothing but itself, in pieces; then an answer after its own octets.
    #[test]
    fn what_was_sent_is_removed_in_pieces() {
        let mut echo = Echo::default();
        for octet in [0x10, 0x08, 0x02] {
            echo.sent(Outgoing::Byte(octet));
        }
        let good = |octets: &[u8]| -> Vec<Received> {
            octets.iter().map(|octet| Received::good(*octet)).collect()
        };
        let mut first = good(&[0x10]);
        assert_eq!(echo.remove(&mut first, "tty"), Ok(()));
        assert_eq!((first, echo.owed()), (Vec::new(), 2));
        let mut rest = good(&[0x08, 0x02, 0xE5]);
        assert_eq!(echo.remove(&mut rest, "tty"), Ok(()));
        assert_eq!((rest, echo.owed()), (good(&[0xE5]), 0));
    }

    #[test]
    fn another_octet_is_an_error_that_names_both() {
        let mut echo = Echo::default();
        echo.sent(Outgoing::Byte(0x68));
        let mut came = vec![Received::good(0xE5)];
        let wrong = echo.remove(&mut came, "/dev/ttyUSB0");
        let text = wrong.expect_err("another octet").to_string();
        assert!(
            text.starts_with("/dev/ttyUSB0: the adapter gave back E5 where 68 was sent"),
            "{text}"
        );
        assert!(text.contains("echo = false"), "{text}");
    }
}
