//! What may stand in a campaign file (`corpora/campaigns/*.toml`), and the check of a text.

use super::fault::{LONGEST, LineBit, MAX_GAP, link_place};
use crate::campaign::class::CaseClass;
use harness_bench::file::schema::{PathStep, compare, place, syntax};
use harness_bench::file::values::{LinkName, Time};
use harness_bench::scenario::problem::{Problem, Problems};
use harness_bench::scenario::source::Source;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Spanned;
use toml::de::DeTable;

/// The most cases of a campaign: each is kept with its outcome.
pub(crate) const MAX_CASES: u64 = 1_000_000;

/// A campaign file.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CampaignFile {
    /// The version of this schema: 1.
    #[schemars(range(min = 1, max = 1))]
    pub schema: u32,
    /// What the campaign shows, in a line.
    pub title: String,
    /// The scenario whose conversation is disturbed: the name of a built-in one, or a file, seen from the campaign's folder.
    pub scenario: String,
    /// How many drives, where the scenario leaves it open.
    #[serde(default)]
    #[schemars(range(min = 1, max = 250))]
    pub drives: Option<u8>,
    /// The kinds of faults.
    #[schemars(length(min = 1, max = 8))]
    pub faults: Vec<FaultFamily>,
    /// The links, such as "98->97"; all where none is named.
    #[serde(default)]
    #[schemars(length(min = 1, max = 251))]
    pub links: Option<Vec<LinkName>>,
    /// The bytes of the conversation, such as "1..18"; all where nothing is said.
    #[serde(default)]
    pub bytes: Option<String>,
    /// The bits that `bits` inverts: "b" (start), "0" to "7", "p" (parity), "s" (stop); all 11 where nothing is said.
    #[serde(default)]
    #[schemars(length(min = 1, max = 11))]
    pub bits: Option<Vec<BitName>>,
    /// The bytes that `insert` inserts, two hexadecimal digits each.
    #[serde(default)]
    #[schemars(length(min = 1, max = 256))]
    pub inserted: Option<Vec<String>>,
    /// How many bytes in a row `gap` loses.
    #[serde(default)]
    #[schemars(length(min = 1, max = 16), inner(range(min = 1, max = 1000)))]
    pub gaps: Option<Vec<u16>>,
    /// By how much `delay` delays.
    #[serde(default)]
    #[schemars(length(min = 1, max = 16))]
    pub delays: Option<Vec<Time>>,
    /// How long `break` holds the line.
    #[serde(default)]
    #[schemars(length(min = 1, max = 16))]
    pub breaks: Option<Vec<Time>>,
    /// Two faults a case in place of one.
    #[serde(default)]
    pub pairs: Option<Pairs>,
    /// Number of cases drawn from all; all of them by default.
    #[serde(default)]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub sample: Option<u64>,
    /// Where the drawing starts: the same seed draws the same cases.
    #[serde(default)]
    pub seed: Option<u32>,
    /// How many cases there must be of each class; what is not named is not looked at.
    #[serde(default)]
    pub expect: ExpectedCounts,
}

/// A kind of faults.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum FaultFamily {
    /// Each bit of `bits`.
    Bits,
    /// The byte is lost.
    Drop,
    /// It arrives twice.
    Duplicate,
    /// The receiver was too slow.
    Overrun,
    /// Each byte of `inserted` arrives before it.
    Insert,
    /// Number of bytes lost from it on.
    Gap,
    /// It arrives later.
    Delay,
    /// The line is held at 0.
    Break,
}

/// A bit of a byte on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
pub(crate) enum BitName {
    /// The start bit.
    #[serde(rename = "b")]
    Start,
    /// Data bit 0.
    #[serde(rename = "0")]
    D0,
    /// Data bit 1.
    #[serde(rename = "1")]
    D1,
    /// Data bit 2.
    #[serde(rename = "2")]
    D2,
    /// Data bit 3.
    #[serde(rename = "3")]
    D3,
    /// Data bit 4.
    #[serde(rename = "4")]
    D4,
    /// Data bit 5.
    #[serde(rename = "5")]
    D5,
    /// Data bit 6.
    #[serde(rename = "6")]
    D6,
    /// Data bit 7.
    #[serde(rename = "7")]
    D7,
    /// The parity bit.
    #[serde(rename = "p")]
    Parity,
    /// The stop bit.
    #[serde(rename = "s")]
    Stop,
}

impl From<BitName> for LineBit {
    fn from(name: BitName) -> Self {
        match name {
            BitName::Start => Self::Start,
            BitName::Parity => Self::Parity,
            BitName::Stop => Self::Stop,
            data => Self::Data(data as u8 - BitName::D0 as u8),
        }
    }
}

/// Where the two faults of a pair are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Pairs {
    /// In one byte.
    Byte,
    /// In two bytes of one telegram, on one link.
    Telegram,
    /// Anywhere.
    Any,
}

/// The figures that a campaign pins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct ExpectedCounts {
    /// All cases together.
    #[schemars(range(min = 0))]
    pub cases: Option<u64>,
    /// See [`CaseClass::Harmless`].
    #[schemars(range(min = 0))]
    pub harmless: Option<u64>,
    /// See [`CaseClass::Located`].
    #[schemars(range(min = 0))]
    pub located: Option<u64>,
    /// See [`CaseClass::Recovered`].
    #[schemars(range(min = 0))]
    pub recovered: Option<u64>,
    /// See [`CaseClass::Mislocated`].
    #[schemars(range(min = 0))]
    pub mislocated: Option<u64>,
    /// See [`CaseClass::NotRecovered`].
    #[schemars(range(min = 0))]
    pub not_recovered: Option<u64>,
    /// See [`CaseClass::Corrupted`].
    #[schemars(range(min = 0))]
    pub corrupted: Option<u64>,
    /// See [`CaseClass::SilentCorruption`].
    #[schemars(range(min = 0))]
    pub silent_corruption: Option<u64>,
}

impl ExpectedCounts {
    /// How many cases of a class are expected.
    #[must_use]
    pub(crate) const fn of(&self, class: CaseClass) -> Option<u64> {
        match class {
            CaseClass::Harmless => self.harmless,
            CaseClass::Located => self.located,
            CaseClass::Recovered => self.recovered,
            CaseClass::Mislocated => self.mislocated,
            CaseClass::NotRecovered => self.not_recovered,
            CaseClass::Corrupted => self.corrupted,
            CaseClass::SilentCorruption => self.silent_corruption,
        }
    }

    /// The pinned figures: of all cases, then of the classes in order of gravity.
    #[must_use]
    pub(crate) fn pinned(&self) -> Vec<(&'static str, u64)> {
        let all = self.cases.map(|count| ("cases", count));
        let classes = CaseClass::ALL.iter();
        let classes = classes.filter_map(|class| Some((class.name(), self.of(*class)?)));
        all.into_iter().chain(classes).collect()
    }
}

impl CampaignFile {
    /// The bytes of the conversation that are disturbed, first and last, counted from 1.
    #[must_use]
    pub(crate) fn byte_range(&self, length: u64) -> (u64, u64) {
        let range = self.bytes.as_deref().and_then(range);
        range.unwrap_or((1, length))
    }
}

/// `1..18`, or one byte.
fn range(text: &str) -> Option<(u64, u64)> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    let (first, last) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
    (1 <= first && first <= last).then_some((first, last))
}

/// A byte in two hexadecimal digits.
#[must_use]
pub(crate) fn hex(text: &str) -> Option<u8> {
    let digits = text.len() == 2 && text.bytes().all(|b| b.is_ascii_hexdigit());
    u8::from_str_radix(text, 16).ok().filter(|_| digits)
}

/// The JSON schema of a campaign file, draft 2020-12.
#[must_use]
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(CampaignFile).to_value()
}

/// A campaign file's text, read and not yet settled for a ring.
#[derive(Debug)]
pub(crate) struct CampaignText<'a> {
    /// What it says.
    pub file: CampaignFile,
    table: Spanned<DeTable<'a>>,
    source: &'a Source,
}

/// Reads a campaign file. Unknown keys, wrong types and values that cannot be are refused; all mistakes at once.
///
/// # Errors
/// All its mistakes, each with its place.
pub(crate) fn read(source: &Source) -> Result<CampaignText<'_>, Problems> {
    let problems = |mut all: Vec<Problem>| {
        all.sort_by_key(|problem| (problem.span.start, problem.span.end));
        all.dedup();
        Problems::new(&source.name, source.text.clone(), all)
    };
    let table = DeTable::parse(&source.text).map_err(|e| problems(vec![syntax(&e)]))?;
    let mistakes = compare(&schema(), "a campaign file", &table);
    if !mistakes.is_empty() {
        return Err(problems(mistakes));
    }
    let file = toml::from_str(&source.text).map_err(|e| problems(vec![syntax(&e)]))?;
    let read = CampaignText {
        file,
        table,
        source,
    };
    let mistakes = read.check();
    if mistakes.is_empty() {
        Ok(read)
    } else {
        Err(problems(mistakes))
    }
}

impl CampaignText<'_> {
    /// A mistake at a key of the file.
    pub(crate) fn wrong(
        &self,
        path: &[&str],
        message: impl Into<String>,
        expected: impl Into<String>,
    ) -> Problem {
        let path: Vec<_> = path.iter().map(|key| PathStep::from(*key)).collect();
        Problem::new(place(&self.table, &path), message, expected)
    }

    /// The same as what is shown of a whole file.
    #[must_use]
    pub(crate) fn problems(&self, problem: Problem) -> Problems {
        Problems::new(&self.source.name, self.source.text.clone(), vec![problem])
    }

    fn at(&self, key: &str, index: usize, message: String, expected: &str) -> Problem {
        let path = [PathStep::from(key), PathStep::from(index)];
        Problem::new(place(&self.table, &path), message, expected)
    }

    /// What the schema cannot say.
    fn check(&self) -> Vec<Problem> {
        let file = &self.file;
        let mut found = Vec::new();
        let lists = [
            (FaultFamily::Bits, "bits", file.bits.as_ref().map(Vec::len)),
            (
                FaultFamily::Insert,
                "inserted",
                file.inserted.as_ref().map(Vec::len),
            ),
            (FaultFamily::Gap, "gaps", file.gaps.as_ref().map(Vec::len)),
            (
                FaultFamily::Delay,
                "delays",
                file.delays.as_ref().map(Vec::len),
            ),
            (
                FaultFamily::Break,
                "breaks",
                file.breaks.as_ref().map(Vec::len),
            ),
        ];
        for (kind, key, list) in lists {
            let named = file.faults.contains(&kind);
            if named && list.is_none() && kind != FaultFamily::Bits {
                let message = format!("`{key}` is missing for these faults");
                let expected = format!("a list `{key}` expected beside it");
                found.push(self.wrong(&["faults"], message, expected));
            }
            if !named && list.is_some() {
                let message =
                    format!("`{key}` says something of faults that the campaign has not got");
                found.push(self.wrong(
                    &[key],
                    message,
                    "its kind in `faults`, or nothing, expected",
                ));
            }
        }
        for (index, kind) in file.faults.iter().enumerate() {
            if file.faults[..index].contains(kind) {
                found.push(self.at(
                    "faults",
                    index,
                    "this kind stands here twice".to_owned(),
                    "each kind once",
                ));
            }
        }
        for (index, text) in file.inserted.iter().flatten().enumerate() {
            if hex(text).is_none() {
                let message = format!("`{text}` is not a byte");
                found.push(self.at(
                    "inserted",
                    index,
                    message,
                    "two hexadecimal digits such as \"80\" expected here",
                ));
            }
        }
        for (key, times) in [("delays", &file.delays), ("breaks", &file.breaks)] {
            for (index, time) in times.iter().flatten().enumerate() {
                if time.0 > LONGEST {
                    let message = format!("{time} is too long");
                    found.push(self.at(key, index, message, "at most 1s expected here"));
                }
            }
        }
        if file
            .bytes
            .as_deref()
            .is_some_and(|text| range(text).is_none())
        {
            found.push(self.wrong(
                &["bytes"],
                "this is not a range of bytes",
                "FIRST..LAST, counted from 1, such as \"1..18\" expected here",
            ));
        }
        if file.seed.is_some() && file.sample.is_none() {
            found.push(self.wrong(&["seed"], "nothing is drawn", "`sample` expected beside it"));
        }
        debug_assert!(file.gaps.iter().flatten().all(|gap| *gap <= MAX_GAP));
        found
    }

    /// Checks that the campaign fits a ring of `drives` drives and a conversation of `length` bytes.
    ///
    /// # Errors
    /// The first key that does not fit.
    pub(crate) fn fits(&self, drives: u8, length: u64) -> Result<(), Problem> {
        for (index, link) in self.file.links.iter().flatten().enumerate() {
            if link_place(drives, *link).is_none() {
                let message = format!("a ring of {drives} has no link {link}");
                return Err(self.at("links", index, message, "a link of the ring expected here"));
            }
        }
        let (_, last) = self.file.byte_range(length);
        if last > length {
            let message = format!("the conversation has {length} bytes");
            return Err(self.wrong(
                &["bytes"],
                message,
                "bytes of the conversation expected here",
            ));
        }
        Ok(())
    }
}
