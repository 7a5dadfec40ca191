//! Locks of rigs and ports, reservations and quarantine.

use super::{good, serial};
use harness::rig::lock::{self, LockError, PortLock, PortLockError, RigLock, Standing};
use harness::rig::state::{self, Holder};
use std::time::{Duration, Instant, UNIX_EPOCH};

pub(crate) fn someone(user: &str, uid: u32) -> Holder {
    Holder {
        user: user.to_owned(),
        uid,
        ..Holder::me("qualify")
    }
}

#[test]
fn one_holds_a_rig_and_the_other_is_told_who() {
    let folder = tempfile::tempdir().expect("a folder");
    let (anna, ben) = (someone("anna", 1), someone("ben", 2));
    let take = |who| RigLock::acquire_in(folder.path(), "lab", who, Duration::ZERO);
    assert_eq!(
        lock::standing(folder.path(), "lab").expect("read"),
        Standing::Free
    );
    let held = take(&anna).expect("free");
    assert_eq!(
        lock::standing(folder.path(), "lab").expect("read"),
        Standing::Held(Some(anna.clone()))
    );
    let text = take(&ben).expect_err("held").to_string();
    let expected = format!(
        "rig lab is held by anna (pid {} on {}) since {}, purpose `qualify`",
        anna.pid, anna.host, anna.since
    );
    assert_eq!(text, expected);
    drop(held);
    assert_eq!(
        lock::standing(folder.path(), "lab").expect("read"),
        Standing::Free
    );
    drop(take(&ben).expect("free again"));
    assert!(
        folder.path().join("lab.lock").exists(),
        "the file is never removed"
    );
}

#[test]
fn waiting_is_bounded_and_ends_when_the_rig_is_free() {
    let folder = tempfile::tempdir().expect("a folder");
    let me = someone("anna", 1);
    let held = RigLock::acquire_in(folder.path(), "lab", &me, Duration::ZERO).expect("free");
    let begun = Instant::now();
    let wait = Duration::from_millis(200);
    let busy = RigLock::acquire_in(folder.path(), "lab", &me, wait);
    assert!(matches!(busy, Err(LockError::Busy { how: "held", .. })));
    assert!(begun.elapsed() >= wait);
    std::thread::scope(|scope| {
        let waiting = scope.spawn(|| {
            RigLock::acquire_in(folder.path(), "lab", &me, Duration::from_secs(60)).is_ok()
        });
        drop(held);
        assert!(waiting.join().expect("no panic"));
    });
}

#[test]
fn a_name_left_by_a_killed_process_is_stale() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = serde_json::json!({ "holder": someone("anna", 1), "reserved": null }).to_string();
    for left in [text.as_str(), &text[..text.len() / 2], "", "no JSON"] {
        std::fs::write(folder.path().join("lab.lock"), left).expect("written");
        assert_eq!(
            lock::standing(folder.path(), "lab").expect("read"),
            Standing::Free,
            "{left}"
        );
        RigLock::acquire_in(folder.path(), "lab", &someone("ben", 2), Duration::ZERO).expect(left);
    }
}

/// What stands in place of a lock file is named, and not opened as one.
#[test]
fn what_is_no_lock_file_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |id: &str| folder.path().join(format!("{id}.lock"));
    let made = std::process::Command::new("mkfifo")
        .arg(place("pipe"))
        .status();
    assert!(made.expect("mkfifo").success());
    std::os::unix::fs::symlink("/dev/null", place("link")).expect("a link");
    std::fs::create_dir(place("folder")).expect("a folder");
    let me = someone("anna", 1);
    for (id, kind) in [
        ("pipe", "a FIFO"),
        ("link", "a symbolic link"),
        ("folder", "a folder"),
    ] {
        let taken = RigLock::acquire_in(folder.path(), id, &me, Duration::ZERO);
        let text = taken.expect_err(id).to_string();
        let words = format!("{id}.lock is {kind} and no lock file; remove it");
        assert!(text.contains(&words), "{text}");
    }
}

#[test]
fn a_reservation_outlives_a_run_and_keeps_others_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let (anna, ben) = (someone("anna", 1), someone("ben", 2));
    let take = |who| RigLock::acquire_in(folder.path(), "lab", who, Duration::ZERO);
    lock::reserve(folder.path(), "lab", &anna).expect("free");
    for _ in 0..2 {
        assert!(matches!(
            take(&ben),
            Err(LockError::Busy {
                how: "reserved",
                ..
            })
        ));
        drop(take(&anna).expect("her own"));
    }
    assert!(lock::unreserve(folder.path(), "lab", &ben, false).is_err());
    let run = take(&anna).expect("her own");
    let disturbed = lock::unreserve(folder.path(), "lab", &ben, true);
    assert!(matches!(
        disturbed,
        Err(LockError::Busy { how: "held", .. })
    ));
    drop(run);
    assert_eq!(
        lock::unreserve(folder.path(), "lab", &ben, true).expect("forced"),
        Some(anna.clone())
    );
    assert_eq!(
        lock::unreserve(folder.path(), "lab", &ben, false).expect("free"),
        None
    );
    drop(take(&ben).expect("free"));
}

#[test]
fn a_quarantine_has_a_reason_and_a_date_and_is_lifted() {
    let folder = tempfile::tempdir().expect("a folder");
    let now = || state::quarantine(folder.path(), "lab").expect("read");
    assert_eq!(now(), None);
    state::set_quarantine(folder.path(), "lab", Some("drive 1 smells")).expect("written");
    let kept = now().expect("set");
    assert_eq!(kept.reason, "drive 1 smells");
    good(&serial(&format!(
        "[quarantine]\nsince = \"{}\"\nreason = \"the same\"",
        kept.since
    )));
    for _ in 0..2 {
        state::set_quarantine(folder.path(), "lab", None).expect("lifted");
    }
    assert_eq!(now(), None);
}

#[test]
fn times_are_shown_in_utc() {
    let shown = |seconds| state::utc(UNIX_EPOCH + Duration::from_secs(seconds));
    assert_eq!(shown(0), "1970-01-01T00:00:00Z");
    assert_eq!(shown(951_782_399), "2000-02-28T23:59:59Z");
    assert_eq!(shown(951_782_400), "2000-02-29T00:00:00Z");
    assert_eq!(shown(1_735_689_599), "2024-12-31T23:59:59Z");
    assert_eq!(shown(4_107_542_400), "2100-03-01T00:00:00Z");
}

#[test]
fn a_port_is_held_once_and_left_as_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("port");
    let open = || std::fs::File::create(&path).expect("a file");
    let (one, other) = (open(), open());
    let held = PortLock::acquire(&one).expect("free");
    assert!(matches!(
        PortLock::acquire(&other),
        Err(PortLockError::Busy { how: "flock" })
    ));
    drop(held);
    drop(PortLock::acquire(&other).expect("free, though the first descriptor is still open"));
}

#[test]
fn a_terminal_is_exclusive_while_it_is_held() {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pty");
    grantpt(&master)
        .and_then(|()| unlockpt(&master))
        .expect("a pty");
    let name = ptsname(&master, Vec::new())
        .expect("a name")
        .into_string()
        .expect("text");
    let open = || {
        std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open(&name)
    };
    let (one, other) = (open().expect("open"), open().expect("open"));
    let held = PortLock::acquire(&one).expect("free");
    assert!(matches!(
        PortLock::acquire(&other),
        Err(PortLockError::Busy { how: "flock" })
    ));
    // Root is let in all the same.
    let root = rustix::process::geteuid().is_root();
    assert_eq!(open().is_ok(), root);
    drop(held);
    open().expect("no longer exclusive");
}
