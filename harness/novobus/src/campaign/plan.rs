//! The list of cases: a pure function of a campaign file and the ring and conversation that it is for.

use super::fault::{CaseFaults, FaultEffect, InjectedFault, LineBit, link_place};
use super::file::{CampaignFile, FaultFamily, MAX_CASES, Pairs, hex};
use std::collections::BTreeSet;
use std::ops::Range;

/// What of a conversation a plan depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    /// How many drives the ring has.
    pub drives: u8,
    /// The bytes at which telegrams begin, counted from 1; last, the byte after the conversation.
    pub telegrams: Vec<u64>,
}

impl Shape {
    /// How many bytes the conversation has.
    #[must_use]
    pub(crate) fn length(&self) -> u64 {
        self.telegrams.last().map_or(0, |end| end - 1)
    }

    /// Which telegram a byte belongs to, counted from 0.
    fn telegram(&self, byte: u64) -> usize {
        self.telegrams.partition_point(|first| *first <= byte)
    }
}

/// More cases than a campaign may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} cases; at most {MAX_CASES} are played")]
pub(crate) struct TooMany(pub u64);

/// The cases of a campaign, in order of links, bytes and kinds.
///
/// # Errors
/// There are more than `MAX_CASES`.
pub(crate) fn cases(file: &CampaignFile, shape: &Shape) -> Result<Vec<CaseFaults>, TooMany> {
    let singles = singles(file, shape);
    let groups = match file.pairs {
        None => vec![Group::Singles(0..singles.len())],
        Some(pairs) => groups(pairs, &singles, shape),
    };
    let total: u64 = groups.iter().map(Group::len).sum();
    if file.sample.is_none() && total > MAX_CASES {
        return Err(TooMany(total));
    }
    let mut ends = Vec::new();
    let mut end = 0;
    for group in &groups {
        end += group.len();
        ends.push(end);
    }
    let case = |index: u64| {
        let group = ends.partition_point(|end| *end <= index);
        let before = if group == 0 { 0 } else { ends[group - 1] };
        groups[group].case(index - before, &singles)
    };
    Ok(match file.sample.filter(|sample| *sample < total) {
        None => (0..total).map(case).collect(),
        Some(sample) => draw(total, sample, u64::from(file.seed.unwrap_or(0)))
            .into_iter()
            .map(case)
            .collect(),
    })
}

/// Every fault at every byte of every link that the file names.
fn singles(file: &CampaignFile, shape: &Shape) -> Vec<InjectedFault> {
    let mut links: Vec<usize> = match &file.links {
        Some(links) => links
            .iter()
            .filter_map(|link| link_place(shape.drives, *link))
            .collect(),
        None => (0..=usize::from(shape.drives)).collect(),
    };
    links.sort_unstable();
    links.dedup();
    let whats: Vec<_> = file
        .faults
        .iter()
        .flat_map(|kind| whats(file, *kind))
        .collect();
    let (first, last) = file.byte_range(shape.length());
    let mut all = Vec::new();
    for link in links {
        for byte in first..=last {
            all.extend(whats.iter().map(|&what| InjectedFault { link, byte, what }));
        }
    }
    all
}

fn whats(file: &CampaignFile, kind: FaultFamily) -> Vec<FaultEffect> {
    match kind {
        FaultFamily::Bits => match &file.bits {
            Some(bits) => {
                let mut bits: Vec<_> = bits.iter().map(|bit| LineBit::from(*bit)).collect();
                bits.sort_unstable();
                bits.dedup();
                bits.into_iter().map(FaultEffect::Bit).collect()
            }
            None => LineBit::all().into_iter().map(FaultEffect::Bit).collect(),
        },
        FaultFamily::Drop => vec![FaultEffect::Drop],
        FaultFamily::Duplicate => vec![FaultEffect::Duplicate],
        FaultFamily::Overrun => vec![FaultEffect::Overrun],
        FaultFamily::Insert => {
            let bytes = file.inserted.iter().flatten();
            bytes
                .filter_map(|text| hex(text).map(FaultEffect::Insert))
                .collect()
        }
        FaultFamily::Gap => file
            .gaps
            .iter()
            .flatten()
            .map(|gap| FaultEffect::Gap(*gap))
            .collect(),
        FaultFamily::Delay => file
            .delays
            .iter()
            .flatten()
            .map(|t| FaultEffect::Delay(*t))
            .collect(),
        FaultFamily::Break => file
            .breaks
            .iter()
            .flatten()
            .map(|t| FaultEffect::Break(*t))
            .collect(),
    }
}

/// Cases that are counted together: single faults, pairs within a run of them, pairs of two runs.
enum Group {
    Singles(Range<usize>),
    Within(Range<usize>),
    Between(Range<usize>, Range<usize>),
}

impl Group {
    fn len(&self) -> u64 {
        match self {
            Self::Singles(all) => all.len() as u64,
            Self::Within(all) => all.len() as u64 * (all.len() as u64).saturating_sub(1) / 2,
            Self::Between(a, b) => a.len() as u64 * b.len() as u64,
        }
    }

    fn case(&self, index: u64, singles: &[InjectedFault]) -> CaseFaults {
        let place = |range: &Range<usize>, index: u64| {
            singles[range.start + usize::try_from(index).unwrap_or(usize::MAX)]
        };
        match self {
            Self::Singles(all) => CaseFaults {
                first: place(all, index),
                second: None,
            },
            Self::Within(all) => {
                // Pair (i, j) with i < j is number j (j - 1) / 2 + i.
                let mut second = ((2 * index) as f64).sqrt() as u64;
                while second * second.saturating_sub(1) / 2 > index {
                    second -= 1;
                }
                while (second + 1) * second / 2 <= index {
                    second += 1;
                }
                CaseFaults {
                    first: place(all, index - second * (second - 1) / 2),
                    second: Some(place(all, second)),
                }
            }
            Self::Between(a, b) => CaseFaults {
                first: place(a, index / b.len() as u64),
                second: Some(place(b, index % b.len() as u64)),
            },
        }
    }
}

/// Which pairs there are.
fn groups(pairs: Pairs, singles: &[InjectedFault], shape: &Shape) -> Vec<Group> {
    if pairs == Pairs::Any {
        return vec![Group::Within(0..singles.len())];
    }
    // Faults at one byte stand beside each other.
    let mut bytes: Vec<Range<usize>> = Vec::new();
    for (index, single) in singles.iter().enumerate() {
        match bytes.last_mut() {
            Some(run)
                if (singles[run.start].link, singles[run.start].byte)
                    == (single.link, single.byte) =>
            {
                run.end = index + 1;
            }
            _ => bytes.push(index..index + 1),
        }
    }
    if pairs == Pairs::Byte {
        return bytes.into_iter().map(Group::Within).collect();
    }
    let telegram = |run: &Range<usize>| {
        let single = &singles[run.start];
        (single.link, shape.telegram(single.byte))
    };
    let mut groups = Vec::new();
    for (index, first) in bytes.iter().enumerate() {
        let behind = bytes[index + 1..].iter();
        let same = behind.take_while(|second| telegram(second) == telegram(first));
        groups.extend(same.map(|second| Group::Between(first.clone(), second.clone())));
    }
    groups
}

/// `count` different numbers below `total`, in order (Floyd's way; splitmix64).
fn draw(total: u64, count: u64, seed: u64) -> BTreeSet<u64> {
    let mut state = seed;
    let mut below = |limit: u64| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        // The upper half of the product: without a bias that would show.
        let wide = u128::from(z ^ (z >> 31)) * u128::from(limit);
        u64::try_from(wide >> 64).unwrap_or(0)
    };
    let mut drawn = BTreeSet::new();
    for most in total - count..total {
        let number = below(most + 1);
        if !drawn.insert(number) {
            drawn.insert(most);
        }
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> CampaignFile {
        let head = "schema = 1\ntitle = \"\"\nscenario = \"\"\n";
        toml::from_str(&format!("{head}{text}")).expect("a file")
    }

    fn shape() -> Shape {
        Shape {
            drives: 3,
            telegrams: vec![1, 4, 6],
        }
    }

    fn count(text: &str) -> usize {
        let cases = cases(&file(text), &shape()).expect("not too many");
        let different: BTreeSet<_> = cases.iter().collect();
        assert_eq!(different.len(), cases.len(), "{text}");
        cases.len()
    }

    #[test]
    fn as_many_cases_as_reckoned_by_hand() {
        assert_eq!(count("faults = [\"bits\"]"), 4 * 5 * 11);
        assert_eq!(
            count("faults = [\"drop\", \"bits\"]\nbits = [\"0\"]\nbytes = \"2..3\""),
            4 * 2 * 2
        );
        assert_eq!(count("faults = [\"bits\"]\npairs = \"byte\""), 4 * 5 * 55);
        // Bytes 1-2, 1-3, 2-3 of the first telegram, 4-5 of the second.
        assert_eq!(
            count("faults = [\"bits\"]\npairs = \"telegram\""),
            4 * 4 * 121
        );
        assert_eq!(count("faults = [\"bits\"]\npairs = \"any\""), 220 * 219 / 2);
        assert_eq!(
            count("faults = [\"bits\"]\nlinks = [\"2->1\"]\npairs = \"any\"\nsample = 100"),
            100
        );
        assert_eq!(count("faults = [\"drop\"]\nsample = 1000"), 20);
    }

    #[test]
    fn every_pair_once_whatever_the_order_of_drawing() {
        let all = cases(&file("faults = [\"bits\"]\npairs = \"any\""), &shape()).expect("cases");
        let one = cases(
            &file("faults = [\"bits\"]\npairs = \"any\"\nsample = 500\nseed = 7"),
            &shape(),
        )
        .expect("cases");
        let other = cases(
            &file("faults = [\"bits\"]\npairs = \"any\"\nsample = 500\nseed = 8"),
            &shape(),
        )
        .expect("cases");
        assert_ne!(one, other);
        let all: BTreeSet<_> = all.into_iter().collect();
        assert!(one.iter().chain(&other).all(|case| all.contains(case)));
    }

    #[test]
    fn too_many_are_refused() {
        let long = Shape {
            drives: 100,
            telegrams: vec![1, 31],
        };
        let text = "faults = [\"bits\"]\npairs = \"any\"";
        let total = 101 * 30 * 11;
        assert_eq!(
            cases(&file(text), &long),
            Err(TooMany(total * (total - 1) / 2))
        );
    }
}
