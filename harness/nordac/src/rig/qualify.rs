//! A qualification of NORDAC inverters: the deviations that explain what they did, and the values of the open points that were settled.

use super::known::{KnownInverters, value_of};
use super::player::{Player, SlaveNote};
use super::walk::{State, names, walk_of, walked};
use super::{RigSlave, limits, slaves};
use harness_bench::qualify::segment::{
    Attempts, CONVERSATION, Note as _, Point, kept, profile, qualified,
};
use harness_bench::qualify::walk::DriveWalk;
use harness_bench::rig::Rig;
use harness_bench::rig::playing::Qualified;
use harness_bench::scenario::source::Source;
use harness_proto::nordac::guard::Limits;
use harness_proto::nordac::properties::{NordacProperty, PROPERTIES};
use harness_proto::profibus::fdl::{SD1, check_sum};
use include_dir::{Dir, include_dir};

/// The conversations that are played with each slave after the selected scenarios.
static CONVERSATIONS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/qualify/nordac");

/// What stands in a conversation for the address of a slave, the octets DA without and with a SAP, and its PPO type.
const SLAVE: [&str; 4] = ["{slave}", "{da}", "{das}", "{ppo}"];

/// What stands in a telegram for its FCS.
const FCS: &str = "{fcs}";

/// What a probe needs that is not permitted by default.
#[derive(Clone, Copy)]
enum ProbeNeeds {
    Nothing,
    /// Parameters may be written.
    Eeprom,
    /// Who controls the inverter may be changed.
    Control,
    /// Motors may turn, and data of the motor may be written.
    Motion,
    /// The option PosiCon.
    PosiCon,
    /// The slave is switched off and on.
    PowerUp,
    /// A disturbance inside the inverter.
    Inside,
    /// No adapter and no computer between.
    ExactTime,
    /// It would lose the slave, or start a motor past the guard.
    Never,
}

/// The points that a conversation without any permission does not settle, what each needs, and the conversation that shows it.
const NEEDS: [(&str, ProbeNeeds, &str); 38] = [
    ("leave-dx-wrong-length", ProbeNeeds::Nothing, "wrong-length"),
    ("sda-ident-lsap", ProbeNeeds::Nothing, "services"),
    ("autobaud", ProbeNeeds::PowerUp, "services"),
    ("initial-zsw-4-5", ProbeNeeds::PowerUp, "services"),
    ("foreign-prm", ProbeNeeds::Nothing, "other-master"),
    ("cfg-follows-ppo-type", ProbeNeeds::Nothing, "configuration"),
    ("sync-without-request", ProbeNeeds::Nothing, "freeze"),
    ("rd-inp-under-freeze", ProbeNeeds::Nothing, "frozen-inputs"),
    ("spm", ProbeNeeds::Nothing, "tasks"),
    ("negative-pwe1", ProbeNeeds::Eeprom, "negative"),
    ("pwe1-of-word-task", ProbeNeeds::Eeprom, "writes"),
    ("task-new-when", ProbeNeeds::Eeprom, "writes"),
    ("plain-task-subindex", ProbeNeeds::Eeprom, "writes"),
    ("zsw9", ProbeNeeds::Control, "local-control"),
    ("both-directions", ProbeNeeds::Motion, "directions"),
    ("over-100", ProbeNeeds::Motion, "directions"),
    ("pzd-invalid", ProbeNeeds::Motion, "invalid-words"),
    ("bit4-ramp", ProbeNeeds::Motion, "stops"),
    ("off1-beats-disable", ProbeNeeds::Motion, "stops"),
    ("off1-zsw-while-ramping", ProbeNeeds::Motion, "stops"),
    ("zsw1-in-qs-fr", ProbeNeeds::Motion, "stops"),
    ("zsw10", ProbeNeeds::Motion, "stops"),
    ("online-error", ProbeNeeds::Motion, "running-write"),
    ("watchdog-action", ProbeNeeds::Motion, "watchdog"),
    ("timeout-counts", ProbeNeeds::Motion, "time-out"),
    ("timeout-with-1614", ProbeNeeds::Motion, "time-out-1614"),
    ("timeout-exactly", ProbeNeeds::ExactTime, ""),
    ("947-elements", ProbeNeeds::Inside, ""),
    ("diag-flag-cleared-by", ProbeNeeds::Inside, ""),
    ("967-write", ProbeNeeds::Never, ""),
    ("load-default-value", ProbeNeeds::Never, ""),
    ("position-count", ProbeNeeds::PosiCon, ""),
    ("width-error", ProbeNeeds::PosiCon, ""),
    ("ppo1-double-words", ProbeNeeds::PosiCon, ""),
    ("position-words", ProbeNeeds::PosiCon, ""),
    ("1732-write", ProbeNeeds::PosiCon, ""),
    ("address-range", ProbeNeeds::Never, ""),
    ("reinit", ProbeNeeds::Never, ""),
];

fn why_open(property: &NordacProperty, limits: &Limits) -> String {
    let needs = NEEDS.iter().find(|(name, ..)| *name == property.name);
    let why = match needs.map_or(ProbeNeeds::Nothing, |(_, needs, _)| *needs) {
        ProbeNeeds::Eeprom if !limits.eeprom => "not asked: this needs `allow_eeprom` in [limits]",
        ProbeNeeds::Control if !(limits.eeprom && limits.bus_settings) => {
            "not asked: this needs `allow_eeprom` and `allow_bus_settings` in [limits]"
        }
        ProbeNeeds::Motion if !(limits.motion && limits.eeprom && limits.motor_data) => {
            "not asked: this needs `allow_motion`, `allow_eeprom` and `allow_motor_data` in [limits], and --allow-motion"
        }
        ProbeNeeds::PosiCon => "not asked: it shows with the option PosiCon only",
        ProbeNeeds::PowerUp => "the slave has not shown it: it shows when the slave is switched on",
        ProbeNeeds::Inside => "not asked: it shows when inverter or module have a fault",
        ProbeNeeds::ExactTime => "not asked: the adapter and the computer take time, too",
        ProbeNeeds::Never => {
            "not asked: the probe could lose the slave or its parameters, or start a motor past the guard"
        }
        ProbeNeeds::Nothing | ProbeNeeds::Eeprom | ProbeNeeds::Control | ProbeNeeds::Motion => {
            "the slave has shown no value that alone explains what it sent"
        }
    };
    why.to_owned()
}

/// A conversation with a slave: each place that stands for something of it is filled in, and each FCS worked out.
fn with_slave(text: &str, slave: &RigSlave) -> String {
    let address = slave.address;
    let values = [
        address.to_string(),
        format!("{address:02X}"),
        format!("{:02X}", address | 0x80),
        slave.ppo.unwrap_or_default().number().to_string(),
    ];
    let places = SLAVE.iter().zip(&values);
    let text = places.fold(text.to_owned(), |text, (place, value)| {
        text.replace(place, value)
    });
    let lines = text.lines().map(|line| match line.split_once(FCS) {
        None => line.to_owned(),
        Some((before, behind)) => {
            let octets = before.split(' ').skip(1);
            let octets: Vec<_> = octets
                .filter_map(|octet| u8::from_str_radix(octet, 16).ok())
                .collect();
            // Behind the start of SD1 or of SD2.
            let from = if octets.first() == Some(&SD1) { 1 } else { 4 };
            let sum = check_sum(octets.get(from..).unwrap_or_default());
            format!("{before}{sum:02X}{behind}")
        }
    });
    lines.map(|line| line + "\n").collect()
}

/// The conversations with the slaves of a rig.
pub(super) fn conversations(rig: &Rig) -> Vec<Source> {
    let slaves = rig.port().map(slaves).unwrap_or_default();
    let of_slave = |slave: &RigSlave| {
        let name = alone_or_named(&slaves, slave);
        kept(&CONVERSATIONS, &name, |text| with_slave(text, slave))
    };
    let kept = slaves.iter().flat_map(of_slave);
    let walks = walks(rig).into_iter();
    let walks = walks
        .flat_map(|(slave, walk)| walk.conversations(CONVERSATION, |lines| walked(slave, lines)));
    kept.chain(walks).collect()
}

/// The name of a slave in those of its conversations; empty where it is alone.
fn alone_or_named(slaves: &[RigSlave], slave: &RigSlave) -> String {
    match slaves.len() {
        1 => String::new(),
        _ => format!("slave {}", slave.address),
    }
}

/// The walks of the slaves of a rig, as far as its file permits them.
fn walks(rig: &Rig) -> Vec<(RigSlave, DriveWalk<State>)> {
    let slaves = rig.port().map(slaves).unwrap_or_default();
    let limits = limits(rig, rig.file.limits.allow_motion);
    let walk = |slave: &RigSlave| {
        let drive = alone_or_named(&slaves, slave);
        let walk = walk_of(*slave, &limits)?;
        Some((*slave, DriveWalk { drive, walk }))
    };
    slaves.iter().filter_map(walk).collect()
}

/// What the attempts of these players come to, one for each part of a qualification.
pub(super) fn qualify(parts: &[&Player], rig: &Rig, began: &str, whole: bool) -> Qualified {
    let notes = parts.iter().map(|player| {
        let notes = player.notes().iter();
        let notes = notes.filter(|note| note.shows_something());
        notes.collect::<Vec<_>>()
    });
    let notes: Vec<_> = notes.collect();
    let known = parts.iter().zip(&notes).map(|(player, notes)| {
        let mut known = player.known().to_vec();
        for place in 0..known.len() {
            settle(&mut known, place, notes);
        }
        (known, player.limits())
    });
    let known: Vec<_> = known.collect();
    let walks = walks(rig);
    let walks = walks.iter().map(|walk| &walk.1);
    let attempts = Attempts::new(&notes, walks, &names());
    let shown = known.iter().map(|(known, limits)| points(known, limits));
    let profile = profile(rig, began, shown.map(Iterator::collect).collect());
    let named = rig.file.deviation.iter().map(|wrong| wrong.name.clone());
    let named: Vec<_> = named.collect();
    qualified(&attempts, profile, "telegram", &named, whole)
}

/// Settles the properties of a slave of which one value alone explains the conversation that shows it.
fn settle(slaves: &mut [KnownInverters], place: usize, notes: &[&SlaveNote]) {
    let address = slaves[place].slave.address;
    for (name, _, conversation) in NEEDS {
        let property =
            NordacProperty::of(name).filter(|property| !slaves[place].is_settled(property));
        let Some(property) = property else { continue };
        let shown = format!("{CONVERSATION}{conversation}");
        let of_slave = format!("{shown}-slave-{address}");
        let notes = notes.iter();
        for note in notes.filter(|note| [&shown, &of_slave].contains(&&note.noted().name)) {
            if let [value] = &note.explaining(slaves, place, property)[..] {
                slaves[place].settle(property, value);
            }
        }
    }
}

/// What a slave has shown of each point.
fn points<'p>(slaves: &'p [KnownInverters], limits: &'p Limits) -> impl Iterator<Item = Point<'p>> {
    PROPERTIES.iter().flat_map(move |property| {
        slaves.iter().map(move |known| Point {
            drive: format!("slave {}", known.slave.address),
            name: property.name,
            section: format!("nordac {}", property.section),
            value: match known.is_settled(property) {
                true => Ok(value_of(property, &known.properties)),
                false => Err(why_open(property, limits)),
            },
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BUSES;
    use crate::gate::guarded;
    use crate::rig::player::RigScenario;
    use crate::simulate::{Bench, Setup, SlaveSetup};
    use harness_bench::link::Link as _;
    use harness_bench::rig::find;
    use harness_bench::scenario::verdict::Verdict;
    use harness_proto::profibus::BusRate;
    use harness_proto::time::Span;
    use std::path::Path;
    use std::sync::Arc;

    #[test]
    fn every_need_is_of_a_property_and_its_conversation_is_there() {
        for (name, _, shown) in NEEDS {
            assert!(NordacProperty::of(name).is_some(), "{name}");
            let file = format!("{shown}.scn");
            assert!(shown.is_empty() || CONVERSATIONS.contains(file), "{name}");
        }
    }

    /// A value is the slave's only where every other one would have shown something else.
    #[test]
    fn a_point_that_nothing_shows_stays_open() {
        let rig = find("sim:nordac:1", Path::new(""), &BUSES).expect("a rig");
        let all = slaves(rig.port().expect("a port"));
        let text =
            "title x\nbus nordac\nslave {slave} ppo {ppo}\nstart {slave}\nexchange {slave}\n";
        let source = Source::new(format!("{CONVERSATION}tasks"), with_slave(text, &all[0]));
        let scenario = Arc::new(RigScenario::read(&source).expect("a scenario"));
        let setup = Setup::new(BusRate::K500, vec![SlaveSetup::new(all[0].address)]);
        let limits = Limits::default();
        let mut link = guarded(Bench::new(&setup), limits, &[all[0].into()], false);
        let able = link.capabilities().to_vec();
        let patience = Span::from_millis(5);
        let mut player = Player::of(all, BusRate::K500, patience, limits, able, true);
        player.qualify();
        let (outcome, _) = player.attempt(&scenario, &mut link);
        assert_eq!(outcome.verdict, Verdict::Passed, "{outcome:?}");
        let made = qualify(&[&player], &rig, "", true);
        let profile = made.profile.expect("the slave was asked");
        // The conversation has its name, and no task with SPM.
        assert!(profile.contains("spm = "), "{profile}");
        assert!(!profile.contains("property spm = "), "{profile}");
    }

    /// Every conversation can be read, with any address; its telegrams have a right FCS.
    #[test]
    fn every_conversation_can_be_read() {
        for (address, ppo) in [(1, None), (126, None)] {
            let slave = RigSlave { address, ppo };
            for file in CONVERSATIONS.files() {
                let text = with_slave(file.contents_utf8().expect("text"), &slave);
                let name = file.path().display().to_string();
                assert!(!text.contains('{'), "{name}: {text}");
                let source = Source::new(name, text);
                RigScenario::read(&source).expect("a scenario");
            }
        }
    }
}
