//! Who sent the octets of a line that is recorded at one place, where all stations are heard alike.

use crate::report::pcapng_telegrams::PacketOctet;
use harness_proto::decode::Decoded;
use harness_proto::profibus::Telegram;
use harness_proto::profibus::fdl::{BROADCAST, MAX_TELEGRAM};
use harness_proto::profibus::rate::{OCTET_BITS, SYN_BITS};
use harness_proto::time::Span;

/// The sender of each octet: `None` for a master. A telegram names its sender; a short confirmation is that of the station that was asked.
/// Damaged octets are those of the station that owes a reply, or of a master where none does. `octet` is the time of an octet.
pub(crate) fn senders(octets: &[PacketOctet], octet: Span) -> Vec<Option<u8>> {
    let mut senders: Vec<Option<u8>> = Vec::with_capacity(octets.len());
    let mut asked = None;
    while let Some(left) = octets.get(senders.len()..).filter(|own| !own.is_empty()) {
        // 33 idle bits end a telegram in any case, and 11 a damaged one.
        let run = run(left, octet, SYN_BITS.div_ceil(OCTET_BITS));
        let good = run.iter().take_while(|own| own.error.is_none());
        let bytes: Vec<u8> = good.filter_map(|own| own.received).collect();
        let (sender, used) = match Telegram::decode(&bytes) {
            Decoded::Value { value, used } => {
                let sender = match &value {
                    Telegram::Confirmation => asked.take(),
                    Telegram::Token { .. } => None,
                    Telegram::Pdu(own) if own.fc().is_request() => {
                        asked = Some(own.da()).filter(|own| *own != BROADCAST);
                        None
                    }
                    Telegram::Pdu(own) => {
                        asked = None;
                        Some(own.sa())
                    }
                };
                (sender, used)
            }
            _ => (asked.take(), self::run(left, octet, 1).len()),
        };
        let next = senders.len() + used.max(1);
        senders.resize(next.min(octets.len()), sender);
    }
    senders
}

/// The octets up to a pause of this many octet times, and no more than a telegram has.
fn run(octets: &[PacketOctet], octet: Span, pause: u64) -> &[PacketOctet] {
    // Times are cut off to nanoseconds.
    let longest = (octet * (pause + 1)).as_nanos().saturating_sub(pause + 2);
    let mut pairs = octets.windows(2).take(MAX_TELEGRAM);
    let paused = |two: &[PacketOctet]| two[1].nanos.saturating_sub(two[0].nanos) >= longest;
    let end = pairs.position(paused).map_or(MAX_TELEGRAM, |own| own + 1);
    &octets[..end.min(octets.len())]
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::line::LineError;

    const OCTET: Span = Span::from_micros(22);

    /// Octets with pauses in front of them, in octet times.
    fn line(telegrams: &[(u64, &[u8])]) -> Vec<PacketOctet> {
        let mut nanos = 0;
        let mut octets = Vec::new();
        for (pause, telegram) in telegrams {
            nanos += OCTET.as_nanos() * pause;
            octets.extend(telegram.iter().map(|byte| {
                nanos += OCTET.as_nanos();
                PacketOctet {
                    nanos,
                    sent: Some(*byte),
                    received: Some(*byte),
                    error: None,
                }
            }));
        }
        octets
    }

    /// Diagnosis of slave 8 by master 2: status request, its reply, a request with a short confirmation, and a token.
    #[test]
    fn a_telegram_names_its_sender() {
        let ask: &[u8] = &[0x10, 8, 2, 0x49, 0x53, 0x16];
        let reply: &[u8] = &[0x10, 2, 8, 0x00, 0x0A, 0x16];
        let token: &[u8] = &[0xDC, 2, 2];
        let all = line(&[(4, ask), (1, reply), (4, ask), (1, &[0xE5]), (4, token)]);
        let expected = [
            vec![None; 6],
            vec![Some(8); 6],
            vec![None; 6],
            vec![Some(8)],
            vec![None; 3],
        ];
        assert_eq!(senders(&all, OCTET), expected.concat());
        // A damaged reply is still that of the slave that was asked; a damaged request that of a master.
        let mut damaged = all.clone();
        damaged[8].error = Some(LineError::Parity);
        assert_eq!(senders(&damaged, OCTET), expected.concat());
        damaged[13].error = Some(LineError::Parity);
        let mut unasked = expected.concat();
        unasked[18] = None;
        assert_eq!(senders(&damaged, OCTET), unasked);
        assert_eq!(senders(&[], OCTET), []);
    }
}
