//! One case as a scenario, to be looked at with `drivebench trace` and played with `drivebench run`.

use super::converse::MasterFrame;
use super::{CLASSES, FrameCampaign, FrameClass, FrameOutcome};
use crate::language::written;
use harness_bench::campaign::line::{header_of_case, time_of_case};
use harness_proto::unitek::{Register, Width};
use std::fmt::Write as _;

/// The scenario: the fault, every frame that the master sent at its time, and every frame that it received. What the drive holds
/// unnoticed stands at its end.
pub(super) fn scenario(campaign: &FrameCampaign, outcome: &FrameOutcome) -> String {
    let played = &outcome.conversation;
    let mut text = header_of_case(
        (&campaign.name, &outcome.case.to_string()),
        "source  unitek 5.2\nbus     unitek\ndrive 1\n",
        &CLASSES[outcome.class as usize],
        &outcome.happened(),
    );
    let case = outcome.case;
    // Writing to a String cannot fail.
    let _infallible = writeln!(text, "! frame {}: {}\n", case.frame, case.fault);
    for said in &played.log {
        let _infallible = match said {
            MasterFrame::Sent(at, frame) => {
                writeln!(text, "@{} > {}", time_of_case(*at), written(frame))
            }
            MasterFrame::Received(frame) => writeln!(text, "< {}", written(frame)),
        };
    }
    let _infallible = writeln!(text, "@{} ? quiet", time_of_case(played.end));
    if outcome.class == FrameClass::Unnoticed
        && let (Some(own), Some(sound)) = (&played.state, &campaign.sound.state)
    {
        for (number, raw) in own.differing(sound) {
            let width = match Register::of(number).width {
                Width::Bits16 => 4,
                Width::Bits32 => 8,
            };
            let _infallible = writeln!(text, "? drive 1 register {number:02X} = {raw:0width$X}");
        }
    }
    text
}
