//! Campaigns: one conversation, disturbed at every link, byte and bit, or at a sample of them, and what came of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, [`plan`] makes the list of cases of it, a pure function of the file, the
//! ring and the conversation. [`replay`] prints one case as a scenario. The folder of a bus says how a case is played and what its outcomes
//! are.
pub mod line;
pub mod share;
