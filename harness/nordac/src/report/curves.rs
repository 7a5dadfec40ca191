//! Setpoint and actual value against time, and the states that a status word shows (3.2, 3.3).

use super::words::Reader;
use harness_bench::capture::runs::said;
use harness_bench::html::Html;
use harness_bench::report::chart::{Chart, Curve};
use harness_proto::nordac::words::{State, stw};
use harness_proto::time::Instant;
use harness_sim::record::Trace;
use std::collections::BTreeMap;

/// Values from which on there is a curve.
const LEAST: usize = 5;
/// States listed at most.
const MOST_STATES: usize = 60;
/// 100 %.
const FULL: f64 = 16384.0;

/// What is known of a slave.
#[derive(Default)]
struct Course {
    /// Setpoints of valid control words, and actual values: time in milliseconds, per cent.
    setpoints: Vec<(f64, f64)>,
    actuals: Vec<(f64, f64)>,
    /// The states in their order.
    states: Vec<(Instant, State)>,
}

/// Writes the curves and the states of each slave; false where there is nothing to draw.
pub(crate) fn curves(html: &mut Html, id: &str, trace: &Trace) -> bool {
    let courses = courses(trace);
    let mut drawn = false;
    for (slave, course) in &courses {
        // The setpoint holds up to the next one; actual values are samples.
        let values = [
            ("HSW", true, &course.setpoints),
            ("HIW", false, &course.actuals),
        ];
        let drawable = values.into_iter().filter(|row| row.2.len() >= LEAST);
        let curves: Vec<_> = drawable
            .map(|(name, held, points)| Curve {
                name: format!("slave {slave} {name}"),
                unit: "%".to_owned(),
                held,
                points: points
                    .iter()
                    .map(|(at, value)| (*at, Some(*value)))
                    .collect(),
                ..Curve::default()
            })
            .collect();
        if !curves.is_empty() {
            drawn = true;
            let title = format!("slave {slave}: setpoint and actual value");
            html.element("figure", &[], |html| {
                html.line("figcaption", &[], &title);
                Chart {
                    id: &format!("{id}-{slave}"),
                    title: &title,
                    curves: &curves,
                    ..Chart::default()
                }
                .draw(html);
            });
        }
        if course.states.len() > 1 {
            drawn = true;
            let shown = course.states.iter().take(MOST_STATES);
            let path: Vec<_> = shown
                .map(|(at, state)| format!("{} ({at})", state.name()))
                .collect();
            let more = course.states.len().saturating_sub(MOST_STATES);
            let more = if more > 0 {
                format!(", {more} more")
            } else {
                String::new()
            };
            let path = path.join(", ");
            html.line(
                "p",
                &[],
                format_args!("States of slave {slave}: {path}{more}."),
            );
        }
    }
    drawn
}

fn courses(trace: &Trace) -> BTreeMap<u8, Course> {
    let mut reader = Reader::default();
    let mut courses: BTreeMap<u8, Course> = BTreeMap::new();
    for said in said(trace) {
        reader.read(&said);
        let Some(exchanged) = reader.exchanged(&said) else {
            continue;
        };
        let course = courses.entry(exchanged.slave).or_default();
        let at = said.at.since_start().as_millis_f64();
        let percent = f64::from(exchanged.image.main().cast_signed()) * 100.0 / FULL;
        if !exchanged.of_slave {
            if exchanged.image.first() & stw::VALID != 0 {
                course.setpoints.push((at, percent));
            }
            continue;
        }
        course.actuals.push((at, percent));
        if let Some(state) = State::of_zsw(exchanged.image.first())
            && course.states.last().is_none_or(|(_, last)| *last != state)
        {
            course.states.push((said.at, state));
        }
    }
    courses
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::time::Span;
    use harness_sim::record::{Channel, LineByte};

    /// A start-up of an inverter with PPO type 3: request and reply in turn.
    #[test]
    fn the_states_of_a_start_up() {
        let telegrams = [
            (None, "680707680802 6D 047E 0000 F9 16"),
            (Some(8), "680707680208 08 0B70 0000 8D 16"),
            (None, "680707680802 5D 047F 2000 0A 16"),
            (Some(8), "680707680208 08 0B31 0000 4E 16"),
            (None, "680707680802 7D 007F 4000 46 16"),
            (Some(8), "680707680208 08 0A37 0003 56 16"),
        ];
        let (mut master, mut slave) = (Vec::new(), Vec::new());
        let mut at = Instant::START;
        for (from, text) in telegrams {
            at += Span::from_micros(66);
            let digits: String = text.split(' ').collect();
            for pair in digits.as_bytes().chunks(2) {
                at += Span::from_micros(22);
                let pair = std::str::from_utf8(pair).expect("digits");
                let byte = Some(u8::from_str_radix(pair, 16).expect("a byte"));
                let octet = LineByte::seen(at, byte, byte, None);
                let octets = if from.is_some() {
                    &mut slave
                } else {
                    &mut master
                };
                octets.push(octet);
            }
        }
        let trace = Trace {
            channels: vec![
                Channel::of_octets(None, None, master),
                Channel::of_octets(Some(8), None, slave),
            ],
            ..Trace::empty(1)
        };
        let courses = courses(&trace);
        let course = &courses[&8];
        let states = course.states.iter().map(|(_, state)| state.short());
        let states: Vec<_> = states.collect();
        assert_eq!(states, ["SD", "RDY", "OE"]);
        // The setpoint of the word that is not valid does not count.
        let setpoints = course.setpoints.iter().map(|(_, value)| *value);
        let setpoints: Vec<_> = setpoints.collect();
        assert_eq!(setpoints, [0.0, 50.0]);
        assert_eq!(course.actuals.len(), 3);
        assert!(curves(&mut Html::new(), "a", &trace));
        assert!(!curves(&mut Html::new(), "a", &Trace::empty(1)));
    }
}
