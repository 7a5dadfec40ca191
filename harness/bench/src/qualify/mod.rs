//! What a drive is, settled by its answers: which value an open property has, which known deviation explains what came.
//!
//! One idea does both: a hypothesis is a model with one thing changed, and it holds where its twin gives every byte
//! that the real ring gave. Drives of a ring have their own engine, in the folder of NOVOBUS.

pub mod search;
pub mod segment;
pub mod walk;
pub mod worlds;
