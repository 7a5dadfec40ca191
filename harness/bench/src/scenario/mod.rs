//! Scenarios: scripted conversations with the bus, in the manual's own notation.
//!
//! A text goes through four hands: [`source`] reads the file and keeps the place of everything,
//! [`parse`] makes a [`syntax::Scenario`] of it for a ring of any size, [`plan`] settles it for one size
//! and refuses what cannot be, and [`run`] plays it on a [`Link`](crate::link::Link). The language is
//! described in `LANGUAGE.md` beside this file.

pub mod argument;
pub mod expression;
pub mod files;
pub mod language;
pub mod parse;
pub mod pattern;
pub mod plan;
pub mod problem;
pub mod quantity;
pub mod run;
pub mod scanner;
pub mod settled;
pub mod source;
pub mod syntax;
pub mod times;
pub mod verdict;
pub mod write;
