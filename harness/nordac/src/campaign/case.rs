//! One case as a scenario, to be looked at with `drivebench trace` and played with `drivebench run`.

use super::converse::{Conversation, MasterOctets};
use super::{CLASSES, TelegramCampaign, TelegramCase};
use harness_bench::campaign::line::{LineOutcome, header_of_case, time_of_case};
use harness_proto::line::{LineError, Received};
use harness_sim::octet_segment::LineFault;
use std::fmt::Write as _;

/// The scenario: the fault, every telegram that the master sent at its time, and every octet that it received.
pub(super) fn scenario(
    campaign: &TelegramCampaign,
    (case, outcome): (&TelegramCase, &LineOutcome),
    played: &Conversation,
) -> String {
    let drive = format!(
        "source  nordac 3.3\nbus     nordac\nslave 8\nslave 8 ppo {}\nslave 8 parameter 1621 = 2\n",
        campaign.ppo.number()
    );
    let mut text = header_of_case(
        (&campaign.name, &outcome.case),
        &drive,
        &CLASSES[outcome.class],
        &outcome.happened,
    );
    let number = case.placed.number;
    // Writing to a String cannot fail.
    let _infallible = match case.placed.fault {
        LineFault::Octet(own) => writeln!(text, "! byte {number}: {own}\n"),
        LineFault::Telegram(own) => writeln!(text, "! telegram {number}: {own}\n"),
    };
    for said in &played.log {
        let _infallible = match said {
            MasterOctets::Sent(at, octets) => {
                let octets: Vec<_> = octets.iter().map(|own| format!("{own:02X}")).collect();
                writeln!(text, "@{} > {}", time_of_case(*at), octets.join(" "))
            }
            MasterOctets::Received(octets) => writeln!(text, "< {}", received(octets)),
        };
    }
    let _infallible = writeln!(text, "@{} ? quiet", time_of_case(played.end));
    text
}

/// Octets with the places of line errors behind them.
fn received(octets: &[Received]) -> String {
    let bytes: Vec<_> = octets
        .iter()
        .map(|own| format!("{:02X}", own.byte))
        .collect();
    let bad = octets
        .iter()
        .zip(1..)
        .filter_map(|(own, place)| match own.error? {
            LineError::Parity => Some(format!(" bad {place}")),
            _ => Some(format!(" bad {place} stop")),
        });
    bytes.join(" ") + &bad.collect::<String>()
}
