//! The buses in virtual time: deviations, kept inputs, records, campaigns.

mod beside;
mod campaigns;
mod corpora;
mod found;
mod frames;
mod nordac;
#[expect(dead_code, reason = "the other tests of commands use all of it")]
#[path = "../common/typed.rs"]
mod typed;
mod unitek;
