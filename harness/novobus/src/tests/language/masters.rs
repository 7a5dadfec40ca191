//! The language: wrong masters, and checks of the driver's reports and bytes.

use super::{entry, fails, passes, refused};

/// `master deviates`, and checks of the driver's reports and bytes.
#[test]
fn masters_deviate() {
    let text = |head: &str, steps: &str| format!("title x\nring 2\n{head}\n{steps}\n");
    let read = "master read-byte 1 FE13 = 00";
    passes(&text("", &format!("{read}\n? ended done\n? rules kept")));
    fails(
        &text("master deviates check-byte-off-by-one", read),
        "the bus is stopped",
    );
    fails(
        &text(
            "master deviates check-byte-off-by-one",
            "master once read-byte 1 FE13\n? rules kept",
        ),
        "ND21 9.6",
    );
    let needs = entry(&text("master deviates names-drive-0", read)).expect("a scenario");
    let needs = needs.plan.needs;
    assert_eq!(needs, [harness_bench::link::Capability::Simulator]);
    let wrong = [
        (
            "master deviates names-drive-1",
            "names-drive-1",
            "`names-drive-0`",
        ),
        (
            "master deviates increments-twice",
            "increments-twice",
            "`drive 2 deviates NAME`",
        ),
        (
            "drive 0 deviates names-drive-0",
            "names-drive-0",
            "`master deviates NAME`",
        ),
    ];
    for (line, place, help) in wrong {
        refused(
            &text(line, read),
            place,
            "drivebench deviations",
            Some(help),
        );
    }
    let twice = "master deviates names-drive-0\nmaster deviates names-drive-0";
    refused(&text(twice, read), "master", "is given twice", None);
    let late = format!("{read}\nmaster deviates names-drive-0");
    refused(&text("", &late), "master", "after the first step", None);
    refused(
        &text("", "master once reference 1"),
        "reference 1",
        "one command",
        None,
    );
    refused(
        &text("", "? named damaged 0->1"),
        "0->1",
        "no link 0->1",
        None,
    );
    refused(&text("", "? ended doen"), "doen", "done", Some("`done`"));
    passes(&text(
        "",
        "master exchange 0 1234; exchange 1 5678\n? rules kept",
    ));
}
