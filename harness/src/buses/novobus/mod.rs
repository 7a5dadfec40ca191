//! NOVOBUS: what the bench knows of this bus alone (ND21 8 to 11).

pub mod driver;
pub mod explore;
pub mod language;
pub mod locate;
pub mod simulate;
pub mod twin;
