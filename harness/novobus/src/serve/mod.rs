//! Simulated rings behind streams of bytes.

mod control;
mod live;
pub(super) mod recorder;
mod server;
mod state;

pub(crate) use server::Server;
