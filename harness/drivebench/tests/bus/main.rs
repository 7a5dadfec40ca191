//! The buses in virtual time: deviations, kept inputs, records, campaigns.

mod beside;
mod campaigns;
mod corpora;
mod found;
mod frames;
mod nordac;
mod unitek;
