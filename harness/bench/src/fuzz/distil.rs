//! Distils inputs: the few small ones that reach everything which all of them reach, by the names of `harness_sim::fuzz::Feature`.

use harness_sim::fuzz::{Body, Feature, InputPieces, features};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Write as _;

/// How many bytes a line of a file holds, where an input has no records.
const BYTES_A_LINE: usize = 16;

/// Maximum number of features that a file names: a list of a hundred is not read.
const NAMED: usize = 8;

/// The cost of a file in addition to its bytes, in bytes: a few inputs with many features are better than many inputs with one feature.
const FILE: usize = 64;

/// The same for texts, which can less often be joined.
const TEXT_FILE: usize = 4_096;

/// Maximum number of bytes of a joined input.
const MOST_JOINED: usize = 256;

/// The same of a text.
const MOST_JOINED_TEXT: usize = 1_500;

/// Maximum number of attempts to shrink one input.
const MOST_TRIES: usize = 20_000;

/// An input that is worth keeping.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeptInput {
    /// The input as the target takes it.
    pub input: Vec<u8>,
    /// What it reaches and those before it do not, in the manual's order.
    pub new: Vec<Feature>,
}

impl KeptInput {
    /// A name for its file, without ending: that of the first thing that is new.
    #[must_use]
    pub fn name(&self) -> String {
        self.new.first().map(Feature::file_name).unwrap_or_default()
    }

    /// The extension of its file: that of a text if the input is one, else `hex`.
    #[must_use]
    pub fn ending(&self, pieces: InputPieces) -> &'static str {
        match pieces {
            InputPieces::Text(ending) if is_text(&self.input) => ending,
            _ => "hex",
        }
    }

    /// The content of its file: a text unchanged; for bytes, the new features as comments, then the bytes, one record per line.
    #[must_use]
    pub fn content(&self, pieces: InputPieces) -> Vec<u8> {
        if self.ending(pieces) != "hex" {
            return self.input.clone();
        }
        let mut text = String::from("# reaches first:\n");
        // Writing to a String cannot fail.
        for feature in self.new.iter().take(NAMED) {
            let _infallible = writeln!(text, "#   {feature}");
        }
        if self.new.len() > NAMED {
            let _infallible = writeln!(text, "#   and {} more", self.new.len() - NAMED);
        }
        let (head, record) = match pieces {
            InputPieces::Bytes { head, record } if record > 1 => (head, record),
            _ => (0, BYTES_A_LINE),
        };
        let (head, records) = self.input.split_at(head.min(self.input.len()));
        for line in [head]
            .into_iter()
            .chain(records.chunks(record))
            .filter(|line| !line.is_empty())
        {
            let digits: Vec<_> = line.iter().map(|byte| format!("{byte:02X}")).collect();
            let _infallible = writeln!(text, "{}", digits.join(" "));
        }
        text.into_bytes()
    }
}

/// Whether bytes can be kept as a text: nothing in them that an editor hides, and it ends with its last line.
fn is_text(bytes: &[u8]) -> bool {
    let shown = |text: &str| {
        text.chars()
            .all(|letter| letter == '\n' || !letter.is_control())
    };
    !bytes.is_empty() && std::str::from_utf8(bytes).is_ok_and(shown)
}

/// Chooses inputs that reach features not in `kept`. Repeatedly takes the input with the most new features for its size and shrinks it
/// without losing one of these features. Joins inputs where possible and drops those whose features the others reach too. The order of
/// `inputs` does not change the result.
///
/// # Panics
/// An input, or a part of one, breaks a rule of the target.
pub fn distil(
    body: Body,
    pieces: InputPieces,
    inputs: &[Vec<u8>],
    kept: &BTreeSet<Feature>,
) -> Vec<KeptInput> {
    let mut sorted: Vec<_> = inputs.iter().collect();
    sorted.sort_by_key(|input| (input.len(), *input));
    sorted.dedup();
    let mut left: Vec<_> = sorted
        .into_iter()
        .map(|input| (input, &features(body, input) - kept))
        .collect();
    let file = match pieces {
        InputPieces::Bytes { .. } => FILE,
        InputPieces::Text(_) => TEXT_FILE,
    };
    let mut chosen = Vec::new();
    loop {
        left.retain(|(_, new)| !new.is_empty());
        // Of equal ones, the first is the shortest.
        let worth = |(input, new): &(&Vec<u8>, BTreeSet<Feature>)| {
            new.len() * 10_000 / (input.len() + file)
        };
        let Some((input, wanted)) = left.iter().rev().max_by_key(|input| worth(input)) else {
            return named(needed(joined(body, pieces, chosen, kept), kept), kept);
        };
        let input = Shrinking::new(body, wanted).shrunk(pieces, input);
        let reached = features(body, &input);
        for (_, new) in &mut left {
            new.retain(|feature| !reached.contains(feature));
        }
        chosen.push((input, reached));
    }
}

/// An input and all features that it reaches.
type InputFeatures = (Vec<u8>, BTreeSet<Feature>);

/// Joins two inputs. The head of the first one serves both; a line that the first text already has is not repeated.
fn together(pieces: InputPieces, first: &[u8], second: &[u8]) -> Option<Vec<u8>> {
    let (rest, most) = match pieces {
        InputPieces::Bytes { head, .. } => (second.get(head..)?.to_vec(), MOST_JOINED),
        InputPieces::Text(_) => {
            let lines: BTreeSet<_> = first.split_inclusive(|byte| *byte == b'\n').collect();
            let others = second.split_inclusive(|byte| *byte == b'\n');
            let others: Vec<_> = others.filter(|line| !lines.contains(line)).collect();
            (others.concat(), MOST_JOINED_TEXT)
        }
    };
    let both = [first, &rest].concat();
    (!rest.is_empty() && both.len() <= most).then_some(both)
}

/// Joins inputs if no feature is lost: one conversation is better than ten.
fn joined(
    body: Body,
    pieces: InputPieces,
    chosen: Vec<InputFeatures>,
    kept: &BTreeSet<Feature>,
) -> Vec<InputFeatures> {
    let mut joined: Vec<InputFeatures> = Vec::new();
    let mut left: VecDeque<_> = chosen.into();
    while let Some((input, reached)) = left.pop_front() {
        let place = (0..joined.len()).find_map(|place| {
            let (first, reached_first) = &joined[place];
            let both = together(pieces, first, &input)?;
            let reached_both = features(body, &both);
            let others = joined.iter().enumerate();
            let others = others.filter(|(other, _)| *other != place);
            let others = others.map(|(_, (_, reached))| reached);
            let others: Vec<_> = others
                .chain(left.iter().map(|(_, reached)| reached))
                .collect();
            let safe = |feature: &Feature| {
                reached_both.contains(feature)
                    || kept.contains(feature)
                    || others.iter().any(|other| other.contains(feature))
            };
            let all_safe = reached.iter().chain(reached_first).all(safe);
            all_safe.then_some((place, (both, reached_both)))
        });
        match place {
            Some((place, both)) => joined[place] = both,
            None => joined.push((input, reached)),
        }
    }
    joined
}

/// Those that reach something which neither the others nor `kept` do, in their order.
fn needed(mut chosen: Vec<InputFeatures>, kept: &BTreeSet<Feature>) -> Vec<InputFeatures> {
    for place in (0..chosen.len()).rev() {
        let others = chosen
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != place);
        let others: Vec<_> = others.map(|(_, (_, reached))| reached).collect();
        let reached_by_others = |feature: &Feature| {
            kept.contains(feature) || others.iter().any(|reached| reached.contains(feature))
        };
        if chosen[place].1.iter().all(reached_by_others) {
            chosen.remove(place);
        }
    }
    chosen
}

/// Each input with its new features.
fn named(chosen: Vec<InputFeatures>, kept: &BTreeSet<Feature>) -> Vec<KeptInput> {
    let mut before = kept.clone();
    let new = |(input, reached): InputFeatures| {
        let new = (&reached - &before).into_iter().collect();
        before.extend(reached);
        KeptInput { input, new }
    };
    chosen.into_iter().map(new).collect()
}

/// Of inputs that were distilled, as the `--` in their names says, those that reach nothing which the others do not.
///
/// # Panics
/// An input breaks a rule of the target.
pub fn superfluous(body: Body, inputs: &[(String, Vec<u8>)]) -> Vec<String> {
    let reached: Vec<_> = inputs
        .iter()
        .map(|(_, input)| features(body, input))
        .collect();
    let mut counts = BTreeMap::new();
    for feature in reached.iter().flatten() {
        *counts.entry(feature).or_insert(0_usize) += 1;
    }
    let idle = |features: &BTreeSet<Feature>| features.iter().all(|feature| counts[feature] > 1);
    let named = inputs.iter().zip(&reached);
    let idle = named.filter(|((name, _), features)| name.contains("--") && idle(features));
    idle.map(|((name, _), _)| name.clone()).collect()
}

/// Shrinks an input without losing the wanted features.
struct Shrinking<'w> {
    body: Body,
    wanted: &'w BTreeSet<Feature>,
    tries: usize,
}

impl<'w> Shrinking<'w> {
    fn new(body: Body, wanted: &'w BTreeSet<Feature>) -> Self {
        Self {
            body,
            wanted,
            tries: MOST_TRIES,
        }
    }

    fn reaches(&mut self, input: &[u8]) -> bool {
        self.tries = self.tries.saturating_sub(1);
        self.tries > 0 && features(self.body, input).is_superset(self.wanted)
    }

    fn shrunk(&mut self, pieces: InputPieces, input: &[u8]) -> Vec<u8> {
        match pieces {
            InputPieces::Bytes { head, record } => {
                let (head, records) = input.split_at(head.min(input.len()));
                let mut pieces: Vec<_> = records.chunks(record).map(<[u8]>::to_vec).collect();
                self.leave_out(head, &mut pieces);
                let mut input = [head, &pieces.concat()].concat();
                self.plain(&mut input);
                input
            }
            InputPieces::Text(_) if is_text(input) => {
                let text = String::from_utf8_lossy(input);
                let mut lines: Vec<_> = text
                    .split_inclusive('\n')
                    .map(|line| line.as_bytes().to_vec())
                    .collect();
                self.leave_out(&[], &mut lines);
                let text = String::from_utf8_lossy(&lines.concat()).into_owned();
                let words = text.split_inclusive([' ', '\n', ',']);
                let mut words: Vec<_> = words.map(|word| word.as_bytes().to_vec()).collect();
                self.leave_out(&[], &mut words);
                words.concat()
            }
            InputPieces::Text(_) => {
                let mut bytes: Vec<_> = input.iter().map(|byte| vec![*byte]).collect();
                self.leave_out(&[], &mut bytes);
                bytes.concat()
            }
        }
    }

    /// Leaves out pieces that are not needed: halves first, single ones last.
    fn leave_out(&mut self, head: &[u8], pieces: &mut Vec<Vec<u8>>) {
        let mut size = pieces.len().div_ceil(2);
        while size > 0 {
            let mut place = 0;
            while place + size <= pieces.len() {
                let rest = [&pieces[..place], &pieces[place + size..]].concat();
                if self.reaches(&[head, &rest.concat()].concat()) {
                    *pieces = rest;
                } else {
                    place += size;
                }
            }
            size /= 2;
        }
    }

    /// Puts 00 for each byte that may be anything.
    fn plain(&mut self, input: &mut [u8]) {
        for place in 0..input.len() {
            let byte = std::mem::take(&mut input[place]);
            if byte != 0 && !self.reaches(input) {
                input[place] = byte;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_sim::novobus::fuzz::NOTING;

    const BYTES: InputPieces = InputPieces::Bytes { head: 1, record: 1 };

    fn detector() -> Body {
        let target = NOTING.iter().find(|target| target.name == "detector");
        target.expect("a target").body
    }

    fn reach(inputs: &[Vec<u8>]) -> BTreeSet<Feature> {
        inputs
            .iter()
            .flat_map(|input| features(detector(), input))
            .collect()
    }

    fn inputs() -> Vec<Vec<u8>> {
        vec![
            // SYNCO; SYNCO and PAUSE, with bytes that add nothing; a zero; an address byte.
            vec![0, 0x80],
            vec![0, 0x80, 0x80, 0x80, 0x81, 0x80, 0x81],
            vec![0, 0],
            vec![0, 0x88, 0xFF, 0x00],
        ]
    }

    #[test]
    fn nothing_is_lost_and_nothing_is_idle() {
        let none = BTreeSet::new();
        let inputs = inputs();
        let distilled = distil(detector(), BYTES, &inputs, &none);
        let chosen: Vec<_> = distilled.iter().map(|input| input.input.clone()).collect();
        // Joined, they reach even more; without any one of them a feature is lost.
        assert!(reach(&chosen).is_superset(&reach(&inputs)));
        assert!(chosen.len() < inputs.len(), "{chosen:02X?}");
        for place in 0..chosen.len() {
            let others = [&chosen[..place], &chosen[place + 1..]].concat();
            assert!(
                !reach(&others).is_superset(&reach(&inputs)),
                "{chosen:02X?}"
            );
        }
        let mut reversed = inputs.clone();
        reversed.reverse();
        assert_eq!(distil(detector(), BYTES, &reversed, &none), distilled);
        assert_eq!(distil(detector(), BYTES, &inputs, &reach(&inputs)), []);
    }

    /// What the greedy choice takes first may be reached by the later ones together.
    #[test]
    fn what_the_others_reach_is_left_out() {
        let feature = |name: &'static str| Feature::new("", "place", name);
        let of = |names: &[&'static str]| names.iter().map(|name| feature(name)).collect();
        let chosen = vec![
            (vec![1], of(&["b", "c"])),
            (vec![2], of(&["a", "b"])),
            (vec![3], of(&["c", "d"])),
        ];
        let left = named(needed(chosen, &BTreeSet::new()), &BTreeSet::new());
        let inputs: Vec<_> = left.iter().map(|input| input.input.clone()).collect();
        assert_eq!(inputs, [[2], [3]]);
        assert_eq!(left[0].new, [feature("a"), feature("b")]);
        assert_eq!(left[1].new, [feature("c"), feature("d")]);
    }

    /// The head is that of the first, and no line is repeated.
    #[test]
    fn what_is_put_together() {
        assert_eq!(together(BYTES, &[1, 2], &[3, 4]), Some(vec![1, 2, 4]));
        assert_eq!(together(BYTES, &[1, 2], &[3]), None);
        assert_eq!(together(BYTES, &[0; MOST_JOINED], &[0; 2]), None);
        let both = together(
            InputPieces::Text("scn"),
            b"ring 3\n> 80\n",
            b"ring 3\n> 81\n",
        );
        assert_eq!(both.as_deref(), Some(&b"ring 3\n> 80\n> 81\n"[..]));
    }

    #[test]
    fn a_file_that_reaches_nothing_more_is_named() {
        let named = |name: &str, input: &[u8]| (name.to_owned(), input.to_vec());
        let files = [
            named("a--b.hex", &[0, 0x80]),
            named("typed.hex", &[0, 0x80, 0x81]),
            named("c--d.hex", &[0, 0]),
        ];
        assert_eq!(superfluous(detector(), &files), ["a--b.hex"]);
    }

    #[test]
    fn a_file_says_what_it_is_for_and_can_be_read_back() {
        let one = distil(detector(), BYTES, &[vec![0, 0x80]], &BTreeSet::new()).remove(0);
        let first = one.new[0].to_string();
        let place = "sync byte due, no address byte seen: ";
        assert!(first.starts_with(place), "{first}");
        let name = one.name();
        let beginning = "9.2-sync-byte-due-no-address-byte-seen--";
        assert!(name.starts_with(beginning), "{name}");
        let text = String::from_utf8(one.content(BYTES)).expect("a text");
        assert!(text.contains(&format!("#   {first}\n")), "{text}");
        let read = crate::fuzz::input::input("a.hex", text.as_bytes());
        assert_eq!(read.as_ref(), Ok(&one.input));
    }

    #[test]
    fn records_stand_on_lines_of_their_own() {
        let one = KeptInput {
            input: vec![3, 4, 1, 2, 3, 4, 5, 6, 7],
            new: Vec::new(),
        };
        let text = String::from_utf8(one.content(InputPieces::Bytes { head: 2, record: 6 }))
            .expect("a text");
        assert!(text.ends_with("\n03 04\n01 02 03 04 05 06\n07\n"), "{text}");
    }

    /// A text stays one, unless something in it cannot be seen.
    #[test]
    fn texts_stay_texts() {
        let one = |input: &[u8]| KeptInput {
            input: input.to_vec(),
            new: vec![Feature::new("", "a", "b")],
        };
        let pieces = InputPieces::Text("scn");
        assert_eq!(one(b"title x\n").ending(pieces), "scn");
        assert_eq!(one(b"title x\n").content(pieces), b"title x\n");
        assert_eq!(one(b"title \r\n").ending(pieces), "hex");
        assert_eq!(one(&[0xFF]).ending(pieces), "hex");
    }
}
