//! A simulated NOVOBUS ring: its links, its drives, a master, and the models that judge them.
//!
//! The [`ring`] moves bytes and knows no drive. A [`device`] knows telegrams and no topology. Faults
//! happen on a [`link`](mod@link) or in a drive's [`node`], never inside the code under test. A drive that
//! breaks the manual has its [`deviation`](mod@deviation)s around it.
//! [`reference`](mod@reference) is a second, simple model of the same rules. It was written apart from the first
//! and shares nothing with it; tests compare the two. A [`witness`](mod@witness) compares a whole drive with it.

pub mod bench;
pub mod cells;
pub mod counted;
pub mod deviation;
pub mod device;
pub mod drive;
mod fault_plan;
pub mod fuzz;
mod group;
pub mod link;
pub mod mark;
pub mod master;
pub mod node;
pub mod plain;
pub mod reference;
pub mod ring;
pub mod shared;
pub mod transitions;
mod uart;
mod under_way;
pub mod witness;
