//! One page of HTML for people: what was played, the outcome, and pictures of it.
//!
//! A page is self-contained: it includes its style, script and pictures and loads nothing (its own `Content-Security-Policy`
//! forbids it). Without scripts, pictures and tables are still shown. It never has more than `MAX_PAGE` bytes: if a run has
//! more to show, the most serious sections come first, and the page says what was left out.
//!
//! | file | what it makes |
//! |---|---|
//! | `../../html.rs` | the only way into a page: everything but the program's own words is escaped |
//! | `page.rs` | the page around its sections, within its bounds |
//! | `sequence.rs` | what the master and the drives of a shared line said, one after another |
//! | `../chart` | values against time |
//! | `style.css`, `script.js` | how it looks, and what it shows when the pointer is on a byte |

pub mod page;
pub mod sequence;

pub use page::{FoldedPart, Section, page};
