//! From the levels of a line to octets: an asynchronous receiver with 8 data bits.

use super::levels::{LevelChange, Levels, LineLevel};
use super::numbers::SignedTime;
use harness_proto::line::{Format, LineError, Parity};
use std::fmt;
use std::str::FromStr;

/// Thirds of a nanosecond in a second.
const SECOND: i64 = 3_000_000_000;

/// How the levels of a line are decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UartFormat {
    /// Rate, parity and stop bits.
    pub format: Format,
    /// The quiet line is low, as on the RS-232 side of a driver.
    pub inverted: bool,
}

impl FromStr for UartFormat {
    type Err = String;

    /// Reads `38400 8O1` and `38400 8O1 inverted`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is not the format of a line; `38400 8O1`, `9600 8N2 inverted` or `auto` expected"
            )
        };
        let words: Vec<&str> = text.split_whitespace().collect();
        let (rate, bits, inverted) = match words.as_slice() {
            [rate, bits] => (rate, bits, false),
            [rate, bits, "inverted"] => (rate, bits, true),
            _ => return Err(wrong()),
        };
        let rate: u32 = rate.parse().map_err(|_| wrong())?;
        let parity = match bits.get(..2) {
            Some("8N") => Parity::None,
            Some("8O") => Parity::Odd,
            Some("8E") => Parity::Even,
            _ => return Err(wrong()),
        };
        let stop_bits = match &bits[2..] {
            "1" => 1,
            "2" => 2,
            _ => return Err(wrong()),
        };
        if !(50..=50_000_000).contains(&rate) {
            return Err(format!(
                "`{text}`: a rate from 50 to 50000000 bit/s is expected"
            ));
        }
        let format = Format {
            bits_per_second: rate,
            parity,
            stop_bits,
        };
        Ok(Self { format, inverted })
    }
}

impl fmt::Display for UartFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parity = match self.format.parity {
            Parity::None => 'N',
            Parity::Odd => 'O',
            Parity::Even => 'E',
        };
        let (rate, stop) = (self.format.bits_per_second, self.format.stop_bits);
        write!(f, "{rate} 8{parity}{stop}")?;
        f.write_str(if self.inverted { " inverted" } else { "" })
    }
}

/// An octet that was decoded, or that a table has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OctetRead {
    /// When its start bit began.
    pub(super) start: SignedTime,
    pub(super) byte: u8,
    pub(super) error: Option<LineError>,
}

/// The octets of a line, and the most that are wanted.
pub(super) fn decode(levels: &Levels, uart: UartFormat, most: usize) -> Vec<OctetRead> {
    let mut receiver = Receiver {
        changes: levels.changes(),
        place: 0,
        end: levels.end,
    };
    let (idle, active) = match uart.inverted {
        false => (LineLevel::High, LineLevel::Low),
        true => (LineLevel::Low, LineLevel::High),
    };
    let mut octets = Vec::new();
    let mut free = SignedTime::MIN;
    for (index, pair) in receiver.changes.windows(2).enumerate() {
        let starts = pair[0].level == idle && pair[1].level == active && pair[1].at >= free;
        if !starts {
            continue;
        }
        if octets.len() == most {
            break;
        }
        receiver.place = index + 1;
        let start = pair[1].at;
        if let Some((byte, error, sampled)) = receiver.octet(start, uart.format, idle) {
            octets.push(OctetRead { start, byte, error });
            free = sampled;
        }
    }
    octets
}

struct Receiver<'c> {
    changes: &'c [LevelChange],
    place: usize,
    end: Option<SignedTime>,
}

impl Receiver<'_> {
    /// The level at a time; times only grow. `None` where it is not known.
    fn level(&mut self, at: SignedTime) -> Option<LineLevel> {
        while self
            .changes
            .get(self.place + 1)
            .is_some_and(|next| next.at <= at)
        {
            self.place += 1;
        }
        let level = self.changes.get(self.place)?.level;
        let known = self.end.is_none_or(|end| at <= end);
        (known && level != LineLevel::Unknown).then_some(level)
    }

    /// The octet whose start bit begins at `start`: its byte, its error, and when its stop bit was looked at. `None` for a pulse that is no
    /// start bit, and where the line is not known in the middle of it.
    fn octet(
        &mut self,
        start: SignedTime,
        format: Format,
        idle: LineLevel,
    ) -> Option<(u8, Option<LineError>, SignedTime)> {
        let rate = i64::from(format.bits_per_second).max(1);
        // Each bit is looked at in its middle.
        let middle = |bit: i64| start.saturating_add(SECOND * (2 * bit + 1) / (2 * rate));
        if self.level(middle(0))? == idle {
            return None;
        }
        let mut byte = 0;
        for bit in 0..8 {
            let one = self.level(middle(bit + 1))? == idle;
            byte |= u8::from(one) << bit;
        }
        let parity = match format.parity {
            Parity::None => None,
            Parity::Odd | Parity::Even => Some(self.level(middle(9))? == idle),
        };
        let stop = middle(9 + i64::from(parity.is_some()));
        let stopped = self.level(stop)? == idle;
        let odd = |parity: bool| (byte.count_ones() + u32::from(parity)) % 2 == 1;
        let fits = parity.is_none_or(|bit| odd(bit) == (format.parity == Parity::Odd));
        let error = match (stopped, fits) {
            (false, _) if byte == 0 && parity != Some(true) => Some(LineError::Break),
            (false, _) => Some(LineError::Framing),
            (true, false) => Some(LineError::Parity),
            (true, true) => None,
        };
        Some((byte, error, stop))
    }
}

/// How many octets of a line are examined to find its format.
const LOOKED_AT: usize = 20_000;

/// How well a format explains lines.
#[derive(Clone, Copy, Debug)]
struct Score {
    uart: UartFormat,
    octets: usize,
    damaged: usize,
}

impl Score {
    fn of(lines: &[&Levels], uart: UartFormat) -> Self {
        let octets = lines.iter().map(|line| decode(line, uart, LOOKED_AT));
        let (mut all, mut damaged) = (0, 0);
        for line in octets {
            all += line.len();
            damaged += line.iter().filter(|octet| octet.error.is_some()).count();
        }
        Self {
            uart,
            octets: all,
            damaged,
        }
    }

    /// How long its octets take.
    fn time(self) -> u64 {
        self.uart
            .format
            .octet_time()
            .units()
            .saturating_mul(self.octets as u64)
    }

    /// Whether more is damaged than a bad cable does: more than a quarter.
    const fn is_bad(self) -> bool {
        self.damaged * 4 > self.octets
    }

    /// Whether this explains the lines better: a smaller part of the octets is damaged.
    fn beats(self, other: Self) -> bool {
        match (self.octets, other.octets) {
            (0, _) => false,
            (_, 0) => true,
            _ => self.damaged * other.octets < other.damaged * self.octets,
        }
    }
}

impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            uart,
            octets,
            damaged,
        } = self;
        write!(f, "{uart} with {damaged} of {octets} octets damaged")
    }
}

/// Octets from which on a format that damages many of them is refused; fewer are shown, and give no verdict.
const ENOUGH: usize = 100;

/// The time, in thirds of a nanosecond, that lines spent in pulses that `wanted` chooses by their level and their length.
fn spent(lines: &[&Levels], wanted: impl Fn(LineLevel, SignedTime) -> bool) -> (SignedTime, usize) {
    let pulses = lines.iter().flat_map(|line| line.changes().windows(2));
    let pulses = pulses.map(|two| (two[0].level, two[1].at - two[0].at));
    let chosen = pulses.filter(|(level, length)| wanted(*level, *length));
    chosen.fold((0, 0), |(time, count), (_, length)| {
        (SignedTime::saturating_add(time, length), count + 1)
    })
}

/// Whether a line may have this rate: less than a quarter of its pulses are much shorter than a bit. At the next higher rate half of them are.
fn slow_enough(lines: &[&Levels], format: Format) -> bool {
    let bit = SECOND / i64::from(format.bits_per_second).max(1);
    let known = |level| level != LineLevel::Unknown;
    let (_, all) = spent(lines, |level, _| known(level));
    let (_, short) = spent(lines, |level, length| known(level) && length < bit * 7 / 10);
    short * 4 < all.max(1)
}

/// Whether lines are longer low than high where they are quiet for more than an octet; `None` where they never are.
fn quiet_low(lines: &[&Levels], format: Format) -> Option<bool> {
    let octet = format.octet_time().units().cast_signed();
    let [low, high] = [LineLevel::Low, LineLevel::High]
        .map(|quiet| spent(lines, |level, length| level == quiet && length > octet).0);
    (low != high).then_some(low > high)
}

/// The best of some formats and polarities.
fn best(lines: &[&Levels], formats: &[Format], inverted: bool) -> Option<Score> {
    let uart = |format: &Format| UartFormat {
        format: *format,
        inverted,
    };
    let scores = formats.iter().map(|format| Score::of(lines, uart(format)));
    scores.reduce(|best, score| if score.beats(best) { score } else { best })
}

/// Finds rate and polarity of lines among the formats that the bus knows; the parity is the bus's, so that a station with another one shows
/// as damage and is not taken for right. With what is to be told about it.
///
/// # Errors
/// No format explains the lines, in a sentence with the remedy.
pub(super) fn find(lines: &[&Levels], formats: &[Format]) -> Result<(UartFormat, String), String> {
    const REMEDY: &str =
        "give the format, as in `--uart \"38400 8O1\"`, and check which channel is the line";
    let mut formats: Vec<Format> = formats.to_vec();
    formats.retain(|format| slow_enough(lines, *format));
    formats.sort_by_key(|format| format.bits_per_second);
    let Some(slowest) = formats.first() else {
        return Err(format!(
            "the line changes faster than at any rate of the bus; {REMEDY}"
        ));
    };
    // What the quiet line says counts, and the damage where it says nothing or the other polarity is far better.
    let first = quiet_low(lines, *slowest).unwrap_or(false);
    let both = [first, !first].map(|inverted| best(lines, &formats, inverted));
    let [Some(found), Some(other)] = both else {
        return Err(format!("the bus has no format; {REMEDY}"));
    };
    // A line without bias resistors is low where no station sends.
    let covers = other.time().saturating_mul(5) >= found.time().saturating_mul(4);
    let far_better = found.is_bad() && !other.is_bad() && covers;
    let found = if far_better { other } else { found };
    if found.octets == 0 {
        return Err("no octet is on the line: the level never changes as a start bit does; check which channel is the line".to_owned());
    }
    let told = format!("the line is {found}");
    if !found.is_bad() {
        return Ok((found.uart, told));
    }
    let others: Vec<Format> = formats
        .iter()
        .flat_map(|format| {
            [Parity::None, Parity::Odd, Parity::Even].map(|parity| Format { parity, ..*format })
        })
        .collect();
    let other = best(lines, &others, found.uart.inverted);
    if let Some(other) = other.filter(|other| other.damaged * 8 < found.damaged) {
        let told =
            format!("{told}; another format than the bus prescribes explains it better: {other}");
        return Ok((found.uart, told));
    }
    if found.octets < ENOUGH {
        return Ok((found.uart, told));
    }
    Err(format!(
        "no format of the bus fits the line: the best is {found}; {REMEDY}"
    ))
}
