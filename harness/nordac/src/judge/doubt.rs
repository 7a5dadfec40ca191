//! Telegrams of which a capture does not show who has sent them: only the octets of a telegram name its sender.

use harness_bench::capture::runs::{TelegramRun, octet_time};
use harness_proto::decode::Decoded;
use harness_proto::profibus::Telegram;
use harness_proto::profibus::rate::{OCTET_BITS, SYN_BITS};
use harness_proto::time::Span;
use std::collections::BTreeSet;

/// Who has sent a telegram that seems to be of a slave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ReplySender {
    /// The slave.
    #[default]
    Known,
    /// It carries the address of a station that sends requests.
    Master,
    /// It begins sooner after a request than any slave replies (T_SDR, 11 bits).
    NoPauseBefore,
    /// A request follows it sooner than any master begins one (T_SYN, 33 bits).
    NoPauseBehind,
    /// It is a short confirmation, which names no station, and another one sends such octets in this capture.
    Nobody,
}

impl ReplySender {
    /// The senders of telegrams that are in order of time.
    pub(super) fn of_all(runs: &[TelegramRun]) -> Vec<Self> {
        let octets = runs
            .iter()
            .flat_map(|run| run.octets.iter().map(|octet| (run.from, octet)));
        let octet = octet_time(octets).unwrap_or(Span::ZERO);
        let masters: BTreeSet<u8> = runs.iter().filter_map(master).collect();
        let mut strays = runs.iter().any(begins_with_confirmation);
        let mut all = Vec::with_capacity(runs.len());
        for (place, run) in runs.iter().enumerate() {
            let before = place.checked_sub(1).and_then(|place| runs.get(place));
            let sender = Self::of(run, before, runs.get(place + 1), octet, &masters);
            let confirms = is_confirmation(run);
            strays |= confirms && sender != Self::Known;
            all.push(match sender {
                Self::Known if confirms && strays => Self::Nobody,
                sender => sender,
            });
        }
        all
    }

    fn of(
        run: &TelegramRun,
        before: Option<&TelegramRun>,
        behind: Option<&TelegramRun>,
        octet: Span,
        masters: &BTreeSet<u8>,
    ) -> Self {
        // A short confirmation names nobody, also where a capture begins with one.
        if run.from.is_none() && !is_confirmation(run) {
            return Self::Known;
        }
        // The distance of two ends, in halves of an octet time.
        let nearer = |left: &TelegramRun, right: &TelegramRun, halves: u64| {
            let begin = right.octets.first().map(|octet| octet.at);
            begin.is_some_and(|at| at.since(left.at()).units() * 2 < octet.units() * halves)
        };
        // An octet and its idle time, less half an octet for clocks and for times that are cut off.
        let syn = 2 * (1 + SYN_BITS.div_ceil(OCTET_BITS)) - 1;
        let of_master = |run: &&TelegramRun| run.from.is_none();
        if run.from.is_some_and(|from| masters.contains(&from)) {
            Self::Master
        } else if before
            .filter(of_master)
            .is_some_and(|run_before| nearer(run_before, run, 3))
        {
            Self::NoPauseBefore
        } else if behind
            .filter(of_master)
            .is_some_and(|run_behind| nearer(run, run_behind, syn))
        {
            Self::NoPauseBehind
        } else {
            Self::Known
        }
    }

    /// Why what differs does not accuse the slave; `None` where it does.
    pub(super) const fn doubt(self) -> Option<&'static str> {
        match self {
            Self::Known => None,
            Self::Master => Some("a master has this address, and may have sent it"),
            Self::NoPauseBefore => Some(
                "it begins less than 11 bits behind the request, so the octets may be those of the master",
            ),
            Self::NoPauseBehind => Some(
                "a request follows less than 33 bits behind it, so the octets may be those of the master",
            ),
            Self::Nobody => Some(
                "a short confirmation names no station, and a master sends such octets in this capture",
            ),
        }
    }
}

/// The station that sends a request.
fn master(run: &TelegramRun) -> Option<u8> {
    let telegram = run.said().filter(|said| said.from.is_none())?.telegram()?;
    let request = telegram.pdu().filter(|request| request.fc().is_request())?;
    Some(request.sa())
}

fn is_confirmation(run: &TelegramRun) -> bool {
    let said = run.said();
    said.is_some_and(|said| said.telegram() == Some(Telegram::Confirmation))
}

/// Whether more octets of a master follow a short confirmation without a pause.
fn begins_with_confirmation(run: &TelegramRun) -> bool {
    let said = run
        .said()
        .filter(|said| said.from.is_none() && said.octets.len() > 1);
    let first = said.map(|said| Telegram::decode(&said.octets));
    matches!(
        first,
        Some(Decoded::Value {
            value: Telegram::Confirmation,
            ..
        })
    )
}
