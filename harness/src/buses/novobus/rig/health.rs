//! Checks whether a ring is healthy and has the size given in the rig's file.

use crate::buses::novobus::driver::{count_behind, recover};
use crate::link::{Link, Octets, Trouble};
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::sync::SYNCO;
use std::fmt::Write as _;

/// Maximum number of unexpected bytes shown.
const SHOWN: usize = 8;

/// What is wrong with a ring.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unhealthy {
    /// Bytes come although the bench sends nothing.
    #[error("{count} bytes came although nothing was sent ({bytes})")]
    Talking {
        /// How many.
        count: usize,
        /// The first of them.
        bytes: String,
    },
    /// Bytes come back slower than they are sent.
    #[error("bytes come back at {found} bit/s, they are sent at {stated} bit/s")]
    Slow {
        /// The rate at which they come back, in bit/s.
        found: u32,
        /// The rate of the rig's file, in bit/s.
        stated: u32,
    },
    /// Nothing comes back.
    #[error("nothing comes back for the bytes that were sent")]
    Silent,
    /// The bytes that come back are not the answer of a ring.
    #[error("the bytes that come back are not those of a ring: {bytes}")]
    Foreign {
        /// The first bytes.
        bytes: String,
    },
    /// A drive still spells out its address after the check sequence.
    #[error(
        "the ring does not leave the error mode: drive {0} reports a fault in front of it (ND21 9.7)"
    )]
    Broken(u8),
    /// Another number of drives.
    #[error("the ring has {found} drives, the rig's file says {stated}")]
    Size {
        /// How many answered.
        found: u8,
        /// How many the file says.
        stated: u8,
    },
    /// The link.
    #[error("{0}")]
    Trouble(Trouble),
}

/// What a healthy ring showed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Health {
    /// How many drives each ring has.
    pub rings: Vec<RingSize>,
    /// Drives that reported a fault before the ring was brought back: ring and drive.
    pub reported: Vec<(usize, u8)>,
}

/// Recovers every ring (9.8), counts its drives and compares the number with the rig's file.
///
/// # Errors
/// The first unhealthy ring, and what is wrong with it.
pub fn examine(
    link: &mut dyn Link,
    rings: &[RingSize],
    attempts: u8,
) -> Result<Health, (usize, Unhealthy)> {
    let mut health = Health {
        rings: rings.to_vec(),
        reported: Vec::new(),
    };
    link.begin();
    for (ring, size) in rings.iter().enumerate() {
        let mut left = attempts.max(1);
        loop {
            // Behind it commands pass the guard.
            let sent = link.send_octets(ring, &CHECK_SEQUENCE);
            while link.now() < sent && link.wait(sent) {}
            match examine_once(link, ring, *size) {
                Ok(reported) => {
                    health.reported.extend(reported.map(|drive| (ring, drive)));
                    break;
                }
                Err(ill) => {
                    left -= 1;
                    if left == 0 || link.trouble().is_some() {
                        return Err((ring, ill));
                    }
                }
            }
        }
    }
    link.begin();
    Ok(health)
}

/// One ring, once; the drive that reported a fault before.
fn examine_once(
    link: &mut dyn Link,
    ring: usize,
    stated: RingSize,
) -> Result<Option<u8>, Unhealthy> {
    let recovery = recover(link, ring);
    if let Some(trouble) = link.trouble() {
        return Err(Unhealthy::Trouble(trouble.clone()));
    }
    match recovery.drives {
        Some(found) if found == stated => Ok(recovery.before),
        // Noise can look like an answer once, and not twice.
        Some(found) if count_behind(link, ring, &[]) == Some(found) => Err(Unhealthy::Size {
            found: found.drives(),
            stated: stated.drives(),
        }),
        _ => {
            let bytes = link.probe(ring, &vec![SYNCO; 4 * usize::from(stated.drives()) + 8]);
            Err(match (recovery.after, bytes.is_empty()) {
                (Some(drive), _) => Unhealthy::Broken(drive),
                (None, true) => Unhealthy::Silent,
                (None, false) => Unhealthy::Foreign {
                    bytes: shown(&bytes),
                },
            })
        }
    }
}

/// Whether unasked bytes are those of drives that have missed their master (ND21 9.9): zeros, then for ever the address of the drive behind
/// the silence.
pub(crate) fn sounds_timed_out(heard: &[Received], ring: Option<RingSize>) -> bool {
    let Some(last) = heard.last().map(|received| received.byte) else {
        return false;
    };
    let address = heard.iter().map(|received| received.byte);
    let mut behind = address.skip_while(|byte| *byte == 0);
    heard.iter().all(|received| received.error.is_none())
        && ring.is_some_and(|size| last < size.drives())
        && behind.all(|byte| byte == last)
}

impl Unhealthy {
    pub(crate) fn talking(bytes: &[Received]) -> Self {
        Self::Talking {
            count: bytes.len(),
            bytes: shown(bytes),
        }
    }
}

fn shown(bytes: &[Received]) -> String {
    let mut text = String::new();
    for byte in bytes.iter().take(SHOWN) {
        // Writing to a String cannot fail.
        let _infallible = write!(text, "{:02X} ", byte.byte);
    }
    if bytes.len() > SHOWN {
        text.push_str("...");
    }
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 9.9: a ring of three behind a silence sends 00, then 02 for ever; another master sends anything.
    #[test]
    fn drives_that_timed_out_are_no_other_master() {
        let heard = |bytes: &[u8]| {
            let bytes: Vec<_> = bytes.iter().map(|byte| Received::good(*byte)).collect();
            sounds_timed_out(&bytes, RingSize::new(3).ok())
        };
        assert!(heard(&[0, 0, 0, 2, 2, 2]) && heard(&[2, 2]) && heard(&[0, 0]));
        assert!(!heard(&[]) && !heard(&[3, 3]) && !heard(&[0, 1, 2]) && !heard(&[2, 2, 0]));
        assert!(!heard(&[0x88, 0xFF, 0xC0]) && !heard(&[0x80, 0x80]));
    }
}
