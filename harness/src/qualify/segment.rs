//! Drives that share a segment: which known deviation explains every attempt of a qualification.
//!
//! A bus supplies its attempts and what it knows of wrong drives ([`Attempts`]); the rules when a deviation is named are the same for all.

use crate::counted::counted;
use crate::rig::Rig;
use crate::rig::profile::{Profile, ProfileLines};
use crate::rig::segment::Qualified;
use crate::scenario::verdict::Verdict;
use std::collections::BTreeMap;

/// The most deviations that are listed where several explain everything.
const MOST_TOLD: usize = 8;

/// The attempts of a qualification, by their places.
pub(crate) trait Attempts {
    /// A known way in which a drive may be wrong.
    type Deviation;

    /// Every known way.
    fn deviations(&self) -> Vec<Self::Deviation>;

    /// Its name, section and effect, with the drive.
    fn words(&self, deviation: &Self::Deviation) -> String;

    /// The attempts that were begun, in order.
    fn attempts(&self) -> Vec<Attempted>;

    /// Whether correct drives, with any value of what the manual leaves open, would have shown the same in an attempt.
    fn is_right(&self, attempt: usize) -> bool;

    /// Whether drives with this deviation would have shown the same in an attempt.
    fn explains(&self, deviation: &Self::Deviation, attempt: usize) -> bool;
}

/// One attempt at a scenario.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attempted {
    /// Its verdict; skipped where the drives were only asked for their registers.
    pub(crate) verdict: Verdict,
    /// Whether the drives did something that no correct drive does, as far as is known.
    pub(crate) accuses: bool,
    /// Whether time is virtual, so that what came is compared with a model, whatever the verdict.
    pub(crate) exact: bool,
    /// How many frames or telegrams were received.
    pub(crate) received: usize,
}

/// What the attempts say of the drives.
#[derive(Debug)]
enum Named {
    /// No attempt accuses a drive.
    None,
    /// These deviations explain all that was compared, in words.
    Explained(Vec<String>),
}

/// Names the deviations that explain every attempt that accuses a drive, and every one that passed. Where time is virtual, an attempt that
/// passed counts too if correct drives do not explain what came; but it alone accuses no drive.
fn named<A: Attempts>(all: &A, attempts: &[Attempted]) -> Named {
    let places = attempts.iter().enumerate();
    let right = [Verdict::Passed, Verdict::Skipped];
    let compared = places.filter(|(_, own)| own.accuses || right.contains(&own.verdict));
    let (unlike, alike): (Vec<_>, Vec<_>) =
        compared.partition(|(place, own)| (own.accuses || own.exact) && !all.is_right(*place));
    if unlike.is_empty() {
        return Named::None;
    }
    let explaining = all.deviations().into_iter().filter(|deviation| {
        let mut compared = unlike.iter().chain(&alike);
        compared.all(|(place, _)| all.explains(deviation, *place))
    });
    let explaining: Vec<_> = explaining.map(|own| all.words(&own)).collect();
    let accused = unlike.iter().any(|(_, own)| own.accuses);
    match explaining.len() {
        1 => Named::Explained(explaining),
        _ if accused => Named::Explained(explaining),
        _ => Named::None,
    }
}

/// What a drive has shown of a point that the manual leaves open.
pub(crate) struct Point<'p> {
    /// The drive, as the header of a scenario names it.
    pub(crate) drive: String,
    /// The property.
    pub(crate) name: &'p str,
    /// The section, with the document.
    pub(crate) section: String,
    /// Its value, or why none was settled.
    pub(crate) value: Result<String, String>,
}

/// The profile of drives: every point that the manual leaves open, of each drive.
pub(crate) fn profile<'p>(
    (rig, began): (&Rig, &str),
    drives: usize,
    points: impl Iterator<Item = Point<'p>>,
) -> Profile<ProfileLines> {
    let mut profile = Profile {
        schema: 1,
        rig: rig.id().to_owned(),
        date: began.to_owned(),
        rings: vec![u8::try_from(drives).unwrap_or(u8::MAX)],
        property: BTreeMap::new(),
        open: BTreeMap::new(),
    };
    for own in points {
        let drive = &own.drive;
        match own.value {
            Ok(value) => {
                let line = format!("{drive} property {} = {value}", own.name);
                let value = format!("{drive}: {value}");
                profile.settle(own.name, &own.section, &value, &vec![line]);
            }
            Err(why) => profile.leave_open(own.name, &format!("{drive}: {why}")),
        }
    }
    profile
}

/// What a qualification comes to. `frames` is the word for what is received, in the singular; `known` are the deviations that the rig's file
/// names. `whole` if everything was played.
pub(crate) fn qualified<A: Attempts>(
    all: &A,
    profile: Option<Profile<ProfileLines>>,
    frames: &str,
    known: &[String],
    whole: bool,
) -> Qualified {
    let attempts = all.attempts();
    let named = named(all, &attempts);
    let settled = profile.as_ref().map_or(0, |own| own.property.len());
    let open = profile.as_ref().map_or(0, |own| own.open.len());
    let verdicts = |verdict| attempts.iter().filter(move |own| own.verdict == verdict);
    let failed = verdicts(Verdict::Failed).count();
    let passed = verdicts(Verdict::Passed).count();
    let unclear = |(place, own): &(usize, &Attempted)| {
        let settled = [Verdict::Passed, Verdict::Failed, Verdict::Skipped];
        !(settled.contains(&own.verdict) || own.exact && all.is_right(*place))
    };
    let inconclusive = attempts.iter().enumerate().filter(unclear).count();
    let tried = attempts.len() - verdicts(Verdict::Skipped).count();
    let received: usize = attempts.iter().map(|own| own.received).sum();
    let mut text = match &named {
        Named::Explained(all) if all.is_empty() => {
            "deviations: the drives differ from the model, and no single known deviation explains it\n".to_owned()
        }
        Named::Explained(all) => all
            .iter()
            .take(MOST_TOLD)
            .map(|own| format!("deviation: {own}\n"))
            .collect(),
        Named::None if inconclusive > 0 || tried == 0 || !whole => {
            "deviations: not known; no drive is known to be at fault, but not everything was compared and equal\n".to_owned()
        }
        Named::None if failed > 0 => {
            "deviations: not known; attempts failed, and correct drives with other values of what the manual leaves open explain each of them\n".to_owned()
        }
        Named::None if known.is_empty() => {
            "deviations: none; everything received is as the model of the manual says\n".to_owned()
        }
        Named::None => format!(
            "deviations: none beside the known ones ({})\n",
            known.join(", ")
        ),
    };
    let several = match &named {
        Named::Explained(all) => all.len(),
        Named::None => 0,
    };
    if several > MOST_TOLD {
        let more = several - MOST_TOLD;
        text.push_str(&format!("and {more} more\n"));
    }
    if several > 1 {
        text.push_str(
            "each of these explains everything received: this does not tell which one it is\n",
        );
    }
    text.push_str(&format!(
        "compared: {passed} of {} passed, {failed} failed, {inconclusive} inconclusive; {} received; {settled} of {} settled\n",
        counted(tried, "attempt"),
        counted(received, frames),
        counted(settled + open, "open point"),
    ));
    if !whole {
        text.push_str("the run ended before everything was played\n");
    }
    Qualified {
        profile: profile.map(|own| toml::to_string(&own).unwrap_or_default()),
        deviations: text,
        verdict: match named {
            _ if failed > 0 => Verdict::Failed,
            Named::Explained(all) if all.len() == 1 => Verdict::Failed,
            Named::Explained(_) => Verdict::Inconclusive,
            Named::None if inconclusive > 0 || !whole => Verdict::Inconclusive,
            Named::None => Verdict::Passed,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Attempts, each with the deviations that explain it.
    struct Table(Vec<(Attempted, bool, &'static [&'static str])>);

    impl Attempts for Table {
        type Deviation = &'static str;

        fn deviations(&self) -> Vec<&'static str> {
            vec!["one", "two"]
        }

        fn words(&self, deviation: &&'static str) -> String {
            (*deviation).to_owned()
        }

        fn attempts(&self) -> Vec<Attempted> {
            self.0.iter().map(|own| own.0).collect()
        }

        fn is_right(&self, attempt: usize) -> bool {
            self.0[attempt].1
        }

        fn explains(&self, deviation: &&'static str, attempt: usize) -> bool {
            self.0[attempt].2.contains(deviation)
        }
    }

    fn attempted(verdict: Verdict) -> Attempted {
        Attempted {
            verdict,
            accuses: verdict == Verdict::Failed,
            exact: false,
            received: 3,
        }
    }

    fn deviations(table: &Table) -> (String, Verdict) {
        let own = qualified(table, None, "frame", &[], true);
        (own.deviations, own.verdict)
    }

    /// One is named where it alone explains what failed and what passed.
    #[test]
    fn one_deviation_is_named_where_it_alone_explains_everything() {
        let failed = attempted(Verdict::Failed);
        let passed = attempted(Verdict::Passed);
        let both: &[&str] = &["one", "two"];
        let named = deviations(&Table(vec![
            (failed, false, both),
            (passed, true, &["two"]),
        ]));
        assert!(
            named
                .0
                .starts_with("deviation: two\ncompared: 1 of 2 attempts passed"),
            "{}",
            named.0
        );
        assert_eq!(named.1, Verdict::Failed);
        let several = deviations(&Table(vec![(failed, false, both), (passed, true, both)]));
        assert!(
            several.0.contains("does not tell which one"),
            "{}",
            several.0
        );
        let none = deviations(&Table(vec![
            (failed, false, &["one"]),
            (passed, true, &["two"]),
        ]));
        assert!(none.0.contains("no single known deviation"), "{}", none.0);
    }

    /// Nothing is named for drives that nothing accuses.
    #[test]
    fn correct_drives_are_not_named() {
        let passed = attempted(Verdict::Passed);
        let own = deviations(&Table(vec![(passed, true, &["one"])]));
        assert!(own.0.starts_with("deviations: none;"), "{}", own.0);
        assert_eq!(own.1, Verdict::Passed);
        let unclear = attempted(Verdict::Inconclusive);
        let own = deviations(&Table(vec![
            (unclear, false, &["one"]),
            (passed, true, &[]),
        ]));
        assert!(own.0.starts_with("deviations: not known"), "{}", own.0);
        assert_eq!(own.1, Verdict::Inconclusive);
    }
}
