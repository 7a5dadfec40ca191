//! NOVOBUS: what the bench knows of this bus alone (ND21 8 to 11).
#![forbid(unsafe_code)]

pub mod calm;
pub mod campaign;
pub mod capture;
pub mod choice;
pub mod cli;
pub mod driver;
pub mod drives;
pub mod explore;
pub mod gate;
pub mod guard;
pub mod language;
pub mod link;
pub mod locate;
pub mod manual;
pub mod qualify;
pub mod report;
pub mod rig;
pub mod section;
pub mod serve;
pub mod simulate;
pub mod stream;
pub mod top;
pub mod twin;
