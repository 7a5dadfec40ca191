//! The buses: one folder each. Only this file names them all.

pub mod novobus;
