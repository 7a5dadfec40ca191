//! How far a list of scenarios or drives is.

use indicatif::{ProgressBar, ProgressStyle};

pub fn progress_bar(length: usize, shown: bool) -> ProgressBar {
    let bar = match shown && length > 1 {
        true => ProgressBar::new(length as u64),
        false => ProgressBar::hidden(),
    };
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.with_style(style)
}
