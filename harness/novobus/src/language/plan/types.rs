//! What a plan consists of.

use crate::language::plan::{Plan, PlannedStep};
use crate::language::syntax::{CellPlace, Ending, Influence, Relation, Showing};
use harness_bench::link::{Capability, LinkFault, Moment, PlacedFault};
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::plan::PlannedAction;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::quantity::{Quantity, Tolerance};
use harness_proto::line::Rate;
use harness_proto::nd21::position::Position;
use harness_proto::nd21::units::{self, DriveType, Scale};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::RAM;
use harness_proto::novobus::properties::{BusSetting, Properties};
use harness_proto::time::Span;
use harness_sim::nd21::Nd21Properties;
use harness_sim::novobus::deviation::{Deviation, MasterDeviation};
use harness_sim::novobus::drive::Model;
use std::ops::RangeInclusive;

/// How often the bench looks at cells while it waits for one: a quarter of the cycle of the drive's
/// regulators (ND21 4.1).
pub(crate) const LOOK: Span = Span::from_micros(108);

/// What a bench is before anything is sent: the header of a scenario, settled for rings of given sizes.
#[derive(Clone, Debug)]
pub struct PlannedBench {
    /// The rings; one or two.
    pub rings: Vec<RingSize>,
    /// The smallest and the largest number of drives that each ring can have.
    pub sizes: Vec<(u8, u8)>,
    /// The rate of the line.
    pub rate: Rate,
    /// How the bench's own master breaks the manual, on purpose.
    pub master: Option<&'static MasterDeviation>,
    pub(crate) setups: Vec<PlannedSetup>,
    /// What the scales of each ring's drives depend on.
    pub(crate) units: Vec<Vec<units::DriveUnits>>,
    /// The model of each ring's drives.
    pub(crate) models: Vec<Vec<Model>>,
}

#[derive(Clone, Debug)]
pub(crate) struct PlannedSetup {
    pub(crate) ring: usize,
    pub(crate) drives: RangeInclusive<u8>,
    pub(crate) what: PlannedSetupKind,
}

#[derive(Clone, Debug)]
pub(crate) enum PlannedSetupKind {
    Memory(u16, Vec<u8>),
    Eeprom(u8, Vec<u8>),
    Model(Model),
    Type(DriveType),
    Influence(Influence),
    Word(String, String),
    Time(String, Span),
    Deviates(&'static Deviation),
}

impl PlannedSetupKind {
    /// Sets what the setup says of a drive's properties, if it says anything of them.
    pub(crate) fn apply_to(&self, properties: &mut Properties) {
        // Planning has refused what cannot be set.
        let _known = match self {
            Self::Word(name, word) => properties.set(name, BusSetting::Word(word)),
            Self::Time(name, span) => properties.set(name, BusSetting::Time(*span)),
            _ => Ok(()),
        };
    }

    /// What a rig must have for it.
    pub(crate) fn needs(&self) -> Option<Capability> {
        match self {
            // No command writes ROM or registers (ND21 10.2): only a simulated drive can be given them.
            Self::Memory(address, _) if !RAM.contains(address) => Some(Capability::Simulator),
            Self::Memory(..) => Some(Capability::Memory),
            // What stands in an EEPROM beside the bus, before the drive is switched on.
            Self::Eeprom(..) => Some(Capability::Simulator),
            // A real drive is what it is.
            Self::Word(..) | Self::Time(..) | Self::Deviates(_) => Some(Capability::Simulator),
            Self::Model(_) | Self::Type(_) => None,
            Self::Influence(influence) => Some(influence.needs()),
        }
    }

    /// The same for the drive behind the bus.
    pub(crate) fn apply_to_nd21(&self, properties: &mut Nd21Properties) {
        match self {
            // Planning has refused what cannot be set; the bus's own properties are not found here.
            Self::Word(name, word) => {
                let _own = properties.set(name, BusSetting::Word(word));
            }
            Self::Time(name, span) => {
                let _own = properties.set(name, BusSetting::Time(*span));
            }
            Self::Type(device) => properties.device = *device,
            _ => {}
        }
    }
}

impl Influence {
    /// What a rig must have for it.
    pub(crate) fn needs(&self) -> Capability {
        match self {
            Self::Stimuli(_) => Capability::Simulator,
            Self::Power(_) => Capability::Power,
        }
    }
}

/// A step of this bus, settled.
#[derive(Clone, Debug)]
pub enum RingAct {
    Fault(usize, PlacedFault, Moment),
    Check(PlannedCheck),
    /// A telegram and its answer, and what the number in the answer must be.
    Telegram(usize, Vec<u8>, Vec<Expected>, Option<NumberCheck>),
    /// 17 zeros and the check sequence.
    Recover(usize),
    /// The driver does this of these drives; whether its commands must not run twice, and may end in any way.
    Master(usize, Vec<(u8, PlannedCall)>, bool),
    /// The driver counts this number of drives.
    Count(usize, u8),
    /// Time passes until a check holds, at most this long.
    Until(PlannedDriveCheck, Span),
    /// Something happens to drives from outside the bus.
    Influence(usize, RangeInclusive<u8>, Influence),
    /// Cells are recorded from here on, or no longer.
    Record(PlannedRecord),
}

/// What the number in an answer must be.
#[derive(Clone, Debug)]
pub struct NumberCheck {
    /// Which drive answers.
    pub drive: u8,
    /// Which bytes of the answer it is, the first byte of the cell first.
    pub bytes: Vec<usize>,
    /// What must hold of them.
    pub cell: PlannedCell,
}

/// What must hold of drives, settled.
#[derive(Clone, Debug)]
pub struct PlannedDriveCheck {
    /// In which ring, counted from 0.
    pub ring: usize,
    pub drives: RangeInclusive<u8>,
    pub condition: PlannedCondition,
}

/// What can hold of a drive, settled.
#[derive(Clone, Debug)]
pub enum PlannedCondition {
    /// It is in the error mode, or is not.
    InError(bool),
    /// Its cells hold these bytes.
    Memory(u16, Vec<Expected>),
    /// A cell compares with a value.
    Cell(PlannedCell),
    /// It shows this outside the bus.
    Shows(Showing),
}

/// What must hold of a cell.
#[derive(Clone, Debug)]
pub struct PlannedCell {
    /// Its name as written.
    pub name: String,
    pub address: u16,
    /// How many bytes.
    pub size: usize,
    /// What must hold.
    pub test: CellTest,
}

impl PlannedCell {
    pub(crate) fn new(place: &CellPlace, size: usize, test: CellTest) -> Self {
        Self {
            name: place.name.clone(),
            address: place.address,
            size,
            test,
        }
    }
}

/// What the bytes of a cell can be compared with.
#[derive(Clone, Debug)]
pub enum CellTest {
    /// These bytes.
    Bytes(Vec<Expected>),
    /// The bits of the first are those of the second.
    Masked(Vec<u8>, Vec<u8>),
    /// The bytes as a number, and whether it has a sign.
    Raw(Relation, i64, bool),
    /// A number with a unit.
    Number {
        /// The scale of the bytes.
        scale: Scale,
        /// How it is compared.
        relation: Relation,
        expected: Quantity,
        /// How far it may be off; without one the nearest raw value is meant.
        tolerance: Option<Tolerance>,
    },
}

/// What the driver is to do of one drive.
#[derive(Clone, Debug)]
pub enum PlannedCall {
    /// Process data are exchanged: what it gets, and what it must give.
    Exchange(u16, Vec<Expected>),
    /// A command, and the data that must be read.
    Command(Command, Vec<Expected>),
    /// A byte of the EEPROM, and what it must be.
    ReadEeprom(u8, Expected),
    /// A byte of the EEPROM.
    WriteEeprom(u8, u8),
    /// The parameters into the EEPROM.
    RamToEeprom,
    Reference,
    /// The rotor's present place has this position.
    SetActualValue(u32),
    /// The positioning controller is initialised.
    InitPs,
    /// A target.
    WritePs(Position),
    /// The positioning is started.
    StartPs,
    /// It has come to its end.
    WaitForEnd,
}

/// A cell that is recorded, settled.
#[derive(Clone, Debug)]
pub struct PlannedRecord {
    /// In which ring, counted from 0.
    pub ring: usize,
    pub drives: RangeInclusive<u8>,
    /// Its name as written.
    pub name: String,
    pub address: u16,
    /// How many bytes.
    pub size: usize,
    /// The scale of the bytes, if the manual gives one.
    pub scale: Option<Scale>,
    /// When it is looked at.
    pub looks: PlannedLooks,
    /// Where the cell stands.
    pub span: TextSpan,
}

/// When a recorded cell is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannedLooks {
    Every(Span),
    /// Every [`LOOK`]; what changes is noted.
    Changes,
    /// No longer.
    Off,
}

/// A check, settled.
#[derive(Clone, Debug)]
pub enum PlannedCheck {
    /// The ring spells out this drive, after at most this number of zeros.
    Located(usize, u8, Option<u64>),
    /// It does so after at most this number of zeros.
    Within(u64),
    /// Something holds of drives.
    Drive(PlannedDriveCheck),
    /// A drive's error mode has this cause.
    Error(usize, u8, BusError),
    /// This number of check sequences came back whole.
    Corrected(u64),
    /// The driver has named this link of this ring, as broken or as damaged.
    Named(usize, usize, bool),
    /// The commands of the driver's last job have ended so.
    Ended(Ending),
    /// The bytes that the driver sent into this ring follow the manual.
    RulesKept(usize),
    /// This number of bytes was sent since the last check, in this time (and its tolerance).
    Sent(u64, Option<(Span, Span)>),
    /// This number of bytes was received since the start.
    Received(u64),
}

/// Whether the bench's own master has a part in it.
#[must_use]
pub(crate) fn asks_the_driver(plan: &Plan) -> bool {
    let asks = |step: &PlannedStep| matches!(step.action, PlannedAction::Own(RingAct::Master(..)));
    plan.steps.iter().any(asks)
}

/// The faults on links, by ring and place.
pub(crate) fn fault_links(plan: &Plan) -> impl Iterator<Item = (usize, usize, LinkFault)> + '_ {
    plan.steps.iter().filter_map(|step| match step.action {
        PlannedAction::Own(RingAct::Fault(ring, PlacedFault::Link(link, fault), _)) => {
            Some((ring, link, fault))
        }
        _ => None,
    })
}

/// The links in front of and behind the drives whose error mode must be seen, by ring and place; none where no drive must be seen in it,
/// as a drive that answers is in none.
pub(crate) fn heard_links(plan: &Plan) -> impl Iterator<Item = (usize, usize)> + '_ {
    let wanted = plan.needs.contains(&Capability::Tap);
    let steps = plan.steps.iter().filter(move |_| wanted);
    let acts = steps.filter_map(|step| match &step.action {
        PlannedAction::Own(act) => Some(act),
        _ => None,
    });
    let drives = acts.filter_map(|act| match act {
        RingAct::Check(PlannedCheck::Error(ring, drive, _)) => Some((*ring, *drive..=*drive)),
        RingAct::Check(PlannedCheck::Drive(check)) | RingAct::Until(check, _) => {
            let seen = matches!(check.condition, PlannedCondition::InError(_));
            seen.then(|| (check.ring, check.drives.clone()))
        }
        _ => None,
    });
    drives.flat_map(|(ring, drives)| {
        let size = plan.rings.get(ring).map_or(0, |ring| ring.drives());
        let behind = drives.map(move |drive| usize::from(size.saturating_sub(drive)));
        behind.flat_map(move |place| [(ring, place.saturating_sub(1)), (ring, place)])
    })
}

impl PlannedBench {
    /// The model of drive `drive`.
    #[must_use]
    pub fn model(&self, ring: usize, drive: u8) -> Model {
        let ring = self.models.get(ring);
        let model = ring.and_then(|ring| ring.get(usize::from(drive)));
        model.copied().unwrap_or_default()
    }

    /// What the scales of a drive's cells depend on.
    ///
    /// # Panics
    /// There is no such drive: planning has refused it.
    #[must_use]
    pub fn units(&self, ring: usize, drive: u8) -> units::DriveUnits {
        self.units[ring][usize::from(drive)]
    }

    /// What happens to drives from outside the bus before anything is sent, in order of the lines.
    pub(crate) fn influences(
        &self,
    ) -> impl Iterator<Item = (usize, RangeInclusive<u8>, &Influence)> + '_ {
        self.setups.iter().filter_map(|setup| match &setup.what {
            PlannedSetupKind::Influence(influence) => {
                Some((setup.ring, setup.drives.clone(), influence))
            }
            _ => None,
        })
    }

    /// Cells that drives are to hold before anything is sent, in order of the lines.
    pub(crate) fn memory_setups(
        &self,
    ) -> impl Iterator<Item = (usize, RangeInclusive<u8>, u16, &[u8])> + '_ {
        self.setups.iter().filter_map(|setup| match &setup.what {
            PlannedSetupKind::Memory(address, bytes) => {
                Some((setup.ring, setup.drives.clone(), *address, &bytes[..]))
            }
            _ => None,
        })
    }

    /// A link as a scenario writes it: `98->97`, `2:0->master`.
    #[must_use]
    pub fn link_name(&self, ring: usize, link: usize) -> String {
        let drives = self.rings.get(ring).map_or(0, |ring| ring.drives());
        harness_bench::link::link_name(ring, drives, link)
    }

    /// What drive `drive` is set to hold and how to behave, in order of the lines.
    pub(crate) fn setups_of(
        &self,
        ring: usize,
        drive: u8,
    ) -> impl Iterator<Item = &PlannedSetupKind> + '_ {
        setups_of(&self.setups, ring, drive)
    }
}

pub(crate) fn setups_of(
    setups: &[PlannedSetup],
    ring: usize,
    drive: u8,
) -> impl Iterator<Item = &PlannedSetupKind> + '_ {
    setups
        .iter()
        .filter(move |setup| setup.ring == ring && setup.drives.contains(&drive))
        .map(|setup| &setup.what)
}
