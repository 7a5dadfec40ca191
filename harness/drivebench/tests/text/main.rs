//! What people and other programs read and write: commands, reports, pages, captures, rig files, and the rules for the sources.

mod captures;
mod cli;
mod crates;
mod dbc;
#[path = "../common/debian.rs"]
mod debian;
mod help;
mod html;
#[path = "../common/junit_rules.rs"]
mod junit_rules;
mod nordac;
mod package;
#[path = "../common/python.rs"]
mod python;
mod reports;
mod rig;
mod tidy;
#[path = "../common/typed.rs"]
mod typed;
