//! A scenario that is written and read again.

use crate::scenario::language::Language;
use crate::scenario::parse::parse;
use crate::scenario::problem::Problems;
use crate::scenario::source::Source;
use crate::scenario::syntax::Scenario;
use crate::scenario::write::write;

/// Writes a scenario and reads it again: it must be the same one.
///
/// # Panics
/// It is another one.
pub fn written<L: Language>(scenario: &Scenario<L>) {
    let text = write(scenario);
    let source = Source {
        name: "written.scn".to_owned(),
        text: text.as_str().into(),
    };
    let again: Scenario<L> =
        parse(&source).unwrap_or_else(|problems| panic!("{problems:#?}\n{text}"));
    assert_eq!(said(scenario), said(&again), "{text}");
    assert_eq!(text, write(&again));
}

/// All that a scenario says, without the places where it says it.
fn said<L: Language>(scenario: &Scenario<L>) -> String {
    let text = format!("{scenario:?}");
    let mut pieces = text.split("Span { start: ");
    let first = pieces.next().unwrap_or_default().to_owned();
    pieces.fold(first, |all, piece| {
        all + piece.split_once('}').map_or("", |(_, behind)| behind)
    })
}

/// The same of a text.
///
/// # Errors
/// The text has mistakes.
///
/// # Panics
/// As [`written`].
pub fn comes_back<L: Language>(source: &Source) -> Result<(), Problems> {
    parse::<L>(source).map(|scenario| written(&scenario))
}
