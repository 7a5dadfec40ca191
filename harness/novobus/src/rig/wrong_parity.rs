//! Whether a byte with a wrong parity bit reaches the first drive of a ring. Some drivers of serial ports refuse to switch the parity, and some
//! ignore it and say that they did it.

use super::session::{OfRings as _, Session};
use harness_bench::link::{
    Capability, Line as _, Link as _, LinkFault, Moment, Octets as _, PlacedFault, wait_keeping,
};
use harness_bench::rig::SessionError;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::Span;
use harness_sim::fault::Flips;

/// SYNCO in a row, with the damaged one in the middle: it comes back as the first zero of the error mode (ND21 9.7).
const SENT: [u8; 9] = [SYNCO; 9];
const DAMAGED: usize = 4;

/// How long the bytes may take: a round of 250 drives at 9600 bit/s takes 286 ms (ND21 8.2), and a busy computer longer.
const PATIENCE: Span = Span::from_millis(3_000);

const WRONG: Flips = Flips {
    data: 0,
    parity: true,
    stop: false,
    start: false,
};

/// What became of a byte with a wrong parity bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WrongParity {
    /// The first drive has noticed it.
    Noticed,
    /// The ring has taken it for a good one.
    Unnoticed,
    /// The driver of the port does not switch the parity.
    Refused,
}

impl WrongParity {
    /// Why scenarios with wrong parity are not played; `None` where they are.
    #[must_use]
    pub(crate) fn obstacle(self, port: &str) -> Option<String> {
        match self {
            Self::Noticed => None,
            Self::Unnoticed => Some(format!(
                "a byte sent with a wrong parity bit was not noticed at its place: the driver of {port} ignores the switch of the parity or makes it at the \
                 wrong time, or the first drive does not check parity (ND21 9.7); scenarios that need line errors are not played"
            )),
            Self::Refused => Some(format!(
                "the driver of {port} does not switch the parity between two bytes, so no byte can be sent with a wrong parity bit; scenarios that need line \
                 errors are not played"
            )),
        }
    }
}

/// Sends a ring behind a serial port one byte with a wrong parity bit, and takes the ring out of the error mode. Where the byte has no effect,
/// the bench has no line errors from then on. `None` where nothing is tried: at another port, or where the rig's limits deny the fault.
///
/// # Errors
/// The ring does not leave the error mode.
pub(crate) fn try_wrong_parity(
    session: &mut Session,
    ring: usize,
) -> Result<Option<WrongParity>, SessionError> {
    let switches = session
        .ports()
        .and_then(|ports| ports.switches_parity(ring));
    match switches {
        None => return Ok(None),
        Some(false) => return Ok(Some(WrongParity::Refused)),
        Some(true) => {}
    }
    let link = session.link();
    if !link.capabilities().contains(&Capability::LineErrors) {
        return Ok(None);
    }
    link.begin();
    let fault = PlacedFault::Link(0, LinkFault::Flip(WRONG));
    while link.receive_octet(ring).is_some() {}
    link.inject(ring, fault, Moment::Byte(DAMAGED as u64 + 1));
    if link.trouble().is_some() {
        link.reset_after_denial();
        return Ok(None);
    }
    let end = link.send_octets(ring, &SENT) + PATIENCE;
    let mut heard = Vec::new();
    while heard.len() < SENT.len() && link.now() < end && link.trouble().is_none() {
        wait_keeping(link, end);
        let received = std::iter::from_fn(|| link.receive_octet(ring));
        heard.extend(received.map(|(_, received)| received.byte));
    }
    session.health()?;
    let found = noticed(&heard);
    if found == Some(WrongParity::Unnoticed) {
        session.link().lose(Capability::LineErrors);
    }
    Ok(found)
}

/// What came back tells, where enough of it came.
fn noticed(heard: &[u8]) -> Option<WrongParity> {
    match heard.iter().position(|byte| *byte != SYNCO) {
        Some(DAMAGED) => Some(WrongParity::Noticed),
        Some(_) => Some(WrongParity::Unnoticed),
        None => (heard.len() == SENT.len()).then_some(WrongParity::Unnoticed),
    }
}

/// The same of every ring of a rig, for a run; why no scenario with wrong parity is played, for each ring of which it is known.
///
/// # Errors
/// A ring does not leave the error mode.
pub(crate) fn obstacles(session: &mut Session) -> Result<Vec<String>, SessionError> {
    let mut all = Vec::new();
    for ring in 0..session.rings().len() {
        let found = try_wrong_parity(session, ring)?;
        let ports = session.ports();
        let port = ports.map(|ports| ports.port_name(ring).to_owned());
        let obstacle = found
            .zip(port)
            .and_then(|(found, port)| found.obstacle(&port));
        all.extend(obstacle);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The damaged byte itself is noticed, and no other; what has not come back tells nothing.
    #[test]
    fn only_the_damaged_byte_counts() {
        for (heard, found) in [
            (
                &[0x80, 0x80, 0x80, 0x80, 0, 0, 0, 0, 0][..],
                Some(WrongParity::Noticed),
            ),
            (
                &[0x80, 0x80, 0x80, 0, 0, 0, 0, 0, 0],
                Some(WrongParity::Unnoticed),
            ),
            (&[0x80; 9], Some(WrongParity::Unnoticed)),
            (&[0x80; 8], None),
            (&[], None),
        ] {
            assert_eq!(noticed(heard), found, "{heard:02X?}");
        }
    }
}
