//! The bus in virtual time: the codec, the driver, the language, the guard and the twin on simulated rings.

mod beside;
mod blind;
mod busy;
mod campaigns;
mod corpora;
mod deviations;
mod driver;
mod found;
mod frames;
mod guard;
mod language;
mod naming;
mod nordac;
mod twin;
mod unitek;
mod vectors;
