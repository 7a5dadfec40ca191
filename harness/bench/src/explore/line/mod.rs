//! Exploring drives that share one line: what fuzz runs on such buses have in common.
//!
//! A bus implements [`LineBus`]: what can happen in a conversation, how it is played on simulated drives, and how two pieces of what they sent
//! differ. Conversations, their generator, the oracle, the target of simulated drives and the scenario of a finding are made of that here.
//! The open points of a manual do not accuse a drive: a conversation differs only if no values of them explain it.

pub mod fuzz_case;
pub mod generate;
pub mod on_sim;
pub mod oracle;
pub mod rig;
pub mod setup;
pub mod talk;
#[cfg(any(test, feature = "trials"))]
pub mod trial;

pub use fuzz_case::NoAttempt;
pub use generate::LineScope;
pub(crate) use on_sim::OnLine;
pub use rig::{LineRig, ONLY_SIMULATED, pass};
pub(crate) use rig::{OnAdapter, SessionOf};
pub use setup::LineSetup;
pub use talk::{ActBounds, LineAct, LineSeen, LineTalk, Seen};

use crate::bus_name::BusName;
use crate::explore::{Dice, Differing, Spiced};
use crate::manual::Manual;
use crate::rig::Rig;
use crate::scenario::language::Language;
use crate::scenario::problem::Problems;
use crate::scenario::source::Source;
use crate::shown::SegmentReport;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;

/// A bus whose drives share one line, as fuzz runs explore it.
pub trait LineBus: Copy + Debug + PartialEq + Eq + 'static {
    const BUS: BusName;
    const MANUAL: Manual;
    /// How what the line carries is shown.
    const REPORT: &'static dyn SegmentReport;
    /// The section whose table the scenario of a finding covers where the section of the finding has none.
    const USUAL_SECTION: &'static str;
    /// What its drives are called, with the name of their kind.
    const DRIVES: &'static str;
    /// The word with which a header line names a drive.
    const DRIVE: &'static str;
    /// How long conversations may be.
    const BOUNDS: ActBounds;
    /// Of these spices a round has at least one; the first one if chance takes none.
    const NEEDED: &'static [Self::Spice];

    /// Its language.
    type Words: Language;
    /// What can happen in a conversation.
    type What: Clone + Debug + PartialEq + Eq + Serialize + DeserializeOwned;
    /// Something that a conversation can have.
    type Spice: Spiced;
    /// A drive as conversations address it.
    type Station: Copy + Debug + PartialEq + Eq;
    /// Simulated drives.
    type Setup: Clone + Debug;
    /// What the manual leaves open of one drive.
    type Properties: Copy + Debug + PartialEq;
    /// A piece of what the drives sent.
    type Said: Clone + Debug + PartialEq + Eq;
    /// An act that has happened.
    type Done: Clone + Debug + PartialEq + Eq;
    /// The first mismatch with the expected behaviour.
    type Difference: Differing;

    /// Whether an act is within the bounds of its kind.
    fn fits(what: &Self::What) -> bool;
    /// Whether an act sends something.
    fn sends(what: &Self::What) -> bool;
    /// How much an act holds: small conversations have little.
    fn weight(what: &Self::What) -> u64;
    /// Acts that may show the same, the smallest first.
    fn simpler(what: &Self::What) -> Vec<Self::What>;

    /// How a conversation begins, and how many parts follow.
    fn begin(station: Self::Station, dice: &mut Dice) -> (Vec<LineAct<Self::What>>, usize);
    /// Acts that only together show what a drive does; none where the spice has no such acts.
    fn idiom(
        spice: Self::Spice,
        station: Self::Station,
        dice: &mut Dice,
    ) -> Vec<LineAct<Self::What>>;
    /// A part of a conversation with a spice.
    fn part(
        spice: Self::Spice,
        station: Self::Station,
        dice: &mut Dice,
    ) -> Vec<LineAct<Self::What>>;
    /// What asks at the end of a conversation for the state of its drives; `stations` are all of them. At most eight acts.
    fn close(
        acts: &[LineAct<Self::What>],
        stations: (Self::Station, &[Self::Station]),
        dice: &mut Dice,
    ) -> Vec<LineAct<Self::What>>;
    /// The time after an act, in microseconds.
    fn wait(dice: &mut Dice) -> u64;
    /// Changes a part of an act.
    fn change(what: &mut Self::What, dice: &mut Dice);

    /// Header lines of the drives of a rig, which conversations address so.
    fn header(rig: &Rig, stations: &[Self::Station]) -> Vec<String>;
    /// The simulated drives of header lines.
    ///
    /// # Errors
    /// The lines have mistakes.
    fn simulated(header: &Source) -> Result<Self::Setup, Problems>;
    /// Plants a deviation in a drive. `None` if there is no such deviation, `Some(false)` if there is no such drive.
    fn plant(setup: &mut Self::Setup, drive: u8, deviation: &str) -> Option<bool>;
    /// The same drives as the manual has them, each with these properties.
    fn model(setup: &Self::Setup, properties: &[Self::Properties]) -> Self::Setup;
    /// Plays a conversation on fresh drives.
    fn play(setup: &Self::Setup, talk: &LineTalk<Self>) -> Seen<Self>;
    /// What a conversation shows; the same feature may come several times.
    fn features(talk: &LineTalk<Self>, seen: &Seen<Self>) -> Vec<u32>;

    /// With which values of the open points a search begins, the most likely ones first: a value for each drive.
    fn begins(setup: &Self::Setup) -> Vec<Vec<Self::Properties>>;
    /// Values that differ from `properties` in one open point of the drive at this place.
    fn neighbours(
        setup: &Self::Setup,
        place: usize,
        properties: &Self::Properties,
    ) -> Vec<Self::Properties>;
    /// Values of the open points as header lines, where they are not the usual ones.
    fn lines(setup: &Self::Setup, values: &[Self::Properties]) -> Vec<String>;
    /// Whether two pieces are the same, in all that a manual decides.
    fn same(expected: &Self::Said, seen: &Self::Said) -> bool;
    /// How unlike two pieces are, below a million.
    fn unlike(expected: &Self::Said, seen: &Self::Said) -> i64;
    /// The difference at a place, counted from 0, in words.
    fn difference(
        setup: &Self::Setup,
        place: usize,
        plays: (&Seen<Self>, &Seen<Self>),
        under: Vec<String>,
    ) -> Option<Self::Difference>;

    /// The section of a difference, the header lines of the open points under which the model explains most, and whether only a time
    /// differs.
    fn basis(difference: &Self::Difference) -> (&str, &[String], bool);
    /// Writes the steps of a scenario. The piece `timed`, counted from 1, must come exactly at its time.
    fn steps(
        setup: &Self::Setup,
        talk: &LineTalk<Self>,
        seen: &Seen<Self>,
        timed: Option<usize>,
        text: &mut String,
    );
}
