//! How drives of rings, and what a ring carries, are shown by the live view.

use crate::driver::Axis;
use harness_bench::top::{HeadLine, TopColumn, TopForm, TopRow};
use harness_proto::nd21::State;
use harness_proto::nd21::bits::set_in;
use harness_proto::nd21::errors::display_digits;
use harness_proto::nd21::ram;
use harness_proto::novobus::master::Counters;
use harness_proto::time::Span;

/// The table of drives. The units are those of the drive's cells (ND21 14.5), the states those of 11.8.
pub(crate) static FORM: TopForm = TopForm {
    drive: "drive",
    columns: &[
        TopColumn::numbers("drive", 5),
        TopColumn::words("state", 5),
        TopColumn::numbers("shows", 5),
        TopColumn::numbers("speed rpm", 9),
        TopColumn::numbers("pos. turns", 10),
        TopColumn::numbers("Aeff", 6),
        TopColumn::words("error, status", 0),
    ],
    give_way: &[5, 4, 3, 2],
    states: &["error", "reset", "block", "stop", "go"],
};

/// What a drive showed last.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DriveReading {
    pub axis: Axis,
    /// Its mode and error (ND21 11.8, 14.4).
    pub state: State,
    /// `nist` in rpm (14.5.3.1).
    pub speed: Option<f64>,
    /// `umdrist` and `lageist` in turns (14.5.5).
    pub position: Option<f64>,
    /// `msoll` in Aeff (14.5.2).
    pub torque: Option<f64>,
}

/// What a ring carried since the reading began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct RingReading {
    /// What its master has done.
    pub counters: Counters,
    /// Bytes a second.
    pub bytes: u64,
    /// Telegrams a second.
    pub telegrams: u64,
    /// Commands a second.
    pub jobs: u64,
    /// How much of what was sent was not SYNCO, in parts of a thousand.
    pub share: u64,
}

impl RingReading {
    /// The figures between two moments.
    #[must_use]
    pub(crate) fn between(before: &Counters, now: &Counters, span: Span) -> Self {
        let nanos = u128::from(span.as_nanos().max(1));
        let rate = |before: u64, now: u64| {
            let count = u128::from(now.saturating_sub(before));
            u64::try_from((count * 1_000_000_000 + nanos / 2) / nanos).unwrap_or(u64::MAX)
        };
        let sent = now.sent.saturating_sub(before.sent);
        let idle = now.idle.saturating_sub(before.idle);
        Self {
            counters: *now,
            bytes: rate(before.sent, now.sent),
            telegrams: rate(before.telegrams, now.telegrams),
            jobs: rate(before.done, now.done),
            share: sent.saturating_sub(idle).saturating_mul(1_000) / sent.max(1),
        }
    }

    /// The lines above the table.
    #[must_use]
    pub(crate) fn lines(&self) -> Vec<HeadLine> {
        let counters = &self.counters;
        vec![
            HeadLine::plain(format!(
                "  {} bytes/s, {} telegrams/s, {} commands/s; the line is {}.{} % busy",
                self.bytes,
                self.telegrams,
                self.jobs,
                self.share / 10,
                self.share % 10
            )),
            HeadLine {
                text: format!(
                    "  line errors {}, disturbed {}, corrected {}, commands repeated {}",
                    counters.line_errors, counters.disturbed, counters.corrected, counters.repeated
                ),
                is_error: counters.line_errors > 0 || counters.disturbed > 0,
            },
        ]
    }
}

impl DriveReading {
    /// Its row in the table.
    #[must_use]
    pub(crate) fn row(&self) -> TopRow {
        let state = &self.state;
        let mode = state.mode();
        // The display shows the code in the error mode only (11.8).
        let digits = display_digits(state.error).filter(|_| mode == "error");
        let digit = |digit: u8| char::from_digit(digit.into(), 16).unwrap_or('-');
        let display = digits.map_or_else(
            || "-".to_owned(),
            |digits| digits.map(digit).iter().collect(),
        );
        let error = state.error_in_words();
        let bits = set_in(ram::STATUS, state.status)
            .chain(set_in(ram::FLAGS, state.flags))
            .chain(set_in(ram::FLAGS2, state.flags2));
        let sentence = |error: &String| error.trim_end_matches('.').to_owned();
        let mut words: Vec<String> = error.iter().map(sentence).collect();
        for name in bits.filter(|name| *name != mode && !EVERYDAY.contains(name)) {
            if !words.iter().any(|word| word == name) {
                words.push(name.to_owned());
            }
        }
        if words.is_empty() {
            words.push("-".to_owned());
        }
        TopRow {
            state: FORM.state(mode),
            speed: self.speed,
            error: Some(u32::from(state.error)).filter(|code| *code != 0),
            in_error: mode == "error" || error.is_some(),
            cells: vec![
                self.axis.to_string(),
                mode.to_owned(),
                display,
                number(self.speed, 1),
                number(self.position, 3),
                number(self.torque, 2),
                words.join("; "),
            ],
        }
    }
}

/// Formats a number with this number of decimals; zero has no sign.
fn number(value: Option<f64>, decimals: usize) -> String {
    let Some(value) = value else {
        return "-".to_owned();
    };
    let text = format!("{value:.decimals$}");
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    match text.strip_prefix('-').filter(|_| is_zero) {
        Some(zero) => zero.to_owned(),
        None => text,
    }
}

/// Bits of a drive that is as it should be.
const EVERYDAY: [&str; 2] = ["NOVOBUS OK", "resolver switch"];
