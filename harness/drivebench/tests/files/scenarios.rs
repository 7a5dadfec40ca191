//! Every scenario of corpora/scenarios passes, and leaves the table that snapshots/scenarios holds.
//!
//! Adding a case is adding a file. A new table is written beside its place as `.snap.new`: compare it
//! with the print, cell by cell, and take the `.new` away (`INSTA_UPDATE=always` writes it in place).

use harness::library::Entry;
use harness::library::page::page;
use harness::scenario::run::AtMismatch;
use harness::scenario::source::Source;
use harness::scenario::verdict::Verdict;
use std::path::Path;

pub(crate) fn snapshot(path: &Path) -> datatest_stable::Result<()> {
    let source = Source::read(path)?;
    let entry = Entry::new(source, None).map_err(|problems| format!("{:#?}", problems.all()))?;
    let plan = &entry.settled;
    let mut link = plan.simulate();
    let outcome = plan.play(&mut *link, AtMismatch::Stop);
    let traces: Vec<_> = (0..plan.ports()).map(|port| link.trace(port)).collect();
    let page = page(&entry, &outcome, &traces);

    let folder = path
        .parent()
        .ok_or("a file in a folder")?
        .strip_prefix(concat!(env!("TREE"), "/corpora"))?;
    let name = path
        .file_stem()
        .and_then(|stem| stem.to_str())
        .ok_or("a name")?;
    insta::with_settings!({
        snapshot_path => Path::new(env!("TREE")).join("snapshots").join(folder),
        prepend_module_to_snapshot => false,
        omit_expression => true,
    }, {
        insta::assert_snapshot!(name, page);
    });
    if outcome.verdict != Verdict::Passed {
        return Err(format!("{}: {:?}", outcome.verdict, outcome.finding).into());
    }
    Ok(())
}
