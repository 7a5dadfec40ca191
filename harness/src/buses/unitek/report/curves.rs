//! Registers that a drive has sent several times, as curves against time.

use crate::report::html::{Curve, Html};
use harness_proto::unitek::register::Unit;
use harness_proto::unitek::units::{Scaling, shown, usual};
use harness_proto::unitek::{Data, Register, Reply};
use harness_sim::record::{FrameEnd, Trace};
use std::collections::BTreeMap;

/// Values from which on a register has a curve.
const LEAST: usize = 5;
/// Curves drawn at most.
const MOST: usize = 20;

/// Writes a curve for each register that a drive has sent at least five times; false where there is none.
pub(crate) fn curves(html: &mut Html, id: &str, trace: &Trace) -> bool {
    let mut found: BTreeMap<(u8, u8), Vec<(f64, f64)>> = BTreeMap::new();
    for frame in trace.channels.iter().flat_map(|channel| channel.frames()) {
        let own = u16::try_from(frame.frame.id().number()).unwrap_or(0);
        let good = frame.ended == FrameEnd::Good;
        let Some((drive, Ok(reply))) = frame
            .from
            .filter(|_| good)
            .map(|drive| (drive, Reply::decode(&frame.frame, own)))
        else {
            continue;
        };
        let at = frame.at.since_start().as_millis_f64();
        let value = number(Register::of(reply.register), reply.data);
        found
            .entry((drive, reply.register))
            .or_default()
            .push((at, value));
    }
    found.retain(|_, points| points.len() >= LEAST);
    let ends = found.values().flatten().map(|(at, _)| *at);
    let ends = ends.fold((f64::INFINITY, 0.0), |(from, to): (f64, f64), at| {
        (from.min(at), to.max(at))
    });
    for ((drive, number), points) in found.iter().take(MOST) {
        let register = Register::of(*number);
        let title = format!("drive {drive} {number:02X} {}", register.name);
        html.element("figure", &[], |html| {
            html.line("figcaption", &[], &title);
            Curve {
                id: &format!("{id}-{drive}-{number:02X}"),
                title: &format!("{title} against time"),
                along: &|at| format!("{at:.3} ms"),
                upwards: &|value| words(register, value),
                steps: true,
            }
            .draw(html, points, ends);
        });
    }
    if found.len() > MOST {
        let more = found.len() - MOST;
        html.line(
            "p",
            &[("class", &"note")],
            format_args!("{more} more are not drawn."),
        );
    }
    !found.is_empty()
}

fn number(register: &Register, data: Data) -> f64 {
    let raw = match data {
        Data::Short(value) => register.extend(value),
        Data::Long(value) => value,
    };
    let low = i32::try_from(raw & 0xFFFF).unwrap_or(0);
    match register.unit {
        Unit::Ramp => low.into(),
        _ => register.number_of(raw & register.mask()) as f64,
    }
}

/// A value with its unit; a plain number for words of bits.
fn words(register: &Register, value: f64) -> String {
    // A value of the drive is drawn: it has at most 32 bits.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a whole number of at most 32 bits"
    )]
    let raw = (value as i64 & 0xFFFF_FFFF) as u32 & register.mask();
    usual(register.unit)
        .and_then(|unit| shown(register, raw, unit, Scaling::default()))
        .map_or_else(|| format!("{value}"), |shown| shown.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_sign_and_unit() {
        let speed = Register::of(0x30);
        assert!((number(speed, Data::Short(0x8001)) + 32767.0).abs() < 0.5);
        assert_eq!(words(speed, -32767.0), "-100.0%");
        assert_eq!(words(Register::of(0x6D), 65536.0), "1.000 turns");
        assert_eq!(words(Register::of(0xE2), 1.0), "1");
    }
}
