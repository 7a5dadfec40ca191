//! The page itself: one file, with its style and its script in it, and the policy that allows these two and nothing else.

use crate::html::hash_source;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
const BODY: &str = include_str!("page.html");

pub(super) fn page() -> String {
    BODY.replacen("/*style*/", STYLE, 1)
        .replacen("/*script*/", SCRIPT, 1)
}

/// What a browser may do on it: its own style and script, and requests to where it came from.
pub(super) fn policy() -> String {
    format!(
        "default-src 'none'; style-src {}; script-src {}; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; \
         frame-ancestors 'none'",
        hash_source(STYLE),
        hash_source(SCRIPT)
    )
}
