//! Exploring the ring: cases as values, and what generates, plays, judges and shrinks them.

mod case;
mod confirm;
mod expect;
mod finding;
mod fuzz_case;
mod generate;
mod html;
mod idiom;
mod judge;
pub mod masters;
mod mutate;
mod novelty;
pub(crate) mod on_record;
mod on_rig;
mod on_sim;
mod oracle;
mod order;
mod page;
mod play;
mod promote;
mod setup;
pub mod shrink;
mod spice;
pub mod text;
mod tour;

pub use case::{
    Act, ActKind, Case, Damage, Harm, MOST_ACTS, MOST_BYTES, MOST_NET, OtherRing, Talk, To,
};
pub use confirm::judged_again;
pub use generate::{CaseScope, Generator, RingScope};
pub use mutate::mutate;
pub use novelty::features;
pub use on_record::AttemptRecord;
pub use on_rig::OnRig;
pub use on_sim::OnSim;
pub use oracle::{Difference, against_model, against_reference, against_witnesses, beside};
pub use order::{CommandSent, RawCommand, Spoil};
pub use page::page;
pub use play::{MasterView, play};
pub use setup::{Planted, RingSetup};
pub use spice::Spice;
