//! All that runs in real time: rings behind sockets and pseudo terminals, served by another process, and what signals do.

mod bench;
mod capture;
mod capture_located;
mod capture_named;
#[path = "../common/debian.rs"]
mod debian;
mod dp;
mod drives_on_can;
#[path = "../common/edits.rs"]
mod edits;
mod embedded;
mod evidence;
mod explore;
mod frames;
mod inner;
mod inverters_on_line;
#[path = "../common/junit_rules.rs"]
mod junit_rules;
mod live;
mod port_interlocks;
#[path = "../common/program.rs"]
mod program;
#[path = "../common/python.rs"]
mod python;
mod python_package;
mod reports;
mod ring;
mod ser2net;
mod serve;
mod session;
mod session_capture;
mod session_hostile;
mod shell;
mod top;
