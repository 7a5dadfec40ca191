//! What the commands of all buses share: exit codes, messages, files, an open bench and its live view.

pub(crate) use harness_bench::command::*;
pub(crate) mod play;
