//! The attempts of a qualification, and whether a model with something changed explains them.
//!
//! Where time is virtual, an attempt is explained by a model that ends it in the same way, at the same line, and sends the same octets at the
//! same times. Where time is real, how often a telegram is repeated is not compared, nor what follows a motor; lines of scenarios compare that.

use super::worlds::{could_send, right_slaves_send};
use super::{AttemptCourse, Player, RigScenario};
use crate::rig::known::{INTERFACE, KnownInverters, Values, stated};
use crate::rig::observed::{Agreement, Observed, ReceivedOctets, Turn, WHOLE};
use crate::rig::settle::{Assumptions, search};
use crate::rig::talk::{Talk, TalkError};
use crate::simulate::SlaveSetup;
use harness_bench::link::{Link as _, LinkEvent, Recording};
use harness_bench::qualify::segment::{AttemptSummary, Note};
use harness_bench::scenario::run::{Outcome, Why};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{NordacProperty, PROPERTIES};
use harness_proto::nordac::words::zsw;
use harness_proto::nordac::{Image, Parameter, PpoType};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::{Pdu, Telegram};
use harness_proto::time::Span;
use harness_sim::nordac::deviation::{DEVIATIONS, Deviation};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// How a slave differs from what is known of it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum KnownDifference {
    /// Nothing differs but what is not settled of it: it is right.
    Right,
    /// The slave at this place has a deviation.
    WrongSlave(usize, &'static Deviation),
}

#[derive(Clone, Debug)]
pub(crate) struct SlaveNote {
    scenario: Arc<RigScenario>,
    /// What was known when it began.
    begun: Player,
    /// What was known of the slaves in it.
    slaves: Vec<KnownInverters>,
    /// Whether the settings of the bus were switched to those of the scenario.
    switches: bool,
    shown: AttemptShown,
    /// Where time is real, the telegrams of the bench with what came after each.
    turns: Vec<Turn>,
    noted: AttemptSummary,
}

#[derive(Clone, Debug, PartialEq)]
struct AttemptShown {
    /// Why the slaves were not ready.
    unanswered: Option<TalkError>,
    /// How it ended, and at which place of the text.
    ended: Option<(Verdict, Option<usize>)>,
    /// The octets that came; none where time is real.
    came: ReceivedOctets,
    /// Where time is real, the telegrams: by addresses and service the contents, one after the other where they change.
    telegrams: BTreeMap<String, Vec<String>>,
}

impl AttemptShown {
    fn of(gone: &AttemptCourse, link: &Observed<'_>, exact: bool) -> Self {
        let (unanswered, ended) = match gone {
            AttemptCourse::Unanswered(error) => (Some(error.clone()), None),
            AttemptCourse::Skipped(_) => (None, None),
            AttemptCourse::Played(outcome) => {
                let place = outcome.finding.as_ref().map(|finding| finding.span.start);
                (None, Some((outcome.verdict, place)))
            }
        };
        let came = link.noted.all();
        let mut telegrams: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (head, contents) in came.telegrams().iter().filter(|_| !exact).map(meaning) {
            let all = telegrams.entry(head).or_default();
            if all.last() != Some(&contents) {
                all.push(contents);
            }
        }
        Self {
            unanswered,
            ended,
            came: if exact { came } else { Default::default() },
            telegrams,
        }
    }

    fn agrees(&self, other: &Self) -> Agreement {
        match self == other {
            true => WHOLE,
            // The ends differ, and perhaps nothing else.
            false => self.came.agrees(&other.came).min(WHOLE - 1),
        }
    }
}

/// The kind of a telegram: without what follows a motor or a clock.
pub(super) fn kind(telegram: &Telegram) -> String {
    let (head, contents) = meaning(telegram);
    // The value of a parameter and the direction of a motor.
    match telegram.pdu().and_then(image) {
        None => format!("{head} {contents}"),
        Some(image) => {
            let state = image.first() & !(FOLLOWS | zsw::CLOCKWISE | zsw::ANTICLOCKWISE);
            format!(
                "{head} {:04X} {:04X} {state:04X}",
                image.pkw.pke, image.pkw.ind
            )
        }
    }
}

/// What follows a motor in a status word.
const FOLLOWS: u16 = zsw::AT_SETPOINT | zsw::REFERENCE;

/// The inputs that a reply carries.
fn image(pdu: &Pdu) -> Option<Image> {
    let exchanged = Service::of(pdu.ssap()) == Some(Service::DataExchange);
    let ppo = PpoType::ALL
        .into_iter()
        .find(|ppo| ppo.octets() == pdu.data().len());
    Image::decode(ppo.filter(|_| exchanged)?, pdu.data())
}

/// The addresses and the service of a telegram, and its contents without what follows a motor.
fn meaning(telegram: &Telegram) -> (String, String) {
    let Some(pdu) = telegram.pdu() else {
        return (format!("{telegram:?}"), String::new());
    };
    let (sa, fc, sap) = (pdu.sa(), pdu.fc().0, pdu.ssap());
    let head = format!("{sa} {fc:02X} {sap:?} {}", pdu.data().len());
    let contents = match image(pdu) {
        None => format!("{:02X?}", pdu.data()),
        Some(image) => format!("{} {:04X}", image.pkw, image.first() & !FOLLOWS),
    };
    (head, contents)
}

impl SlaveNote {
    pub(super) fn judge(&mut self, outcome: &Outcome) {
        // What was not shown is shown by another attempt, or not at all.
        self.noted.verdict = match outcome.unready {
            Some(_) if self.shown.ended.is_some() => Verdict::Skipped,
            _ => outcome.verdict,
        };
        let unready = match &self.shown.unanswered {
            // The rig's line was lost.
            None | Some(TalkError::Line(_)) => false,
            Some(_) => self.noted.received > 0,
        };
        self.noted.accuses = outcome.verdict == Verdict::Failed || unready && !self.noted.exact;
    }

    /// Whether it has shown something: the scenario was tried, or the slaves were asked for everything.
    pub(crate) fn shows_something(&self) -> bool {
        self.noted.was_tried() || self.begun.known.is_none() && self.begun.unable.is_none()
    }

    /// The values of a property of the slave at a place with which slaves that are `known` would have shown the same.
    pub(crate) fn explaining(
        &self,
        known: &[KnownInverters],
        place: usize,
        property: &NordacProperty,
    ) -> Vec<String> {
        let base: Assumptions = known.iter().map(|known| known.properties).collect();
        let none = Values::new();
        let explains = |word: &String| {
            let mut all = base.clone();
            property.set(&mut all[place], word)
                && self.shown_by(KnownDifference::Right, &all, &none) == self.shown
        };
        let values = crate::rig::values(property).into_iter();
        values.filter(explains).collect()
    }

    /// What parameters of the slave at a place hold if it has a deviation that changes what they read; nothing where they hold what was read.
    ///
    /// A guess is kept where it reads as the slave did: that the deviation exchanges octets, adds something, or exchanges PWE1 and PWE2.
    fn behind(&self, place: usize, deviation: &'static Deviation) -> Values {
        let known = &self.slaves[place];
        let reads = |held: &Values| {
            let mut slave = known.model(known.properties);
            slave.parameters.extend(stated(held));
            slave.deviation = Some(deviation);
            let mut link = self.begun.model(vec![slave], &self.begun.limits);
            let mut again = KnownInverters::new(known.slave);
            let mut talk = Talk::new(Box::new(&mut link), self.begun.patience);
            // What was read before an error counts.
            let _partly = again.read_all(&mut talk);
            again.shown
        };
        let differing = |read: &Values, wanted: Values| -> Values {
            let differs = |(place, wanted): &(_, u32)| {
                let read = read.get(place);
                read.is_some_and(|read| read != wanted)
            };
            wanted.into_iter().filter(differs).collect()
        };
        let first = reads(&Values::new());
        let mut open = differing(&first, (*known.shown).clone());
        let mut held = Values::new();
        for guess in [
            |_: u32, read: u32| read,
            |wanted: u32, read: u32| wanted.wrapping_add(wanted).wrapping_sub(read),
            |wanted: u32, _: u32| wanted.rotate_right(16),
        ] {
            if open.is_empty() {
                break;
            }
            for (place, wanted) in &open {
                held.insert(*place, guess(*wanted, first[place]));
            }
            open = differing(&reads(&held), open);
        }
        // What no guess explains is as it was read.
        held.retain(|place, _| !open.contains_key(place));
        held
    }

    /// Whether slaves that differ so would have shown the same, where parameters hold something else than was read; `None` where that was not
    /// compared to its end.
    fn is_explained_by(&self, other: KnownDifference, held: &Values) -> Option<bool> {
        match !self.noted.exact && self.noted.was_ready {
            true => self.could_be_sent_by(other, held),
            false => Some(self.is_shown_by(other, held)),
        }
    }

    fn is_shown_by(&self, other: KnownDifference, held: &Values) -> bool {
        let base: Assumptions = self.slaves.iter().map(|known| known.properties).collect();
        if let KnownDifference::WrongSlave(..) = other {
            return self.shown_by(other, &base, held) == self.shown;
        }
        // A verdict in virtual time has looked for right slaves that do the same.
        if self.noted.exact && self.noted.verdict == Verdict::Failed {
            return false;
        }
        let open: Vec<Vec<&str>> = self
            .slaves
            .iter()
            .map(|known| {
                let open = PROPERTIES.iter().filter(|row| !known.is_settled(row));
                open.map(|row| row.name).collect()
            })
            .collect();
        let may = |place: usize, property: &NordacProperty| open[place].contains(&property.name);
        let found = search(&base, may, |all| {
            self.shown_by(other, all, held).agrees(&self.shown)
        });
        !found.is_empty()
    }

    /// Whether slaves could have sent what came where time is real; `None` where the comparison stays open.
    fn could_be_sent_by(&self, other: KnownDifference, held: &Values) -> Option<bool> {
        let (rate, beats) = (self.begun.rate, &self.begun.beats);
        beats.beat();
        let sent = match other {
            KnownDifference::Right => {
                right_slaves_send(&self.slaves, rate, 0, &self.turns, beats).map(|_| ())
            }
            KnownDifference::WrongSlave(place, deviation) => {
                let known = self.slaves.iter();
                let slaves = known.map(|known| known.model(known.properties));
                let mut slaves: Vec<_> = slaves.collect();
                slaves[place].deviation = Some(deviation);
                slaves[place].parameters.extend(stated(held));
                could_send(&slaves, rate, &self.turns)
            }
        };
        match sent {
            Ok(()) => Some(true),
            Err(differs) => differs.open.is_none().then_some(false),
        }
    }

    /// What the attempt shows on models.
    fn shown_by(
        &self,
        other: KnownDifference,
        properties: &Assumptions,
        held: &Values,
    ) -> AttemptShown {
        let mut last = self.played_by(other, held, properties, None);
        // Where the slaves were not read: as delivered, or with the bus in control as a simulated rig has them.
        if last != self.shown && self.slaves.iter().any(|slave| slave.values.is_empty()) {
            last = self.played_by(other, held, properties, Some(2));
        }
        last
    }

    fn played_by(
        &self,
        other: KnownDifference,
        held: &Values,
        properties: &Assumptions,
        interface: Option<i64>,
    ) -> AttemptShown {
        let mut player = self.begun.clone();
        let slaves = self.slaves.iter().zip(properties).enumerate();
        let slaves = slaves.map(|(place, (known, properties))| {
            let mut slave: SlaveSetup = known.model(*properties);
            let control = Parameter::of(INTERFACE).zip(interface);
            let control = control.map(|(parameter, value)| (parameter, Index::default(), value));
            slave.parameters.extend(control);
            if let KnownDifference::WrongSlave(wrong, deviation) = other {
                slave.deviation = (wrong == place).then_some(deviation);
                slave
                    .parameters
                    .extend(stated(held).filter(|_| wrong == place));
            }
            slave
        });
        let limits = player.limits;
        let mut link = player.model(slaves.collect(), &limits);
        let mut forgotten: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut forgotten);
        recording.begin();
        let mut link = Observed::new(&mut recording);
        if self.noted.exact {
            link.noted.expect(&self.shown.came, 0, true);
        }
        let gone = match self.noted.was_tried() {
            true => player.go(&self.scenario, &mut link, Some(self.switches)).0,
            false => match player
                .learn(&mut link, false)
                .and_then(|()| player.look(&self.scenario, &mut link))
            {
                Ok(()) => AttemptCourse::Skipped(Why::RunEnded.into()),
                Err(error) => AttemptCourse::Unanswered(error),
            },
        };
        AttemptShown::of(&gone, &link, self.noted.exact)
    }
}

impl Note for SlaveNote {
    type Deviation = Deviation;

    fn deviations() -> Vec<&'static Deviation> {
        DEVIATIONS.all().collect()
    }

    fn words(deviation: &Deviation) -> String {
        deviation.sentence("NORDAC")
    }

    fn noted(&self) -> &AttemptSummary {
        &self.noted
    }

    fn drives(&self) -> Vec<String> {
        let slaves = self.begun.slaves.iter();
        slaves
            .map(|slave| format!("slave {}", slave.address))
            .collect()
    }

    fn is_right(&self) -> bool {
        self.is_explained_by(KnownDifference::Right, &Values::new()) == Some(true)
    }

    fn explains(&self, place: usize, deviation: &'static Deviation) -> Option<bool> {
        let wrong = KnownDifference::WrongSlave(place, deviation);
        let explained = self.is_explained_by(wrong, &Values::new());
        if explained != Some(false) {
            return explained;
        }
        let read = || self.behind(place, deviation);
        let held = self.begun.behind.get((place, deviation.name), read);
        match held.is_empty() {
            true => explained,
            false => self.is_explained_by(wrong, &held),
        }
    }
}

/// What parameters of the slave at a place hold if it has the deviation with this name and that changes what they read. It is worked out once in
/// a part of a qualification, so that every attempt knows the same.
#[derive(Clone, Debug, Default)]
pub(super) struct DeviantValues(Arc<Mutex<BTreeMap<(usize, &'static str), Values>>>);

impl DeviantValues {
    fn get(&self, key: (usize, &'static str), read: impl FnOnce() -> Values) -> Values {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.entry(key).or_insert_with(read).clone()
    }
}

impl Player {
    /// A copy that keeps no attempts.
    pub(super) fn without_notes(&mut self) -> Self {
        let notes = std::mem::take(&mut self.notes);
        let copy = self.clone();
        self.notes = notes;
        copy
    }

    /// Notes an attempt, over a link and with or without settings of the bus that were switched.
    pub(super) fn note(
        &mut self,
        begun: Self,
        scenario: &Arc<RigScenario>,
        link: &Observed<'_>,
        switches: bool,
        gone: &AttemptCourse,
    ) {
        let exact = link.time_tolerance() == Span::ZERO;
        let shown = AttemptShown::of(gone, link, exact);
        self.notes.push(SlaveNote {
            scenario: Arc::clone(scenario),
            begun,
            slaves: self.known.as_ref().unwrap_or(&self.partly).clone(),
            switches,
            turns: match exact {
                true => Vec::new(),
                false => link.noted.turns.clone(),
            },
            noted: AttemptSummary {
                name: scenario.name.clone(),
                verdict: Verdict::Skipped,
                accuses: false,
                exact,
                received: link.noted.all().telegrams().len(),
                was_ready: shown.ended.is_some(),
                was_unanswered: shown.unanswered.is_some(),
            },
            shown,
        });
    }
}
