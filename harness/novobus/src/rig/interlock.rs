//! Interlocks: what must hold of drives throughout a run, asked over the bus while nothing else is under way.

use super::condition::InterlockCondition;
use crate::language::run::over_bus::read_byte;
use crate::language::scale::shown;
use crate::rig::condition;
use crate::rig::sim::RigOfRings;
use harness_bench::guard::Watch;
use harness_bench::link::{Line, Trouble};
use harness_bench::rig::file::Level;
use harness_bench::rig::{Rig, file};
use harness_proto::nd21::cells::Cell;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{DriveUnits, SpeedRange, Value};
use harness_proto::time::{Instant, Span};

/// The interlocks of a rig, and when each is looked at next.
#[derive(Debug)]
pub(crate) struct Interlocks {
    all: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    ring: usize,
    drive: u8,
    /// How many drives the ring has.
    drives: u8,
    condition: InterlockCondition,
    every: Span,
    /// On a clock that is never set back.
    next: Instant,
    message: Option<String>,
    /// What the scale of the cell depends on: the type of the device.
    units: DriveUnits,
    /// And the range of speeds, for which the drive is asked once (14.3.2).
    range: Option<SpeedRange>,
}

impl Interlocks {
    /// Those of a rig; `None` where it has none.
    pub(crate) fn of(rig: &Rig) -> Option<Self> {
        let plan = rig.plan().ok()?;
        let entry = |entry: &file::Interlock| {
            let ring = usize::from(entry.ring.checked_sub(1)?);
            let every = u64::try_from(entry.every.0.as_nanos()).unwrap_or(u64::MAX);
            Some(Entry {
                ring,
                drive: entry.drive,
                drives: plan.rings.get(ring)?.drives(),
                condition: condition(entry)?,
                every: Span::from_nanos(every),
                next: Instant::START,
                message: entry.message.clone(),
                units: plan.units(ring, entry.drive),
                range: None,
            })
        };
        let all: Vec<_> = rig.file.interlock.iter().filter_map(entry).collect();
        (!all.is_empty()).then_some(Self { all })
    }
}

impl Watch for Interlocks {
    fn due(&self) -> Option<Instant> {
        self.all.iter().map(|entry| entry.next).min()
    }

    fn look(&mut self, now: Instant, line: &mut dyn Line) -> Result<(), String> {
        for entry in self.all.iter_mut().filter(|entry| entry.next <= now) {
            entry.next = now + entry.every;
            // In the middle of a scenario a drive may be silent on purpose; between scenarios it must answer.
            entry.look(line)?;
        }
        Ok(())
    }

    fn look_at_all(&mut self, line: &mut dyn Line) -> Result<(), Trouble> {
        for entry in &mut self.all {
            if entry.look(line).map_err(Trouble::Interlock)?.is_none() {
                return Err(Trouble::Interlock(format!(
                    "{}: the drive does not answer, so its state is not known",
                    entry.words()
                )));
            }
        }
        Ok(())
    }
}

impl Entry {
    fn words(&self) -> String {
        let ring = if self.ring == 0 { "" } else { "2:" };
        let what = match self.condition {
            InterlockCondition::Cell { cell, .. } => cell.printed,
            InterlockCondition::Input { input, .. } => input.name(),
        };
        let message = self.message.as_ref();
        let message = message.map_or(String::new(), |message| format!(" ({message})"));
        format!("interlock on {what} of drive {ring}{}{message}", self.drive)
    }

    /// Looks at it; `None` where the drive does not answer.
    ///
    /// # Errors
    /// It does not hold, in a sentence.
    fn look(&mut self, line: &mut dyn Line) -> Result<Option<()>, String> {
        let found = match self.condition {
            InterlockCondition::Cell { cell, min, max } => {
                self.look_at_cell(line, cell, (min, max))
            }
            InterlockCondition::Input { input, level } => self.look_at_input(line, input, level),
        };
        match found {
            Some(Ok(())) => Ok(Some(())),
            Some(Err(why)) => Err(format!("{}: {why}", self.words())),
            None => Ok(None),
        }
    }

    fn read(&self, line: &mut dyn Line, address: u16) -> Option<u8> {
        read_byte(line, self.drives, (self.ring, self.drive), address)
    }

    /// Whether the value of a cell is within its bounds; `None` where the drive does not answer.
    fn look_at_cell(
        &mut self,
        line: &mut dyn Line,
        cell: &Cell,
        (min, max): (Option<f64>, Option<f64>),
    ) -> Option<Result<(), String>> {
        if self.range.is_none() {
            let byte = self.read(line, ram::SW_VERSION2)?;
            self.range = Some(SpeedRange::from_sw_version2(byte));
        }
        let units = DriveUnits {
            range: self.range?,
            ..self.units
        };
        let addresses = (cell.address..=u16::MAX).take(usize::from(cell.size));
        let bytes: Vec<u8> = addresses
            .map(|address| self.read(line, address))
            .collect::<Option<_>>()?;
        let number = |value| match value {
            Value::Exact(number) => Some(number.to_f64()),
            Value::Approximate(number) => Some(number),
            _ => None,
        };
        let (value, words) = match cell.scale {
            Some(scale) => match scale.value(&bytes, units) {
                Some(Ok(value)) => (number(value), shown(value, scale)),
                // What has no meaning is within no bounds.
                _ => (None, format!("{bytes:02X?}, which has no meaning,")),
            },
            None => {
                let number = bytes
                    .iter()
                    .fold(0_u32, |n, byte| n << 8 | u32::from(*byte));
                (Some(f64::from(number)), number.to_string())
            }
        };
        let within = value.is_some_and(|value| {
            min.is_none_or(|min| min <= value) && max.is_none_or(|max| value <= max)
        });
        if within {
            return Some(Ok(()));
        }
        let bounds = [("at least", min), ("at most", max)]
            .into_iter()
            .filter_map(|(name, bound)| Some(format!("{name} {}", bound?)));
        let bounds: Vec<_> = bounds.collect();
        Some(Err(format!(
            "{words} was read, {} is required",
            bounds.join(" and ")
        )))
    }

    /// Whether an input is at its level (14.7.1); `None` where the drive does not answer.
    fn look_at_input(
        &self,
        line: &mut dyn Line,
        input: Input,
        level: Level,
    ) -> Option<Result<(), String>> {
        let byte = self.read(line, input.port())?;
        let name = |high: bool| if high { "high" } else { "low" };
        let wanted = level == Level::High;
        Some(match input.level_in(byte) {
            Some(high) if high == wanted => Ok(()),
            Some(high) => Err(format!(
                "it is {}, {} is required",
                name(high),
                name(wanted)
            )),
            None => Err(format!(
                "{byte:02X} in its place is the code of an internal error"
            )),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::read::RingScenario;
    use crate::rig::parse;
    use crate::simulate::bench;
    use harness_bench::link::{DriveFault, Link as _, Moment, PlacedFault};
    use harness_bench::scenario::source::Source;

    fn source(text: &str) -> Source {
        Source {
            name: "desk".to_owned(),
            text: text.to_owned().into(),
        }
    }

    #[test]
    fn the_conditions_of_the_example() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../rigs/examples/serial.toml"
        );
        let text = std::fs::read_to_string(path).expect("an example");
        let rig = parse(&source(&text)).expect("a rig");
        let conditions = rig.file.interlock.iter();
        let conditions: Vec<_> = conditions
            .map(|interlock| condition(interlock).expect("checked"))
            .collect();
        let [first, second] = &conditions[..] else {
            panic!("two of them: {conditions:?}");
        };
        let InterlockCondition::Cell {
            min: None,
            max: Some(max),
            ..
        } = first
        else {
            panic!("{first:?}");
        };
        assert!((max - 75.0).abs() < 1e-9, "{max}");
        let is_high = matches!(
            second,
            InterlockCondition::Input {
                level: Level::High,
                ..
            }
        );
        assert!(is_high, "{second:?}");
    }

    /// A drive may be silent on purpose while a scenario is played. Between scenarios one that does not answer is not known to be safe.
    #[test]
    fn a_silent_drive_trips_between_scenarios_only() {
        let rig = source(
            "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = 2\ntransport = \"tcp\"\nport = \"127.0.0.1:1\"\nmarks = \"in-band\"\n\
             [[interlock]]\ndrive = 1\ncell = \"nist\"\nmin = \"-300rpm\"\nmax = \"300rpm\"\n",
        );
        let mut interlocks = Interlocks::of(&parse(&rig).expect("a rig")).expect("one of them");
        let ring = "title x\nring 2\ndrive 0..last model nd21\n> 80\n";
        let plan = RingScenario::new(source(ring), None)
            .expect("no mistakes")
            .plan;
        let mut link = bench(&plan);
        assert_eq!(interlocks.look_at_all(&mut link), Ok(()));
        link.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
        assert_eq!(interlocks.look(link.now(), &mut link), Ok(()));
        let why =
            "interlock on nist of drive 1: the drive does not answer, so its state is not known";
        let trips = Err(Trouble::Interlock(why.to_owned()));
        assert_eq!(interlocks.look_at_all(&mut link), trips);
    }
}
