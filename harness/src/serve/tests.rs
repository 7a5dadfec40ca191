//! Served rings in virtual time.
