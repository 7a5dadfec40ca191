//! Files in TOML: a text against its schema, and values with units.

pub mod schema;
pub mod values;
