//! Simulated rings behind streams of bytes.

mod control;
mod live;
mod recorder;
mod server;
mod state;

pub use server::Server;
