//! Drives that share a segment: which known deviation explains every attempt of a qualification.
//!
//! A bus supplies its attempts and what it knows of wrong drives ([`Note`]); the rules when a deviation is named are the same for all.

use super::walk::DriveWalk;
use crate::counted::counted;
use crate::rig::Rig;
use crate::rig::playing::Qualified;
use crate::rig::profile::{Profile, ProfileLines};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use include_dir::{Dir, File};
use std::collections::{BTreeMap, BTreeSet};

/// Maximum number of deviations listed if several explain everything.
const MOST_TOLD: usize = 8;

/// The prefix of the names of a qualification's conversations.
pub const CONVERSATION: &str = "qualify-";

/// The conversations that are kept in a folder, in which what stands for a drive is `filled` in. `drive` is its name as the header of a scenario has
/// it; empty where it is alone.
pub fn kept(folder: &Dir<'_>, drive: &str, filled: impl Fn(&str) -> String) -> Vec<Source> {
    let mut files: Vec<_> = folder.files().collect();
    files.sort_by_key(|file| file.path().to_owned());
    let source = |file: &File<'_>| {
        let name = file.path().file_stem()?.to_str()?;
        let name = format!("{CONVERSATION}{name} {drive}");
        Some(Source {
            name: name.trim_end().replace(' ', "-"),
            text: filled(file.contents_utf8()?).into(),
        })
    };
    files.into_iter().filter_map(source).collect()
}

/// An attempt at a scenario, as a bus keeps it to compare models with it.
pub trait Note {
    /// A known way in which a drive may be wrong.
    type Deviation: ?Sized + 'static;

    fn deviations() -> Vec<&'static Self::Deviation>;

    /// Its name, section and effect.
    fn words(deviation: &Self::Deviation) -> String;

    /// The part that is the same for all buses.
    fn noted(&self) -> &AttemptSummary;

    /// Its drives, as the header of a scenario names them.
    fn drives(&self) -> Vec<String>;

    /// Whether right drives would have shown the same, with some values of what the manual leaves open.
    fn is_right(&self) -> bool;

    /// Whether drives would have shown the same if the one at this place had a deviation; `None` if the comparison was not completed.
    fn explains(&self, place: usize, deviation: &'static Self::Deviation) -> Option<bool>;
}

/// An attempt, without what only its bus knows.
#[derive(Clone, Debug)]
pub struct AttemptSummary {
    pub name: String,
    /// The scenario's verdict; skipped if the drives were only asked for their registers.
    pub verdict: Verdict,
    /// Whether the drives did something that no right drive is known to do.
    pub accuses: bool,
    /// Whether time is virtual: then what came is compared with a model, whatever the verdict.
    pub exact: bool,
    /// Number of frames or telegrams received.
    pub received: usize,
    /// Whether the drives became ready and the scenario was played.
    pub was_ready: bool,
    /// Whether the drives did not become ready.
    pub was_unanswered: bool,
}

impl AttemptSummary {
    /// Whether the scenario was played, or the drives did not become ready for it.
    #[must_use]
    pub const fn was_tried(&self) -> bool {
        self.was_ready || self.was_unanswered
    }

    /// Whether it shows nothing of the drives if the scenario is played again.
    fn showed_nothing(&self) -> bool {
        [Verdict::Inconclusive, Verdict::Marginal].contains(&self.verdict) || self.was_unanswered
    }
}

/// The attempts of a qualification that were begun, in order.
pub struct Attempts<'n, N> {
    notes: Vec<&'n N>,
    /// For each note, whether another one speaks for it.
    spoken_for: Vec<bool>,
    /// For each note, whether it repeats what another part has played.
    repeats: Vec<bool>,
    /// Lines that say what of the drives was walked and what was not; empty if nothing was.
    walks: String,
}

impl<'n, N: Note> Attempts<'n, N> {
    /// The attempts of the parts of a qualification, and the walks of its drives by inputs with these names.
    pub fn new<'w, S: Ord + 'w>(
        parts: &[Vec<&'n N>],
        walks: impl Iterator<Item = &'w DriveWalk<S>>,
        inputs: &[&str],
    ) -> Self {
        let key = |noted: &'n AttemptSummary| (&*noted.name, noted.verdict);
        let repeats = repeats(parts, |note| key(note.noted()));
        let notes = parts.concat();
        let verdicts: Vec<_> = notes.iter().map(|note| key(note.noted())).collect();
        let walks = walks.map(|walk| walk.told(inputs, CONVERSATION, &verdicts));
        let walks = walks.collect();
        let spoken_for = spoken_for(&notes, |note| {
            let noted = note.noted();
            (&noted.name, noted.showed_nothing(), noted.was_ready)
        });
        Self {
            notes,
            spoken_for,
            repeats,
            walks,
        }
    }

    fn attempted(&self) -> Vec<AttemptVerdict> {
        let other = self.repeats.iter().zip(&self.spoken_for);
        let all = self.notes.iter().map(|note| note.noted()).zip(other);
        let all = all.map(|(noted, (repeats, spoken_for))| AttemptVerdict {
            verdict: noted.verdict,
            accuses: noted.accuses && !spoken_for,
            exact: noted.exact,
            received: noted.received,
            repeats: *repeats || *spoken_for,
        });
        all.collect()
    }

    /// Every deviation of every drive, with the drive's place and name.
    fn deviations(&self) -> Vec<(usize, String, &'static N::Deviation)> {
        let drives = self.notes.first().map_or(Vec::new(), |note| note.drives());
        let each = drives.into_iter().enumerate().flat_map(|(place, drive)| {
            let all = N::deviations().into_iter();
            all.map(move |deviation| (place, drive.clone(), deviation))
        });
        each.collect()
    }
}

/// One attempt at a scenario.
#[derive(Clone, Copy, Debug)]
struct AttemptVerdict {
    verdict: Verdict,
    accuses: bool,
    exact: bool,
    received: usize,
    /// Whether another attempt speaks for it, or an earlier part of the qualification has played the same conversation with the same
    /// verdict. It is judged, but not counted.
    repeats: bool,
}

/// What the attempts show of the drives.
#[derive(Debug)]
enum Diagnosis {
    /// No attempt accuses a drive.
    None,
    /// Drives did not become ready, and no deviation explains it.
    Unready,
    /// The words of the deviations that explain all that was compared.
    Explained(Vec<String>),
}

/// Names the deviations that explain every attempt that accuses a drive, and every one that passed. Where time is virtual, an attempt that
/// passed counts too if correct drives do not explain what came; but it alone accuses no drive.
fn named<N: Note>(all: &Attempts<'_, N>, attempts: &[AttemptVerdict]) -> Diagnosis {
    let both = attempts.iter().zip(&all.notes);
    let right = [Verdict::Passed, Verdict::Skipped];
    let compared = both.filter(|(attempt, _)| attempt.accuses || right.contains(&attempt.verdict));
    let (unlike, alike): (Vec<_>, Vec<_>) = compared
        .partition(|(attempt, note)| (attempt.accuses || attempt.exact) && !note.is_right());
    if unlike.is_empty() {
        return Diagnosis::None;
    }
    let explaining = all
        .deviations()
        .into_iter()
        .filter(|(place, _, deviation)| {
            let mut shown = false;
            let mut unlike = unlike.iter();
            let could = unlike.all(|(_, note)| {
                let explains = note.explains(*place, deviation);
                shown |= explains == Some(true);
                explains != Some(false)
            });
            let mut alike = alike.iter();
            could && shown && alike.all(|(_, note)| note.explains(*place, deviation) != Some(false))
        });
    let explaining = explaining.map(|(_, drive, wrong)| format!("{drive}: {}", N::words(wrong)));
    let explaining: Vec<_> = explaining.collect();
    let accused = unlike.iter().any(|(attempt, _)| attempt.accuses);
    let unready = unlike.iter().all(|(_, note)| note.noted().was_unanswered);
    match explaining.len() {
        0 if accused && unready => Diagnosis::Unready,
        1 => Diagnosis::Explained(explaining),
        _ if accused => Diagnosis::Explained(explaining),
        _ => Diagnosis::None,
    }
}

/// A point that the manual leaves open, and what a drive has shown of it.
pub struct Point<'p> {
    /// The drive, as the header of a scenario names it.
    pub drive: String,
    pub name: &'p str,
    /// The section, with the document.
    pub section: String,
    /// Its value, or why none was settled.
    pub value: Result<String, String>,
}

/// The points as all parts of a qualification have shown them, and the contradictions between parts in sentences. Every part has the same points
/// in the same order. A value counts where other parts have shown none.
fn agreed<'p>(parts: Vec<Vec<Point<'p>>>) -> (Vec<Point<'p>>, Vec<String>) {
    let values = |place: usize| -> BTreeSet<String> {
        let shown = parts.iter().filter_map(|part| part.get(place));
        shown.filter_map(|point| point.value.clone().ok()).collect()
    };
    let all: Vec<_> = (0..parts.first().map_or(0, Vec::len)).map(values).collect();
    let mut points = parts.into_iter().next().unwrap_or_default();
    let mut contradictions = Vec::new();
    for (point, mut values) in points.iter_mut().zip(all) {
        if values.len() > 1 {
            let values: Vec<_> = values.into_iter().collect();
            let differ = format!("its values differ from part to part: {}", values.join(", "));
            contradictions.push(format!("{}, {}: {differ}", point.drive, point.name));
            point.value = Err(differ);
        } else if let Some(value) = values.pop_first() {
            point.value = Ok(value);
        }
    }
    (points, contradictions)
}

/// For each attempt of these parts, in order, whether an earlier part has one with the same key.
fn repeats<N, K: Ord>(parts: &[Vec<N>], of: impl Fn(&N) -> K) -> Vec<bool> {
    let mut before = BTreeSet::new();
    let mut all = Vec::new();
    for part in parts {
        let attempts: Vec<_> = part.iter().map(&of).collect();
        all.extend(attempts.iter().map(|attempt| before.contains(attempt)));
        before.extend(attempts);
    }
    all
}

/// For each attempt, whether another one of the same scenario speaks for it: it showed nothing, perhaps because of the computer, the adapter
/// or the line, and there is a later one, or one whose drives were ready. `of` gives the name, whether it showed nothing, and was ready.
fn spoken_for<N>(notes: &[N], of: impl Fn(&N) -> (&str, bool, bool)) -> Vec<bool> {
    let attempts = notes.chunk_by(|one, next| of(one).0 == of(next).0);
    let spoken = attempts.flat_map(|attempts| {
        let ready = attempts.iter().any(|note| of(note).2);
        let of = &of;
        attempts.iter().enumerate().map(move |(place, note)| {
            let last = place + 1 == attempts.len();
            of(note).1 && (!last || ready && !of(note).2)
        })
    });
    spoken.collect()
}

/// The profile of drives, merged from all parts of a qualification.
pub struct MergedProfile {
    /// `None` if the drives were not asked.
    profile: Option<Profile<ProfileLines>>,
    /// The contradictions between the parts of a qualification, in sentences.
    contradictions: Vec<String>,
}

/// Merges the points that each part of a qualification has shown into the profile of a rig's drives. A part without points has asked no drive.
pub fn profile(rig: &Rig, began: &str, mut parts: Vec<Vec<Point<'_>>>) -> MergedProfile {
    parts.retain(|points| !points.is_empty());
    let asked = !parts.is_empty();
    let (points, contradictions) = agreed(parts);
    MergedProfile {
        profile: asked.then(|| of_points(rig, began, points)),
        contradictions,
    }
}

fn of_points(rig: &Rig, began: &str, points: Vec<Point<'_>>) -> Profile<ProfileLines> {
    let drives = rig.port().map_or(0, |port| port.drives.len());
    let mut profile = Profile {
        schema: 1,
        rig: rig.id().to_owned(),
        date: began.to_owned(),
        rings: vec![u8::try_from(drives).unwrap_or(u8::MAX)],
        property: BTreeMap::new(),
        open: BTreeMap::new(),
    };
    for point in points {
        let drive = &point.drive;
        match point.value {
            Ok(value) => {
                let line = format!("{drive} property {} = {value}", point.name);
                let value = format!("{drive}: {value}");
                profile.settle(point.name, &point.section, &value, &vec![line]);
            }
            Err(why) => profile.leave_open(point.name, &format!("{drive}: {why}")),
        }
    }
    profile
}

/// The result of a qualification. `frames` is the singular noun for what is received, `known` are the deviations that the rig's file names,
/// and `whole` says whether everything was played.
pub fn qualified<N: Note>(
    all: &Attempts<'_, N>,
    profiled: MergedProfile,
    frames: &str,
    known: &[String],
    whole: bool,
) -> Qualified {
    let MergedProfile {
        profile,
        contradictions,
    } = profiled;
    let attempts = all.attempted();
    let named = named(all, &attempts);
    let settled = profile.as_ref().map_or(0, |profile| profile.property.len());
    let open = profile.as_ref().map_or(0, |profile| profile.open.len());
    let numbered = || attempts.iter().enumerate();
    let counted_once = || numbered().filter(|(_, attempt)| !attempt.repeats);
    let verdicts = |verdict| counted_once().filter(move |(_, attempt)| attempt.verdict == verdict);
    let failed = verdicts(Verdict::Failed).count();
    let passed = verdicts(Verdict::Passed).count();
    let unclear = |(place, attempt): &(usize, &AttemptVerdict)| {
        let settled = [Verdict::Passed, Verdict::Failed, Verdict::Skipped];
        !(settled.contains(&attempt.verdict) || attempt.exact && all.notes[*place].is_right())
    };
    let inconclusive = counted_once().filter(unclear).count();
    let tried = counted_once().count() - verdicts(Verdict::Skipped).count();
    let received: usize = counted_once().map(|(_, attempt)| attempt.received).sum();
    let mut text = match &named {
        Diagnosis::Explained(all) if all.is_empty() => {
            "deviations: the drives differ from the model, and no single known deviation explains it\n".to_owned()
        }
        Diagnosis::Explained(all) => all
            .iter()
            .take(MOST_TOLD)
            .map(|deviation| format!("deviation: {deviation}\n"))
            .collect(),
        Diagnosis::Unready => {
            "deviations: not known; the drives did not become ready, and no known deviation explains it: the line, its adapter or the computer may be the cause\n".to_owned()
        }
        Diagnosis::None if !contradictions.is_empty() => {
            "deviations: not known; the parts of the qualification show drives that differ\n"
                .to_owned()
        }
        Diagnosis::None if inconclusive > 0 || tried == 0 || !whole => {
            "deviations: not known; no drive is known to be at fault, but not everything was compared and equal\n".to_owned()
        }
        Diagnosis::None if failed > 0 => {
            "deviations: not known; attempts failed, and correct drives with other values of what the manual leaves open explain each of them\n".to_owned()
        }
        Diagnosis::None if known.is_empty() => {
            "deviations: none; everything received is as the model of the manual says\n".to_owned()
        }
        Diagnosis::None => format!(
            "deviations: none beside the known ones ({})\n",
            known.join(", ")
        ),
    };
    let several = match &named {
        Diagnosis::Explained(all) => all.len(),
        Diagnosis::Unready | Diagnosis::None => 0,
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
    for contradiction in &contradictions {
        text.push_str(&format!("  {contradiction}\n"));
    }
    text.push_str(&format!(
        "compared: {passed} of {} passed, {failed} failed, {inconclusive} inconclusive; {} received; {settled} of {} settled\n",
        counted(tried, "attempt"),
        counted(received, frames),
        counted(settled + open, "open point"),
    ));
    text.push_str(&all.walks);
    if !whole {
        text.push_str("the run ended before everything was played\n");
    }
    Qualified {
        profile: profile.map(|profile| toml::to_string(&profile).unwrap_or_default()),
        deviations: text,
        verdict: match named {
            _ if failed > 0 => Verdict::Failed,
            Diagnosis::Explained(all) if all.len() == 1 => Verdict::Failed,
            Diagnosis::Explained(_) | Diagnosis::Unready => Verdict::Inconclusive,
            Diagnosis::None if inconclusive > 0 || !whole || !contradictions.is_empty() => {
                Verdict::Inconclusive
            }
            Diagnosis::None => Verdict::Passed,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Verdict::{Failed, Inconclusive, Passed};

    /// An attempt, whether right drives explain it, and the deviations that do; none where that was not compared.
    struct AttemptRow(AttemptSummary, bool, &'static [&'static str]);

    impl Note for AttemptRow {
        type Deviation = str;

        fn deviations() -> Vec<&'static str> {
            vec!["one", "two"]
        }

        fn words(deviation: &str) -> String {
            deviation.to_owned()
        }

        fn noted(&self) -> &AttemptSummary {
            &self.0
        }

        fn drives(&self) -> Vec<String> {
            vec!["drive 1".to_owned()]
        }

        fn is_right(&self) -> bool {
            self.1
        }

        fn explains(&self, _: usize, deviation: &'static str) -> Option<bool> {
            (!self.2.is_empty()).then(|| self.2.contains(&deviation))
        }
    }

    /// Attempts at scenarios with these names.
    fn rows(attempts: &[(&str, Verdict, bool, &'static [&'static str])]) -> Vec<AttemptRow> {
        let row = |(name, verdict, right, explain): &(&str, Verdict, bool, &'static [_])| {
            let noted = AttemptSummary {
                name: (*name).to_owned(),
                verdict: *verdict,
                accuses: *verdict == Failed,
                exact: false,
                received: 3,
                was_ready: true,
                was_unanswered: false,
            };
            AttemptRow(noted, *right, explain)
        };
        attempts.iter().map(row).collect()
    }

    fn found(parts: &[Vec<AttemptRow>], contradictions: &[&str]) -> (String, Verdict) {
        let profiled = MergedProfile {
            profile: None,
            contradictions: contradictions.iter().copied().map(str::to_owned).collect(),
        };
        let parts = parts.iter().map(|part| part.iter().collect());
        let none = std::iter::empty::<&DriveWalk<u8>>();
        let all = Attempts::new(&parts.collect::<Vec<_>>(), none, &[]);
        let qualified = qualified(&all, profiled, "frame", &[], true);
        (qualified.deviations, qualified.verdict)
    }

    fn deviations(
        attempts: &[(&str, Verdict, bool, &'static [&'static str])],
    ) -> (String, Verdict) {
        found(&[rows(attempts)], &[])
    }

    /// One is named where it alone explains what failed and what passed.
    #[test]
    fn one_deviation_is_named_where_it_alone_explains_everything() {
        let both: &[&str] = &["one", "two"];
        let named = deviations(&[("a", Failed, false, both), ("b", Passed, true, &["two"])]);
        let expected = "deviation: drive 1: two\ncompared: 1 of 2 attempts passed";
        assert!(named.0.starts_with(expected), "{}", named.0);
        assert_eq!(named.1, Failed);
        let several = deviations(&[("a", Failed, false, both), ("b", Passed, true, both)]).0;
        assert!(several.contains("does not tell which one"), "{several}");
        let none = deviations(&[
            ("a", Failed, false, &["one"]),
            ("b", Passed, true, &["two"]),
        ]);
        assert!(none.0.contains("no single known deviation"), "{}", none.0);
    }

    /// What was not compared explains nothing by itself, and refutes nothing.
    #[test]
    fn what_is_not_compared_names_nothing() {
        let unknown = ("a", Failed, false, &[][..]);
        let none = deviations(&[unknown]).0;
        assert!(none.contains("no single known deviation"), "{none}");
        let one = deviations(&[unknown, ("b", Failed, false, &["one"])]).0;
        let expected = "deviation: drive 1: one\ncompared";
        assert!(one.starts_with(expected), "{one}");
    }

    /// Drives that gave no answer once, and were played on before, are not accused of it: the computer or the line may have been the cause.
    #[test]
    fn an_attempt_speaks_for_one_that_showed_nothing() {
        let spoken = |attempts: &[(&'static str, bool, bool)]| spoken_for(attempts, |row| *row);
        let (shown, silent, unclear) = (("a", false, true), ("a", true, false), ("a", true, true));
        assert_eq!(spoken(&[silent, shown]), [true, false]);
        assert_eq!(spoken(&[unclear, silent]), [true, true]);
        assert_eq!(spoken(&[silent, silent, silent]), [true, true, false]);
        assert_eq!(spoken(&[unclear, unclear]), [true, false]);
        assert_eq!(spoken(&[shown, ("b", true, false)]), [false, false]);
    }

    /// Nothing is named for drives that nothing accuses.
    #[test]
    fn correct_drives_are_not_named() {
        let (text, verdict) = deviations(&[("a", Passed, true, &["one"])]);
        assert!(text.starts_with("deviations: none;"), "{text}");
        assert_eq!(verdict, Passed);
        let (text, verdict) = deviations(&[
            ("a", Inconclusive, false, &["one"]),
            ("b", Passed, true, &["two"]),
        ]);
        assert!(text.starts_with("deviations: not known"), "{text}");
        assert_eq!(verdict, Inconclusive);
    }

    fn point(value: Result<&str, &str>) -> Point<'static> {
        Point {
            drive: "drive 1".to_owned(),
            name: "event-edges",
            section: "5.2".to_owned(),
            value: value.map(str::to_owned).map_err(str::to_owned),
        }
    }

    /// A part that has shown nothing contradicts no other; a contradiction is not settled by a third part.
    #[test]
    fn a_value_that_differs_from_part_to_part_is_open() {
        let agreed = |values: &[Result<&str, &str>]| {
            let parts = values.iter().map(|value| vec![point(*value)]);
            let (points, contradictions) = agreed(parts.collect());
            (points[0].value.clone(), contradictions.len())
        };
        let (both, open) = (Ok("both"), Err("not asked"));
        assert_eq!(agreed(&[open, both]), (Ok("both".to_owned()), 0));
        assert_eq!(agreed(&[both, open]), (Ok("both".to_owned()), 0));
        assert_eq!(agreed(&[both, both]), (Ok("both".to_owned()), 0));
        let (value, contradictions) = agreed(&[both, Ok("rising"), open, both]);
        let differ = "its values differ from part to part: both, rising";
        assert_eq!((value, contradictions), (Err(differ.to_owned()), 1));
    }

    /// Drives that are right by themselves and differ from part to part are not said to be right.
    #[test]
    fn parts_that_contradict_each_other_are_never_passed() {
        let passed = rows(&[("a", Passed, true, &["one"])]);
        let (text, verdict) = found(&[passed], &["drive 1, event-edges: they differ"]);
        let expected = "deviations: not known; the parts of the qualification show drives that differ\n  drive 1, event-edges: they differ\n";
        assert!(text.starts_with(expected), "{text}");
        assert_eq!(verdict, Inconclusive);
    }

    /// Drives that did not become ready are not said to differ: the line may be the cause.
    #[test]
    fn drives_that_do_not_become_ready_are_not_accused() {
        let silent = |explain| {
            let mut rows = rows(&[("a", Inconclusive, false, explain)]);
            let noted = &mut rows[0].0;
            (noted.accuses, noted.was_ready, noted.was_unanswered) = (true, false, true);
            found(&[rows], &[])
        };
        let (text, verdict) = silent(&["three"]);
        assert!(
            text.starts_with("deviations: not known; the drives did not become ready"),
            "{text}"
        );
        assert_eq!(verdict, Inconclusive);
        let (text, _) = silent(&["one"]);
        assert!(text.starts_with("deviation: drive 1: one\n"), "{text}");
    }

    /// A part of wrong drives and a part of right ones: no deviation explains both.
    #[test]
    fn no_deviation_explains_a_right_and_a_wrong_drive() {
        let (text, verdict) = deviations(&[
            ("a", Passed, true, &["two"]),
            ("b", Failed, false, &["one"]),
        ]);
        let expected =
            "deviations: the drives differ from the model, and no single known deviation";
        assert!(text.starts_with(expected), "{text}");
        assert_eq!(verdict, Failed);
    }

    /// What a second part has played again is judged, and counted once; another verdict is counted.
    #[test]
    fn what_parts_repeat_is_counted_once() {
        let (passed, failed) = (("state", Passed), ("state", Failed));
        let repeated = repeats(&[vec![passed, passed], vec![passed, failed]], |row| *row);
        assert_eq!(repeated, [false, false, true, false]);
        let part = || rows(&[("state", Passed, true, &["one"])]);
        let (text, _) = found(&[part(), part()], &[]);
        let counts = "compared: 1 of 1 attempt passed, 0 failed, 0 inconclusive; 3 frames received";
        assert!(text.contains(counts), "{text}");
    }
}
