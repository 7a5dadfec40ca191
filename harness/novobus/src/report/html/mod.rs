//! What a page of HTML shows of scenarios.
//!
//! | file | what it makes |
//! |---|---|
//! | `summary.rs` | the verdicts of a run in a table |
//! | `scenario.rs` | the section of a scenario: verdict, section of the manual, expected beside received |

mod scenario;
mod summary;
pub use scenario::{ScenarioView, section};
pub(crate) use summary::colour;
pub use summary::{Head, ShownScenario, run};
