//! Simulated rings behind streams of bytes.

mod control;
mod server;
mod state;

pub use server::Server;
