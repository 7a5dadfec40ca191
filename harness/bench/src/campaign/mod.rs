//! Campaigns: one conversation, disturbed at every link, byte and bit, or at a sample of them, and what came of it.
//!
//! Here is what campaigns on shared lines have in common. The folder of a bus says how a case is played and what its outcomes are.

pub mod line;
pub mod share;
