//! Simulated rings, drives and masters against the print, a reference model and calculation by hand.

mod deviations;
mod master;
mod nd21;
mod nordac;
mod ring;
mod unitek;
