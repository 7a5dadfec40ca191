//! Folders of evidence: untouched ones verify, changed ones do not.

mod edits;
mod fuzz_edits;
mod special;
