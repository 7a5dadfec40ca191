//! What drives hold and are before anything is sent, and what their scales depend on.

use super::planner::Planner;
use super::types::{PlannedSetup, PlannedSetupKind, setups_of};
use crate::language::Novobus;
use crate::language::syntax::{
    CellPlace, Check, Condition, DriveCheck, DriveRange, FaultKind, Influence, RingStep, Setup,
    SetupKind, Written,
};
use harness_bench::scenario::language::Settle as _;
use harness_bench::scenario::pattern::MAX_CELLS;
use harness_bench::scenario::problem::{Problem, TextSpan};
use harness_bench::scenario::syntax::{Action, Scenario};
use harness_proto::nd21;
use harness_proto::nd21::units::{self, DriveType, Scale, SpeedRange, Value};
use harness_proto::novobus::memory;
use harness_proto::novobus::properties::{BusSetting, Properties};
use harness_sim::nd21::{Nd21Properties, PROPERTIES};
use harness_sim::novobus::drive::Model;
use std::ops::RangeInclusive;

impl Planner {
    /// Settles what the header says of drives. Bytes and types come first: on them depends what numbers
    /// with a unit are.
    pub(crate) fn set_up(&mut self, setups: &[Setup]) -> Vec<Problem> {
        let mut found = Vec::new();
        let mut planned = Vec::new();
        for numbers in [false, true] {
            for (line, setup) in setups.iter().enumerate() {
                if has_number(setup) == numbers {
                    match self.setup(setup) {
                        Ok(all) => planned.extend(all.into_iter().map(|one| (line, one))),
                        Err(problem) => found.push(problem),
                    }
                }
                if planned.len() > MAX_SETUPS {
                    found.push(Problem::new(
                        setup.span,
                        "too many cells are set in drives of different types and ranges",
                        "fewer drives or cells expected here",
                    ));
                    return found;
                }
            }
            planned.sort_by_key(|(line, _)| *line);
            self.bench.setups = planned.iter().map(|(_, setup)| setup.clone()).collect();
            if !numbers {
                self.bench.units = self.of_each(Self::read_units);
                self.bench.models = self.of_each(Self::read_model);
            }
        }
        found.extend(setups.iter().filter_map(|setup| self.idle(setup)));
        found
    }

    fn setup(&self, setup: &Setup) -> Result<Vec<PlannedSetup>, Problem> {
        let ring = setup.drives.ring;
        let drives = self.drives(&setup.drives)?;
        let what = match &setup.what {
            SetupKind::Memory(place, value) => {
                return self.cells(ring, drives, place, value, |bytes| {
                    in_memory(place, bytes.len())?;
                    Ok(PlannedSetupKind::Memory(place.address, bytes))
                });
            }
            SetupKind::Eeprom(place, value) => {
                return self.cells(ring, drives, place, value, |bytes| {
                    let [_, address] = place.address.to_be_bytes();
                    if usize::from(address) + bytes.len() > 256 {
                        return Err(Problem::new(
                            place.span,
                            "the bytes go beyond the EEPROM",
                            "the EEPROM has the addresses 00 to FF (ND21 14.2.2)",
                        ));
                    }
                    Ok(PlannedSetupKind::Eeprom(address, bytes))
                });
            }
            SetupKind::Model(model) => PlannedSetupKind::Model(*model),
            SetupKind::Type(device) => PlannedSetupKind::Type(*device),
            SetupKind::Influence(influence) => PlannedSetupKind::Influence(influence.clone()),
            SetupKind::Word(name, word) => {
                set_property(&name.value, BusSetting::Word(&word.value), word.span)?;
                PlannedSetupKind::Word(name.value.clone(), word.value.clone())
            }
            SetupKind::Time(name, duration) => {
                let span = duration.on(self.byte_time());
                set_property(&name.value, BusSetting::Time(span), duration.span())?;
                PlannedSetupKind::Time(name.value.clone(), span)
            }
            SetupKind::Deviates(deviation) => PlannedSetupKind::Deviates(deviation),
        };
        Ok(vec![PlannedSetup { ring, drives, what }])
    }

    /// Cells that are set to a value: one setup for all drives that have the same bytes for it.
    fn cells(
        &self,
        ring: usize,
        drives: RangeInclusive<u8>,
        place: &CellPlace,
        value: &Written,
        setup: impl Fn(Vec<u8>) -> Result<PlannedSetupKind, Problem>,
    ) -> Result<Vec<PlannedSetup>, Problem> {
        if let Written::Bytes(pattern) = value {
            let what = setup(pattern.expand_known(self.size(ring), MAX_CELLS)?)?;
            return Ok(vec![PlannedSetup { ring, drives, what }]);
        }
        let mut planned = Vec::new();
        for (units, drives) in self.alike(ring, drives) {
            let what = setup(number_bytes(place.scale(), value, units)?)?;
            planned.push(PlannedSetup { ring, drives, what });
        }
        Ok(planned)
    }

    /// Runs of drives with the same scales.
    pub(crate) fn alike(
        &self,
        ring: usize,
        drives: RangeInclusive<u8>,
    ) -> Vec<(units::DriveUnits, RangeInclusive<u8>)> {
        let mut runs: Vec<(units::DriveUnits, RangeInclusive<u8>)> = Vec::new();
        for drive in drives {
            let units = self.units_of(ring, drive);
            match runs.last_mut() {
                Some((same, run)) if *same == units => *run = *run.start()..=drive,
                _ => runs.push((units, drive..=drive)),
            }
        }
        runs
    }

    /// What a drive's scales depend on.
    pub(crate) fn units_of(&self, ring: usize, drive: u8) -> units::DriveUnits {
        let of_ring = self.units.get(ring);
        let units = of_ring.and_then(|drives| drives.get(usize::from(drive)));
        units.copied().unwrap_or(DEFAULT_UNITS)
    }

    /// What `read` finds for each drive of each ring.
    fn of_each<T>(&self, read: impl Fn(&Self, usize, u8) -> T) -> Vec<Vec<T>> {
        let rings = self.rings.iter().enumerate();
        rings
            .map(|(ring, size)| {
                let drives = 0..size.drives();
                drives.map(|drive| read(self, ring, drive)).collect()
            })
            .collect()
    }

    fn read_model(&self, ring: usize, drive: u8) -> Model {
        let setups = setups_of(&self.setups, ring, drive);
        let models = setups.filter_map(|setup| match setup {
            PlannedSetupKind::Model(model) => Some(*model),
            _ => None,
        });
        models.last().unwrap_or(self.model)
    }

    /// The type and the range of speeds as the header sets them. RAM is set after it has been loaded from
    /// the EEPROM.
    fn read_units(&self, ring: usize, drive: u8) -> units::DriveUnits {
        let mut units = DEFAULT_UNITS;
        let (mut ram, mut eeprom) = (None, None);
        for setup in setups_of(&self.setups, ring, drive) {
            match setup {
                PlannedSetupKind::Type(device) => units.device = *device,
                PlannedSetupKind::Memory(address, bytes) => {
                    let place = nd21::ram::SW_VERSION2.checked_sub(*address);
                    ram = place.and_then(|i| bytes.get(usize::from(i))).or(ram);
                }
                PlannedSetupKind::Eeprom(address, bytes) => {
                    let cell = nd21::eeprom::eeprom_of(nd21::ram::SW_VERSION2);
                    let place = cell.and_then(|cell| cell.checked_sub(*address));
                    eeprom = place.and_then(|i| bytes.get(usize::from(i))).or(eeprom);
                }
                _ => {}
            }
        }
        if let Some(byte) = ram.or(eeprom) {
            units.range = SpeedRange::from_sw_version2(*byte);
        }
        units
    }

    /// The error of a setting that only the nd21 model has, for a drive with another model: it would have no effect.
    fn idle(&self, setup: &Setup) -> Option<Problem> {
        let (what, span) = match &setup.what {
            SetupKind::Time(name, _) | SetupKind::Word(name, _)
                if PROPERTIES.iter().any(|known| known.name == name.value) =>
            {
                (format!("`{}`", name.value), name.span)
            }
            SetupKind::Influence(Influence::Stimuli(_)) => (OUTSIDE.to_owned(), setup.span),
            SetupKind::Deviates(deviation) if deviation.is_behind_the_bus() => {
                (format!("`{}`", deviation.name), setup.span)
            }
            _ => return None,
        };
        self.only_nd21(&setup.drives, &what, span).err()
    }

    /// Refuses settings that only the nd21 model has, for a drive with another model.
    pub(crate) fn only_nd21(
        &self,
        drives: &DriveRange,
        what: &str,
        span: TextSpan,
    ) -> Result<(), Problem> {
        let model = |drive: &u8| {
            let of_ring = self.models.get(drives.ring);
            of_ring.and_then(|models| models.get(usize::from(*drive)))
        };
        let prefix = if drives.ring == 0 { "" } else { "2:" };
        let other = self
            .drives(drives)?
            .find(|drive| model(drive) != Some(&Model::Nd21));
        other.map_or(Ok(()), |drive| {
            let message = format!("drive {prefix}{drive} has no {what}: its model is `plain`");
            let problem = Problem::new(span, message, "a drive of the model nd21 expected here");
            Err(problem.help(format!("add `drive {prefix}{drive} model nd21`")))
        })
    }
}

/// The default model: `nd21` if no line names a model and a line needs a feature that only this model has.
pub(crate) fn model_unless_said(scenario: &Scenario<Novobus>) -> Model {
    let said = |setup: &Setup| matches!(setup.what, SetupKind::Model(_));
    if scenario.header.setups.iter().any(said) {
        return Model::default();
    }
    let set = scenario
        .header
        .setups
        .iter()
        .any(|setup| match &setup.what {
            SetupKind::Influence(Influence::Stimuli(_)) => true,
            SetupKind::Deviates(deviation) => deviation.is_behind_the_bus(),
            SetupKind::Word(name, _) | SetupKind::Time(name, _) => PROPERTIES
                .iter()
                .any(|property| property.name == name.value),
            _ => false,
        });
    let shows = |check: &DriveCheck| matches!(check.condition, Condition::Shows(_));
    let done = scenario.steps.iter().any(|step| match &step.action {
        Action::Own(RingStep::Influence(_, Influence::Stimuli(_))) => true,
        Action::Own(RingStep::Check(Check::Drive(check)) | RingStep::Until(check, _)) => {
            shows(check)
        }
        Action::Own(RingStep::Fault(fault)) => matches!(fault.what, FaultKind::Error(..)),
        _ => false,
    });
    if set || done {
        Model::Nd21
    } else {
        Model::default()
    }
}

/// Maximum number of settings of the header: drives with different scales have separate ones.
const MAX_SETUPS: usize = 100_000;

/// What a plain drive has not got.
pub(crate) const OUTSIDE: &str = "plugs, motor and display";

/// The units of a drive without settings in the header (LANGUAGE.md, "Types and ranges").
const DEFAULT_UNITS: units::DriveUnits = units::DriveUnits {
    device: DriveType::Nd5610,
    range: SpeedRange::To8000,
};

fn has_number(setup: &Setup) -> bool {
    matches!(
        &setup.what,
        SetupKind::Memory(_, Written::Number(_) | Written::Off(_))
            | SetupKind::Eeprom(_, Written::Number(_) | Written::Off(_))
    )
}

/// The bytes of a number with a unit.
pub(crate) fn number_bytes(
    scale: Option<Scale>,
    value: &Written,
    units: units::DriveUnits,
) -> Result<Vec<u8>, Problem> {
    let (value, span) = match value {
        Written::Number(number) => (Value::Exact(number.value), number.span),
        Written::Off(span) => (Value::Off, *span),
        Written::Bytes(pattern) => (Value::Off, pattern.span),
    };
    let expected = "a number that the cell can hold expected here";
    let encoded = scale.and_then(|scale| Some((scale.encode(value, units)?, scale.size())));
    match encoded {
        Some((Ok(raw), size)) => {
            let bytes = raw.to_be_bytes();
            Ok(bytes[bytes.len() - usize::from(size)..].to_vec())
        }
        Some((Err(error), _)) => Err(Problem::new(span, error.to_string(), expected)),
        None => Err(Problem::new(span, "the cell cannot hold this", expected)),
    }
}

pub(crate) fn in_memory(place: &CellPlace, length: usize) -> Result<(), Problem> {
    let last = usize::from(place.address) + length.max(1) - 1;
    let inside = |range: &RangeInclusive<u16>| {
        range.contains(&place.address) && last <= usize::from(*range.end())
    };
    if [memory::ROM_WORDS, memory::RAM_AND_REGISTERS]
        .iter()
        .any(inside)
    {
        return Ok(());
    }
    Err(Problem::new(
        place.span,
        format!("a drive has no memory at {last:04X}"),
        "ROM 2F00-2FDF, RAM FD80-FF7F or registers FF80-FFFF (ND21 10.1) expected here",
    ))
}

fn set_property(name: &str, setting: BusSetting<'_>, span: TextSpan) -> Result<(), Problem> {
    if let Some(property) = PROPERTIES.iter().find(|property| property.name == name) {
        if property.set(&mut Nd21Properties::default(), setting) {
            return Ok(());
        }
        let message = format!("`{name}` cannot be set to this");
        let expected = format!("{} expected here", property.values());
        return Err(Problem::new(span, message, expected));
    }
    Properties::default().set(name, setting).map_err(|error| {
        Problem::new(
            span,
            format!("`{name}` cannot be set to this"),
            error.to_string(),
        )
    })
}
