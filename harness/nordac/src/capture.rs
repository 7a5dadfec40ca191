//! A scenario made of a capture: what the master sent is sent again at its time, and what slaves sent is expected.

use super::judge::judge;
use crate::value::hex;
use harness_bench::capture::JudgedFrames;
use harness_bench::capture::runs::rate;
use harness_bench::capture::runs::{TelegramRun, octets, runs};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::LineError;
use harness_proto::nordac::PpoType;
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::Span;
use harness_sim::record::{LineByte, Trace};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// A scenario that replays a capture: what the master sent is sent again at its time, and what slaves sent is expected. `setup` describes
/// the slaves: its lines `slave` and `rate` become the header; without it, slaves are those that sent, with the PPO type that the last
/// Chk_Cfg named and the factory settings.
///
/// # Errors
/// No slave sent anything, in a sentence with the remedy.
pub(crate) fn scenario(
    traces: &[Trace],
    title: &str,
    setup: Option<&Source>,
) -> Result<String, String> {
    let runs: Vec<TelegramRun> = traces.iter().flat_map(runs).collect();
    let rate = traces.iter().find_map(rate);
    let title: String = title.chars().filter(|c| !c.is_control()).collect();
    let mut text = format!("title   {title}\nsource  nordac 3.1\nbus     nordac\n");
    match setup {
        Some(setup) => {
            let header = |line: &&str| line.starts_with("slave ") || line.starts_with("rate ");
            for line in setup.text.lines().filter(header) {
                // Writing to a String cannot fail.
                let _infallible = writeln!(text, "{line}");
            }
        }
        None => {
            if let Some(rate) = rate.filter(|rate| *rate != BusRate::default()) {
                let _infallible = writeln!(text, "rate {}", rate.name());
            }
            for (slave, ppo) in slaves(&runs)? {
                let _infallible = match ppo {
                    Some(ppo) => writeln!(text, "slave {slave} ppo {}", ppo.number()),
                    None => writeln!(text, "slave {slave}"),
                };
            }
        }
    }
    traces.iter().for_each(|trace| faults(trace, &mut text));
    text.push('\n');
    let octet = rate.unwrap_or_default().octet_time();
    runs.iter().for_each(|run| step(run, octet, &mut text));
    Ok(text)
}

/// Judges what slaves sent: a slave is accused only of what no right one does, whatever its history. `named` are the slaves that are
/// judged, where the user names some, and times may be off by `tolerance`.
pub(crate) fn judged(
    traces: &[Trace],
    setup: Option<&Source>,
    (named, tolerance): (&[u8], Span),
) -> Result<JudgedFrames, String> {
    if setup.is_some() {
        return Err(
            "--setup changes nothing where telegrams are judged: a slave is accused only of what no right slave does, whatever its settings; \
             leave it out"
                .to_owned(),
        );
    }
    let mut all = JudgedFrames {
        verdict: Verdict::Passed,
        compared: 0,
        replies: 0,
        differences: Vec::new(),
        remarks: Vec::new(),
    };
    let mut in_doubt = false;
    for trace in traces {
        let judged = judge(trace, named, tolerance);
        all.compared += judged.compared;
        all.replies += judged.replies;
        in_doubt |= !judged.doubts.is_empty() || judged.compared < judged.replies;
        all.remarks.extend(judged.doubts);
        all.remarks.extend(judged.remarks);
        let breaches = judged.breaches.into_iter();
        all.differences.extend(breaches.map(|breach| {
            format!(
                "telegram {}, slave {}: {} (NORDAC {})",
                breach.telegram, breach.slave, breach.about, breach.section
            )
        }));
    }
    all.verdict = match (all.differences.is_empty(), all.compared) {
        (false, _) => Verdict::Failed,
        (true, 0) => Verdict::Inconclusive,
        (true, _) if in_doubt => Verdict::Inconclusive,
        (true, _) => Verdict::Passed,
    };
    Ok(all)
}

/// The slaves that sent, and the PPO type that the last Chk_Cfg to them named.
fn slaves(runs: &[TelegramRun]) -> Result<BTreeMap<u8, Option<PpoType>>, String> {
    let mut slaves: BTreeMap<u8, Option<PpoType>> = runs
        .iter()
        .filter_map(|run| run.from.map(|slave| (slave, None)))
        .collect();
    if slaves.is_empty() {
        return Err(
            "no slave sends anything in it; --setup with `slave` lines expected".to_owned(),
        );
    }
    for run in runs.iter().filter(|run| run.from.is_none()) {
        let Some(Telegram::Pdu(pdu)) = run.said().and_then(|said| said.telegram()) else {
            continue;
        };
        let ppo = PpoType::from_cfg(pdu.data());
        if Service::of(pdu.dsap()) == Some(Service::ChkCfg)
            && let (Some(slave), Some(ppo)) = (slaves.get_mut(&pdu.da()), ppo)
        {
            *slave = Some(ppo);
        }
    }
    Ok(slaves)
}

/// What happened to octets between their sender and the other stations.
fn faults(trace: &Trace, text: &mut String) {
    let mut sent: BTreeMap<Option<u8>, usize> = BTreeMap::new();
    for (from, octet) in octets(trace) {
        if octet.sent.is_none() {
            continue;
        }
        let number = sent.entry(from).or_default();
        *number += 1;
        let Some(fault) = fault(&octet) else {
            continue;
        };
        let sender = from.map_or("master".to_owned(), |slave| format!("slave {slave}"));
        let _infallible = writeln!(text, "! {sender} byte {number}: {fault}");
    }
}

/// The fault that makes an octet arrive as it did; `None` where there is none, or where the language has none.
fn fault(octet: &LineByte) -> Option<String> {
    match (octet.received, octet.error) {
        (None, _) => Some("drop".to_owned()),
        (_, Some(LineError::Parity)) if octet.sent == octet.received => Some("flip p".to_owned()),
        (_, Some(LineError::Framing)) if octet.sent == octet.received => Some("flip s".to_owned()),
        (Some(received), Some(LineError::Parity)) => {
            let bits = octet.sent? ^ received;
            let bits: Vec<_> = (0..8)
                .filter(|bit| bits >> bit & 1 == 1)
                .map(|bit: u8| bit.to_string())
                .collect();
            Some(format!("flip {}", bits.join(" ")))
        }
        (Some(received), None) if octet.sent != octet.received => {
            Some(format!("replace {received:02X}"))
        }
        _ => None,
    }
}

fn step(run: &TelegramRun, octet: Span, text: &mut String) {
    let _infallible = match run.from {
        None => {
            let Some(first) = run.octets.first() else {
                return;
            };
            let sent: Vec<u8> = run.octets.iter().filter_map(|octet| octet.sent).collect();
            let nanos = (first.at - octet).since_start().as_nanos();
            writeln!(
                text,
                "@{}.{:06}ms > {}",
                nanos / 1_000_000,
                nanos % 1_000_000,
                hex(&sent)
            )
        }
        Some(_) => {
            let Some(said) = run.said() else { return };
            let error = said.error.filter(|(_, error)| *error == LineError::Parity);
            let bad = error.map_or(String::new(), |(place, _)| format!(" bad {place}"));
            writeln!(text, "< {}{bad}", hex(&said.octets))
        }
    };
}
