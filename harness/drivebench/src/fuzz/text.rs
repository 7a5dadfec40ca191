//! The bodies of the fuzz targets for texts: scenarios and rig files.

use crate::buses::{Bus, named};
use crate::scenario::parse::bus;
use crate::scenario::problem::{Problem, Problems};
use crate::scenario::settled::BenchSize;
use crate::scenario::source::Source;

/// The longest text that is looked at, in bytes; what lies behind is left out.
const LONGEST: usize = 8_192;

/// The most mistakes that are no byte's: what has to be there and is missing.
const MISSING: usize = 100;

/// The sizes of ring for which a scenario is settled: its own, the smallest, a small one, and the largest (ND21 8.4).
const SIZES: [BenchSize; 4] = [
    BenchSize::Own,
    BenchSize::Of(1),
    BenchSize::Of(3),
    BenchSize::Of(250),
];

/// A text as a scenario: read, and settled for rings of several sizes.
///
/// # Panics
/// What is written of it is another scenario; a mistake stands outside the text or within a character, or says nothing; there are many more mistakes than bytes; or a newline at
/// the end makes a difference.
pub fn scenario(data: &[u8]) {
    let Some((text, source)) = source("input.scn", data) else {
        return;
    };
    let bus = named(bus(&source));
    let shown = settled(bus, &source);
    if let Some(longer) = with_newline(&text) {
        let again = settled(bus, &longer);
        assert_eq!(again, shown, "a newline at the end makes a difference");
    }
}

/// A text as a rig file.
///
/// # Panics
/// As [`scenario`].
pub fn rig(data: &[u8]) {
    let Some((text, source)) = source("input.toml", data) else {
        return;
    };
    let read = |source: &Source| match crate::buses::parse_rig(source) {
        // Its text has the newline, and no more than that.
        Ok(rig) => format!("{:?} {:?}", rig.file, rig.profile),
        Err(problems) => check(&problems, source),
    };
    let shown = read(&source);
    if let Some(longer) = with_newline(&text) {
        assert_eq!(
            read(&longer),
            shown,
            "a newline at the end makes a difference"
        );
    }
}

/// The text, where it is one.
fn source(name: &str, data: &[u8]) -> Option<(String, Source)> {
    let data = &data[..data.len().min(LONGEST)];
    let source = Source::from_bytes(name.to_owned(), data.to_vec()).ok()?;
    Some((source.text.to_string(), source))
}

/// The same text with a newline behind it, where it has none.
fn with_newline(text: &str) -> Option<Source> {
    if text.ends_with(['\n', '\r']) {
        return None;
    }
    Source::from_bytes("input".to_owned(), format!("{text}\n").into_bytes()).ok()
}

/// What a scenario is for each size, in one text; or its mistakes.
fn settled(bus: &Bus, source: &Source) -> String {
    if let Err(problems) = (bus.comes_back)(source) {
        return check(&problems, source);
    }
    let shown = SIZES.map(|size| match (bus.settle)(source, size) {
        Ok(settled) => format!("{settled:?}"),
        Err(problems) => check(&problems, source),
    });
    shown.concat()
}

/// Every mistake has a place within the text and says something; what they say comes back.
fn check(problems: &Problems, source: &Source) -> String {
    let all = problems.all();
    let text = &source.text;
    assert!(!all.is_empty(), "refused without a mistake");
    assert!(all.len() <= text.len() + MISSING, "{} mistakes", all.len());
    for Problem {
        message,
        span,
        expected,
        ..
    } in all
    {
        assert!(!message.is_empty() && !expected.is_empty(), "{span:?}");
        assert!(
            text.get(span.start..span.end).is_some(),
            "{message}: {span:?}"
        );
    }
    // What is missing at the end of the text is missing behind its newline too.
    let end = text.trim_end_matches('\n').len();
    let shown = all.iter().cloned().map(|mut problem| {
        problem.span.start = problem.span.start.min(end);
        problem.span.end = problem.span.end.min(end);
        problem
    });
    format!("{:?}", shown.collect::<Vec<_>>())
}
