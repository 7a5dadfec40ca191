//! Who sent the octets of a line that is recorded at one place, where all stations are heard alike.

use crate::counted::counted;
use crate::report::pcapng_telegrams::PacketOctet;
use harness_proto::decode::Decoded;
use harness_proto::line::{LineError, Received};
use harness_proto::profibus::Telegram;
use harness_proto::profibus::fdl::{BROADCAST, MAX_TELEGRAM, Malformed};
use harness_proto::profibus::rate::{OCTET_BITS, SYN_BITS};
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;

/// The octets of a line that is recorded at one place, with their senders.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct LineRead {
    /// Each octet with its sender: `None` for a master.
    pub octets: Vec<(Option<u8>, PacketOctet)>,
    /// Octets that are of no telegram and that no slave owes: a reply may be among them.
    pub unread: usize,
    /// What there is to say about it, in sentences.
    pub notes: Vec<String>,
}

impl LineRead {
    /// Finds the senders of octets. A telegram names its sender; a short confirmation is that of the station that was asked. Damaged octets
    /// are those of the station that owes a reply, or of a master where none does. `octet` is the time of an octet.
    ///
    /// In `pieces` of an adapter the times between octets may not be those on the line: where more telegrams are whole without them, their
    /// own octets say where they end.
    pub(crate) fn of(octets: &[PacketOctet], octet: Span, pieces: bool) -> Self {
        let mut notes = Vec::new();
        let mut runs = by_time(octets, octet);
        if pieces && of_no_telegram(&runs, |_| true) > 0 {
            let joined = joined(octets, octet);
            if of_no_telegram(&joined, |_| true) < of_no_telegram(&runs, |_| true) {
                let about = "the octets came in pieces of an adapter: their own values say where telegrams end, and the pauses on the line are \
                             not known";
                notes.push(about.to_owned());
                runs = joined;
            }
        }
        let low = runs.extract_if(.., |run| run.kind == RunKind::Low).count();
        if low > 0 {
            notes.push(format!(
                "{} left out: the line is low there for longer than an octet, as one without bias resistors is between telegrams",
                counted(low, "octet")
            ));
        }
        // After each telegram the line may be low once.
        let whole = runs
            .iter()
            .filter(|run| run.kind == RunKind::Telegram)
            .count();
        let unread =
            of_no_telegram(&runs, |run| run.from.is_none()) + low.saturating_sub(whole + 1);
        if unread > 0 {
            let count = counted(unread, "octet");
            notes.push(format!("{count} could not be read as telegrams"));
        }
        let octets = runs.into_iter();
        let octets =
            octets.flat_map(|run| run.octets.into_iter().map(move |octet| (run.from, octet)));
        Self {
            octets: octets.collect(),
            unread,
            notes,
        }
    }
}

/// Octets of one station.
struct Run {
    from: Option<u8>,
    kind: RunKind,
    octets: Vec<PacketOctet>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RunKind {
    Telegram,
    /// The beginning of a telegram.
    Begun,
    /// A low line between telegrams.
    Low,
    Other,
}

/// Octets of no telegram in runs that `counts` chooses, but for the telegrams that the beginning and the end of a capture cut.
fn of_no_telegram(runs: &[Run], counts: impl Fn(&Run) -> bool) -> usize {
    let is_whole = |run: &Run| run.kind == RunKind::Telegram;
    let first = runs.iter().position(is_whole).unwrap_or(0);
    let count = |runs: &[Run]| -> usize {
        let other = |run: &&Run| matches!(run.kind, RunKind::Begun | RunKind::Other) && counts(run);
        runs.iter().filter(other).map(|run| run.octets.len()).sum()
    };
    let before = count(&runs[..first]);
    let begun = runs
        .last()
        .filter(|run| run.kind == RunKind::Begun && counts(run));
    let cut = begun.map_or(0, |run| run.octets.len());
    let before = if before <= MAX_TELEGRAM { 0 } else { before };
    before + count(&runs[first..]).saturating_sub(cut)
}

/// Whether an octet is what a receiver reads of a line that is low.
fn is_low(byte: u8, error: Option<LineError>) -> bool {
    byte == 0 && matches!(error, Some(LineError::Break | LineError::Framing))
}

/// Telegrams as the times between their octets show them.
fn by_time(octets: &[PacketOctet], octet: Span) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut line = OwedReply::default();
    let mut left = octets;
    while let Some(first) = left.first() {
        // 33 idle bits end a telegram in any case, and 11 a damaged one.
        let all = run(left, octet, SYN_OCTETS);
        let good = all.iter().take_while(|octet| octet.error.is_none());
        let bytes: Vec<u8> = good.filter_map(|octet| octet.received).collect();
        let (from, kind, used) = match Telegram::decode(&bytes) {
            Decoded::Value { value, used } => (line.sender(&value), RunKind::Telegram, used),
            _ if is_low(first.received.unwrap_or(1), first.error) => (None, RunKind::Low, 1),
            Decoded::NeedMore if bytes.len() == left.len() => {
                (line.0.take(), RunKind::Begun, bytes.len())
            }
            _ => (line.0.take(), RunKind::Other, run(left, octet, 1).len()),
        };
        let (taken, rest) = left.split_at(used.clamp(1, left.len()));
        runs.push(Run {
            from,
            kind,
            octets: taken.to_vec(),
        });
        left = rest;
    }
    runs
}

/// Telegrams as their own octets show them, whatever the times between them.
fn joined(octets: &[PacketOctet], octet: Span) -> Vec<Run> {
    let mut cutter = TelegramCutter::new(octet);
    let mut cut = Vec::new();
    for octet in octets {
        cut.extend(cutter.cut(octet.nanos));
        if let Some(byte) = octet.received {
            let error = octet.error;
            cutter.push(octet.nanos, Received { byte, error });
        }
    }
    let last = octets.last().map_or(0, |octet| octet.nanos);
    cut.extend(cutter.cut(last.saturating_add(TelegramCutter::PATIENCE)));
    let packet = |byte: &LineByte| PacketOctet {
        nanos: byte.at.since_start().as_nanos(),
        sent: byte.sent,
        received: byte.received,
        error: byte.error,
    };
    let run = |(from, bytes): (Option<u8>, Vec<LineByte>)| {
        let good = bytes.iter().take_while(|byte| byte.error.is_none());
        let good: Vec<u8> = good.filter_map(|byte| byte.received).collect();
        let kind = match (Telegram::decode(&good), bytes.as_slice()) {
            (Decoded::Value { used, .. }, _) if used == bytes.len() => RunKind::Telegram,
            (_, [first]) if is_low(first.received.unwrap_or(1), first.error) => RunKind::Low,
            (Decoded::NeedMore, _) if good.len() == bytes.len() => RunKind::Begun,
            _ => RunKind::Other,
        };
        let octets = bytes.iter().map(packet).collect();
        Run { from, kind, octets }
    };
    cut.into_iter().map(run).collect()
}

/// Idle octet times before a request (T_SYN).
const SYN_OCTETS: u64 = SYN_BITS.div_ceil(OCTET_BITS);

/// The slave that owes a reply.
#[derive(Clone, Copy, Debug, Default)]
struct OwedReply(Option<u8>);

impl OwedReply {
    /// The sender of the next telegram; `None` for a master.
    fn sender(&mut self, telegram: &Telegram) -> Option<u8> {
        match telegram {
            Telegram::Confirmation => self.0.take(),
            Telegram::Token { .. } => None,
            Telegram::Pdu(pdu) if pdu.fc().is_request() => {
                self.0 = Some(pdu.da()).filter(|address| *address != BROADCAST);
                None
            }
            Telegram::Pdu(pdu) => {
                self.0 = None;
                Some(pdu.sa())
            }
        }
    }
}

/// Cuts what is heard at one place of a line into telegrams while it arrives.
///
/// A port gives octets in portions, some milliseconds late, so the idle times between octets are not known. A telegram ends where its own
/// bytes say so, and its octets count as sent one after the other, the last one when it was read. The idle time that the rules demand is
/// kept before it: 33 bits before a request, 11 bits before a reply.
#[derive(Clone, Debug)]
pub struct TelegramCutter {
    octet: u64,
    asked: OwedReply,
    /// Octets not yet cut, each with the time in nanoseconds at which it was read.
    waiting: Vec<(u64, Received)>,
    /// The end of the last telegram.
    end: u64,
}

impl TelegramCutter {
    /// A silence that ends what is no whole telegram, in nanoseconds: longer than ports wait with what they have.
    const PATIENCE: u64 = 20_000_000;

    /// For a line on which an octet takes this long.
    pub const fn new(octet: Span) -> Self {
        Self {
            octet: octet.as_nanos(),
            asked: OwedReply(None),
            waiting: Vec::new(),
            end: 0,
        }
    }

    /// Takes an octet that was read at this time, in nanoseconds.
    pub fn push(&mut self, nanos: u64, received: Received) {
        self.waiting.push((nanos, received));
    }

    /// What has ended until now, with its sender; `None` is a master.
    pub fn cut(&mut self, now: u64) -> Vec<(Option<u8>, Vec<LineByte>)> {
        let mut found = Vec::new();
        while let Some((sender, request, used)) = self.next(now) {
            let idle = if request { SYN_OCTETS } else { 1 };
            let octets: Vec<_> = self.waiting.drain(..used).collect();
            found.push((sender, self.placed(&octets, idle)));
        }
        found
    }

    /// The sender of the first telegram, whether it begins an exchange, and its number of octets; `None` where it may continue.
    fn next(&mut self, now: u64) -> Option<(Option<u8>, bool, usize)> {
        let (last, _) = self.waiting.last()?;
        let (_, first) = self.waiting.first()?;
        if is_low(first.byte, first.error) {
            return Some((None, false, 1));
        }
        let over = now.saturating_sub(*last) >= Self::PATIENCE;
        match self.decoded(0) {
            Decoded::Value { value, used } => {
                let sender = self.asked.sender(&value);
                return Some((sender, sender.is_none(), used));
            }
            Decoded::NeedMore if self.is_good() && !over => return None,
            _ => {}
        }
        let whole = |place: &usize| {
            let decoded = self.decoded(*place);
            // One octet, or a token, may as well be a part of what is damaged.
            matches!(
                decoded,
                Decoded::Value {
                    value: Telegram::Pdu(_),
                    ..
                }
            )
        };
        let all = self.waiting.len();
        let used = (1..all).find(whole);
        let used = used.or_else(|| (over || all > 2 * MAX_TELEGRAM).then_some(all))?;
        let sender = self.asked.0.take();
        Some((sender, sender.is_none(), used))
    }

    /// The telegram that begins at a place.
    fn decoded(&self, place: usize) -> Decoded<Telegram, Malformed> {
        let octets = self.waiting.iter().skip(place).take(MAX_TELEGRAM);
        let good = octets.map_while(|(_, octet)| octet.error.is_none().then_some(octet.byte));
        Telegram::decode(&good.collect::<Vec<_>>())
    }

    fn is_good(&self) -> bool {
        self.waiting.iter().all(|(_, octet)| octet.error.is_none())
    }

    /// The octets with their times.
    fn placed(&mut self, octets: &[(u64, Received)], idle: u64) -> Vec<LineByte> {
        let count = octets.len() as u64;
        let read = octets.last().map_or(0, |(nanos, _)| *nanos);
        let least = self.end + self.octet * (idle + count);
        self.end = if self.end == 0 { read } else { read.max(least) };
        let placed = octets.iter().zip(1..).map(|((_, received), place)| {
            let nanos = self.end.saturating_sub(self.octet * (count - place));
            let at = Instant::START + Span::from_nanos(nanos);
            LineByte::seen(at, Some(received.byte), Some(received.byte), received.error)
        });
        placed.collect()
    }
}

/// The octets up to a pause of this many octet times, and no more than a telegram has.
fn run(octets: &[PacketOctet], octet: Span, pause: u64) -> &[PacketOctet] {
    // Times are cut off to nanoseconds.
    let longest = (octet * (pause + 1)).as_nanos().saturating_sub(pause + 2);
    let mut pairs = octets.windows(2).take(MAX_TELEGRAM);
    let paused = |two: &[PacketOctet]| two[1].nanos.saturating_sub(two[0].nanos) >= longest;
    let end = pairs.position(paused).map_or(MAX_TELEGRAM, |last| last + 1);
    &octets[..end.min(octets.len())]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn senders(octets: &[PacketOctet], octet: Span) -> Vec<Option<u8>> {
        let read = LineRead::of(octets, octet, false);
        read.octets.into_iter().map(|(from, _)| from).collect()
    }

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

    /// Telegrams that are read at once and in parts are cut where they end, with the idle time that the rules demand between them; what is
    /// damaged ends where the next telegram begins, or after a silence.
    #[test]
    fn telegrams_are_cut_while_they_arrive() {
        let ask: &[u8] = &[0x10, 8, 2, 0x49, 0x53, 0x16];
        let reply: &[u8] = &[0x10, 2, 8, 0x00, 0x0A, 0x16];
        let mut cutter = TelegramCutter::new(OCTET);
        let hear = |cutter: &mut TelegramCutter, nanos: u64, bytes: &[u8]| {
            for byte in bytes {
                cutter.push(nanos, Received::good(*byte));
            }
            let cut = cutter.cut(nanos).into_iter();
            let bytes = |octets: &[LineByte]| -> Vec<u8> {
                octets.iter().filter_map(|octet| octet.received).collect()
            };
            cut.map(|(from, octets)| (from, bytes(&octets), octets[0].at.since_start().as_nanos()))
                .collect::<Vec<_>>()
        };
        // All in one portion.
        let all = hear(&mut cutter, 1_000_000, &[ask, reply, ask, &[0xE5]].concat());
        let (first, octet) = (1_000_000 - 5 * OCTET.as_nanos(), OCTET.as_nanos());
        let expected = [
            (None, ask.to_vec(), first),
            (Some(8), reply.to_vec(), first + 7 * octet),
            (None, ask.to_vec(), first + 16 * octet),
            (Some(8), vec![0xE5], first + 23 * octet),
        ];
        assert_eq!(all, expected);
        // In two portions, 16 ms apart.
        assert_eq!(hear(&mut cutter, 20_000_000, &ask[..3]), []);
        assert_eq!(hear(&mut cutter, 36_000_000, &ask[3..]).len(), 1);
        // An octet is missing: the reply that follows shows where the damage ends.
        let damaged = hear(&mut cutter, 50_000_000, &[&ask[..4], reply].concat());
        let damaged: Vec<_> = damaged.into_iter().map(|(_, bytes, _)| bytes).collect();
        assert_eq!(damaged, [&ask[..4], reply]);
        assert_eq!(hear(&mut cutter, 60_000_000, &ask[..4]), []);
        assert_eq!(hear(&mut cutter, 79_000_000, &[]), []);
        assert_eq!(hear(&mut cutter, 80_000_000, &[]).len(), 1);
        assert_eq!(hear(&mut cutter, 99_000_000, &[0; 600]).len(), 1);
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
