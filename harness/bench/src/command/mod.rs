//! What the commands of all buses share: exit codes, messages, files, an open bench and its live view.

pub mod args;
pub mod axes;
pub mod cyclic;
pub mod deviations;
pub mod drawing;
pub mod drive;
pub mod drives;
pub mod exit;
pub mod failure;
pub mod file;
pub mod frames;
pub mod fuzz;
pub mod held;
pub mod line_top;
pub mod output;
pub mod page;
pub mod port_bench;
pub mod progress;
pub mod reading;
pub mod rig_commands;
pub mod rig_failure;
pub mod rig_name;
pub mod sim;
pub mod top;
pub mod top_page;
pub mod watch;
