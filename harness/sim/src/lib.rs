//! Simulated rings and drives, in virtual time.
//!
//! A simulated run is a function of what is sent, of the faults and of the drives' cells: two runs give
//! the same bytes at the same times. Nothing sleeps and nothing ticks: a run jumps from event to event.
//!
//! The [`ring`] moves bytes and knows no drive; a [`device`] knows telegrams and no topology; faults
//! happen on a [`link`](mod@link) or in a drive's [`node`], never inside the code under test, and a drive that
//! breaks the manual has its [`deviation`](mod@deviation)s around it.
//! [`reference`](mod@reference) is a second, deliberately simple model of the same rules, written apart from the first
//! and sharing nothing with it: the two are held against each other in tests. A [`witness`](mod@witness) holds a whole drive against it.
#![forbid(unsafe_code)]

pub mod bench;
pub mod cells;
pub mod counted;
pub mod deviation;
pub mod device;
pub mod drive;
pub mod fault;
pub mod fuzz;
pub mod link;
pub mod master;
pub mod nd21;
pub mod node;
pub mod plain;
pub mod reference;
pub mod ring;
pub mod trace;
pub mod transitions;
mod uart;
mod under_way;
pub mod witness;
