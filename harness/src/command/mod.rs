//! What the commands of all buses share: exit codes, messages, files, an open bench and its live view.

pub(crate) mod args;
pub(crate) mod axes;
pub(crate) mod cyclic;
pub(crate) mod deviations;
pub(crate) mod drawing;
pub(crate) mod drive;
pub(crate) mod exit;
pub(crate) mod failure;
pub(crate) mod file;
pub(crate) mod frames;
pub(crate) mod fuzz;
pub(crate) mod held;
pub(crate) mod line_top;
pub(crate) mod output;
pub(crate) mod page;
pub(crate) mod play;
pub(crate) mod port_bench;
pub(crate) mod port_row;
pub(crate) mod rig_failure;
pub(crate) mod rig_name;
pub(crate) mod sim;
pub(crate) mod top;
mod top_page;
pub(crate) mod watch;
