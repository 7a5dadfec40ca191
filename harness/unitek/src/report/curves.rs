//! Registers that a drive has sent several times, as curves against time.

use crate::value::bits;
use harness_bench::html::Html;
use harness_bench::report::chart::{Chart, Curve, HEX, Points};
use harness_proto::unitek::units::{Scaling, usual, value};
use harness_proto::unitek::{Data, Register, Reply};
use harness_sim::record::{FrameEnd, Trace};
use std::collections::BTreeMap;

/// Values from which on a register has a curve.
const LEAST: usize = 5;
/// Curves drawn at most.
const MOST: usize = 20;

/// Writes a curve for each register that a drive has sent at least five times; false where there is none.
pub(crate) fn curves(html: &mut Html, id: &str, trace: &Trace) -> bool {
    let mut found: BTreeMap<(u8, u8), Points> = BTreeMap::new();
    for frame in trace.channels.iter().flat_map(|channel| channel.frames()) {
        let id = u16::try_from(frame.frame.id().number()).unwrap_or(0);
        let good = frame.ended == FrameEnd::Good;
        let Some((drive, Ok(reply))) = frame
            .from
            .filter(|_| good)
            .map(|drive| (drive, Reply::decode(&frame.frame, id)))
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
            Chart {
                id: &format!("{id}-{drive}-{number:02X}"),
                title: &format!("{title} against time"),
                ends: Some(ends),
                curves: &[Curve {
                    name: title.clone(),
                    unit: unit(register).to_owned(),
                    held: true,
                    points: points.clone(),
                    ..Curve::default()
                }],
                ..Chart::default()
            }
            .draw(html);
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

/// The unit of a register's values.
fn unit(register: &Register) -> &'static str {
    match usual(register.unit) {
        Some(unit) => unit.name(),
        None if bits(register.unit).is_empty() => "",
        None => HEX,
    }
}

/// A register's value in [`unit`].
fn number(register: &Register, data: Data) -> Option<f64> {
    let raw = match data {
        Data::Short(value) => register.extend(value),
        Data::Long(value) => value,
    };
    let raw = raw & register.mask();
    let plain = match unit(register) {
        HEX => f64::from(raw),
        _ => register.number_of(raw) as f64,
    };
    let usual_unit = usual(register.unit);
    usual_unit.map_or(Some(plain), |unit| {
        value(register, raw, unit, Scaling::default())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_sign_and_unit() {
        let speed = Register::of(0x30);
        let value = number(speed, Data::Short(0x8001)).expect("a value");
        assert!((value + 100.0).abs() < 0.01, "{value}");
        assert_eq!(unit(speed), "%");
        assert_eq!(unit(Register::of(0x40)), HEX);
    }
}
