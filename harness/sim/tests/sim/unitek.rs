//! The UNITEK drive: the manual's examples, the open points, and random frames against the reference.

mod against_reference;
mod common;
mod deviations;
mod examples;
mod invariants;
mod master;
mod segment;
