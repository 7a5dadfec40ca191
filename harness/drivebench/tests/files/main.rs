//! One test for each file: every scenario leaves its table, every page of the guide is true, and every console transcript is what is printed.

#[path = "../common/debian.rs"]
mod debian;
mod guide;
#[path = "../common/python.rs"]
mod python;
mod scenarios;

datatest_stable::harness! {
    { test = scenarios::snapshot, root = concat!(env!("TREE"), "/corpora/scenarios"), pattern = r"\.scn$" },
    { test = guide::refused, root = concat!(env!("TREE"), "/harness/drivebench/tests/files/guide/wrong"), pattern = r"\.md$" },
    { test = guide::transcript::matches, root = concat!(env!("TREE"), "/snapshots/console"), pattern = r"\.md$" },
    { test = guide::transcript::refused, root = concat!(env!("TREE"), "/harness/drivebench/tests/files/guide/wrong_transcripts"), pattern = r"\.md$" },
    { test = guide::citations, root = concat!(env!("TREE"), "/snapshots/console"), pattern = r"\.md$" },
    { test = guide::commands, root = concat!(env!("TREE"), "/harness/docs"), pattern = r"\.md$" },
    { test = guide::options, root = concat!(env!("TREE"), "/harness/docs"), pattern = r"\.md$" },
    { test = guide::links, root = concat!(env!("TREE"), "/harness/docs"), pattern = r"\.md$" },
    { test = guide::citations, root = concat!(env!("TREE"), "/harness/docs"), pattern = r"\.md$" },
}
