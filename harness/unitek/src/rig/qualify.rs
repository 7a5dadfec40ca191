//! A qualification of UNITEK drives: the deviations that explain what they did, and the values of the open points that were settled.

use super::Axis;
use super::known::KnownDrives;
use super::player::{DriveNote, Player};
use super::walk::{State, names, walk_of, walked};
use super::{axes, limits};
use harness_bench::qualify::segment::{
    Attempts, CONVERSATION, Note as _, Point, kept, profile, qualified,
};
use harness_bench::qualify::walk::DriveWalk;
use harness_bench::rig::Rig;
use harness_bench::rig::playing::Qualified;
use harness_bench::scenario::source::Source;
use harness_proto::unitek::guard::Limits;
use harness_proto::unitek::properties::{PROPERTIES, UnitekProperty};
use include_dir::{Dir, include_dir};
use std::ops::RangeInclusive;

/// The conversations that are played with each drive after the selected scenarios.
static CONVERSATIONS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/qualify/unitek");

/// What stands in a conversation for the number and the identifiers of a drive, the two bytes of each of them, the next higher one, and
/// three that no drive of the rig uses, each with its bytes: one as printed to receive, one that is not, and one to send.
const DRIVE: [&str; 16] = [
    "{node}",
    "{rx}",
    "{tx}",
    "{low}",
    "{high}",
    "{next}",
    "{free}",
    "{free-low}",
    "{free-high}",
    "{other}",
    "{other-low}",
    "{other-high}",
    "{tx-low}",
    "{tx-high}",
    "{send-low}",
    "{send-high}",
];

/// The identifiers in which a drive may receive (UNITEK 3.1).
const PRINTED: RangeInclusive<u16> = 0x201..=0x27F;

/// The identifiers on which a drive may send (UNITEK 3.1).
const PRINTED_TO_SEND: RangeInclusive<u16> = 0x181..=0x1FF;

/// What a probe needs beyond the default permissions.
#[derive(Clone, Copy)]
enum Need {
    /// Nothing more than reads, cycles, STATUS_MASK and the lock.
    Nothing,
    /// Motors may turn.
    Motion,
    /// Motors may turn, and the time-out may be set.
    MotionAndBusSettings,
    /// Identifiers may be changed, and not stored.
    BusSettings,
    /// Identifiers may be changed; if that shows nothing, the drive is switched off and on.
    BusSettingsAndPowerUp,
    /// The drive is switched off and on.
    PowerUp,
    /// Frames without an adapter between.
    ExactTime,
    /// An adapter at another bit rate, which brings the drive back.
    OtherAdapter,
}

/// What the probe of a property needs, and the conversation whose frames show it; nothing for those that are not listed.
const NEEDS: [(&str, Need, &str); 14] = [
    ("id-change", Need::BusSettings, "write-identifier"),
    ("id-range", Need::BusSettings, "write-identifier-range"),
    ("event-mask", Need::PowerUp, ""),
    ("lock-at-power-up", Need::PowerUp, ""),
    ("power-up-mode", Need::PowerUp, ""),
    ("lock-clears-command", Need::Motion, "lock-and-commands"),
    ("homing-time", Need::Motion, ""),
    ("time-out-clear", Need::MotionAndBusSettings, ""),
    ("enable-after-lock", Need::MotionAndBusSettings, ""),
    ("reply-delay", Need::ExactTime, ""),
    ("interval-accuracy", Need::ExactTime, ""),
    ("wide-replies", Need::BusSettings, ""),
    ("rate-change", Need::OtherAdapter, ""),
    ("second-identifiers", Need::BusSettingsAndPowerUp, ""),
];

fn why_open(property: &UnitekProperty, limits: &Limits) -> String {
    let needs = NEEDS.iter().find(|(name, ..)| *name == property.name);
    let why = match needs.map_or(Need::Nothing, |(_, needs, _)| *needs) {
        Need::Motion | Need::MotionAndBusSettings if !limits.motion => {
            "not asked: this needs `allow_motion` in [limits] and --allow-motion"
        }
        Need::BusSettings | Need::BusSettingsAndPowerUp | Need::MotionAndBusSettings
            if !limits.bus_settings =>
        {
            "not asked: this needs `allow_bus_settings` in [limits]"
        }
        Need::Motion | Need::MotionAndBusSettings => {
            "the drive did not show it: its hardware enable is open, or it is not ready"
        }
        Need::BusSettingsAndPowerUp => {
            "it does not use them at once; whether it does later shows when it is switched on"
        }
        Need::PowerUp => "not asked: it shows when the drive is switched on",
        Need::ExactTime => "not asked: the adapter and the computer take time, too",
        Need::OtherAdapter => {
            "not asked: the drive could be brought back only by an adapter with another bit rate"
        }
        Need::Nothing | Need::BusSettings => "the drive has shown no value that is known",
    };
    why.to_owned()
}

/// Two identifiers for a drive to be tried with, which no drive of the rig uses, and which are those of no other drive either: one as
/// printed (UNITEK 3.1), while there are some left, and one that is not.
pub(super) fn free(axes: &[Axis], axis: Axis) -> [u16; 2] {
    let place = axes.iter().position(|other| *other == axis).unwrap_or(0);
    let used = |id: &u16| axes.iter().any(|axis| axis.rx == *id || axis.tx == *id);
    let other = || (0x100..=0x7FF).filter(|id| !PRINTED.contains(id) && !used(id));
    // Not the last one, which is the highest neighbour that a drive may hear.
    let printed = PRINTED.rev().skip(1).filter(|id| !used(id));
    let free = printed.chain(other().skip(axes.len())).nth(place);
    [free, other().nth(place)].map(|id| id.unwrap_or(axis.rx))
}

/// An identifier on which a drive can be tried to send: one that no drive of the rig uses, as printed (UNITEK 3.1) while there are some left.
fn free_to_send(axes: &[Axis], axis: Axis) -> u16 {
    let place = axes.iter().position(|other| *other == axis).unwrap_or(0);
    let tried: Vec<_> = axes.iter().flat_map(|axis| free(axes, *axis)).collect();
    let used = |id: &u16| {
        let is_used = axes.iter().any(|axis| axis.rx == *id || axis.tx == *id);
        is_used || tried.contains(id)
    };
    let sends = PRINTED_TO_SEND.rev().chain(0x100..=0x7FF);
    sends.filter(|id| !used(id)).nth(place).unwrap_or(axis.tx)
}

/// The conversations with these drives: those that are kept, and those that walk each of them as far as the rig's file permits.
pub(super) fn conversations(axes: &[Axis], limits: &Limits) -> Vec<Source> {
    let of_drive = |axis: &Axis| {
        let [free, other] = free(axes, *axis);
        let bytes = |id: u16| [id, id & 0xFF, id >> 8];
        let [free, free_low, free_high] = bytes(free);
        let [other, other_low, other_high] = bytes(other);
        let [_, send_low, send_high] = bytes(free_to_send(axes, *axis));
        let values = [
            axis.node.to_string(),
            format!("{:03X}", axis.rx),
            format!("{:03X}", axis.tx),
            format!("{:02X}", axis.rx & 0xFF),
            format!("{:02X}", axis.rx >> 8),
            format!("{:03X}", axis.rx + 1),
            format!("{free:03X}"),
            format!("{free_low:02X}"),
            format!("{free_high:02X}"),
            format!("{other:03X}"),
            format!("{other_low:02X}"),
            format!("{other_high:02X}"),
            format!("{:02X}", axis.tx & 0xFF),
            format!("{:02X}", axis.tx >> 8),
            format!("{send_low:02X}"),
            format!("{send_high:02X}"),
        ];
        kept(&CONVERSATIONS, &alone_or_named(axes, *axis), |text| {
            let text = text.to_owned();
            let places = DRIVE.iter().zip(&values);
            places.fold(text, |text, (place, value)| text.replace(place, value))
        })
    };
    let kept = axes.iter().flat_map(of_drive);
    let walks = walks(axes, limits).into_iter();
    let walks = walks
        .flat_map(|(axis, walk)| walk.conversations(CONVERSATION, |lines| walked(axis, lines)));
    kept.chain(walks).collect()
}

/// The name of a drive in those of its conversations; empty where it is alone.
fn alone_or_named(axes: &[Axis], axis: Axis) -> String {
    match axes.len() {
        1 => String::new(),
        _ => format!("drive {}", axis.node),
    }
}

/// The walks of drives, as far as these limits permit them.
fn walks(axes: &[Axis], limits: &Limits) -> Vec<(Axis, DriveWalk<State>)> {
    let walk = |axis: &Axis| {
        let drive = alone_or_named(axes, *axis);
        let walk = walk_of(*axis, limits);
        (*axis, DriveWalk { drive, walk })
    };
    axes.iter().map(walk).collect()
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
    let permitted = limits(rig, rig.file.limits.allow_motion);
    let walks = walks(&rig.port().map(axes).unwrap_or_default(), &permitted);
    let walks = walks.iter().map(|walk| &walk.1);
    let attempts = Attempts::new(&notes, walks, &names(&permitted));
    let shown = known.iter().map(|(known, limits)| points(known, limits));
    let profile = profile(rig, began, shown.map(Iterator::collect).collect());
    let named = rig.file.deviation.iter().map(|wrong| wrong.name.clone());
    let named: Vec<_> = named.collect();
    qualified(&attempts, profile, "frame", &named, whole)
}

/// Settles the properties of a drive of which one value alone explains the conversation that shows it.
fn settle(drives: &mut [KnownDrives], place: usize, notes: &[&DriveNote]) {
    let drive = &mut drives[place];
    for (name, _, conversation) in NEEDS {
        let property = UnitekProperty::of(name).filter(|_| !drive.settled.contains(name));
        let Some(property) = property else { continue };
        let values = drive.values_of(property);
        let shown = format!("{CONVERSATION}{conversation}");
        let of_drive = format!("{shown}-drive-{}", drive.axis.node);
        for note in notes {
            let explaining = match [&shown, &of_drive].contains(&&note.noted().name) {
                true => note.explaining(place, &values),
                false => continue,
            };
            if let [value] = explaining[..] {
                let word = property.of_drive(value).to_string();
                drive.settle(name, &word);
            }
        }
    }
}

/// What each drive has shown of each point.
fn points<'p>(drives: &'p [KnownDrives], limits: &'p Limits) -> impl Iterator<Item = Point<'p>> {
    PROPERTIES.iter().flat_map(move |property| {
        drives.iter().map(move |known| Point {
            drive: format!("drive {}", known.axis.node),
            name: property.name,
            section: format!("unitek {}", property.section),
            value: match known.settled.contains(property.name) {
                true => Ok(property.of_drive(&known.properties).to_string()),
                false => Err(why_open(property, limits)),
            },
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No drive is tried with an identifier of another one, or with that which another one is tried with.
    #[test]
    fn each_drive_is_tried_with_identifiers_of_its_own() {
        for drives in [1u8, 2, 126, 127] {
            let axis = |node: u8| Axis {
                node,
                rx: 0x200 + u16::from(node),
                tx: 0x180 + u16::from(node),
            };
            let axes: Vec<_> = (1..=drives).map(axis).collect();
            let tried = axes.iter().flat_map(|axis| {
                let sends = free_to_send(&axes, *axis);
                free(&axes, *axis).into_iter().chain([sends])
            });
            let used = axes.iter().flat_map(|axis| [axis.rx, axis.tx]);
            let all: Vec<_> = tried.chain(used).collect();
            let each: std::collections::BTreeSet<_> = all.iter().collect();
            assert_eq!(each.len(), all.len(), "{drives} drives");
            assert!(all.iter().all(|id| (1..=0x7FF).contains(id)));
        }
    }

    #[test]
    fn every_need_is_of_a_property_and_its_conversation_is_there() {
        for (name, _, shown) in NEEDS {
            assert!(UnitekProperty::of(name).is_some(), "{name}");
            let file = format!("{shown}.scn");
            assert!(shown.is_empty() || CONVERSATIONS.contains(file), "{name}");
        }
    }
}
