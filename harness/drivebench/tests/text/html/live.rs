//! The live page in a browser: what it shows, what a press of a button does, and what another web site can do.

use super::devtools::Browser;
use super::folder;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};

/// The program with a page; it ends with the test.
struct Served {
    child: Child,
    url: String,
}

impl Served {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
            .args(arguments)
            .args(["--web", "127.0.0.1:0"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program");
        let mut line = String::new();
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        out.read_line(&mut line).expect("a line");
        let url = line.trim_end().strip_prefix("page at ").expect("a page");
        let url = url.to_owned();
        Self { child, url }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _gone = self.child.kill();
        let _ended = self.child.wait();
    }
}

/// ND21 9.7: a press of a link, by the keyboard, and the address of the drive behind it stands in the master's column.
#[test]
fn a_fault_is_injected_by_keys_and_its_address_arrives() {
    let Some(mut browser) = Browser::start(&folder("live-fault")) else {
        return;
    };
    let served = Served::start(&["sim", "--rig", "sim:3"]);
    browser.go(&served.url);
    browser.until("document.querySelectorAll('#stations tbody tr').length === 3");
    assert_eq!(
        browser.text("document.querySelector('#link').textContent"),
        "Live."
    );
    browser.value("[...document.querySelectorAll('#rows thead button')].find((button) => button.textContent === '2->1').focus()");
    browser.press("Enter");
    browser.until("document.querySelector('#notes').textContent.includes('Address 01 has reached the master')");
    // The last byte of the picture is the master's: address 01, and the zeros stand above it.
    let cells = "[...document.querySelectorAll('#rows tbody tr')].map((row) => row.cells.length > 4 ? row.cells[4].textContent : '')";
    browser.until(&format!("{cells}.at(-1) === '01'"));
    let zeros = browser.value(&format!(
        "{cells}.filter((text) => /^[!*#]?00$/.test(text)).length"
    ));
    assert_eq!(zeros, 17);
    let marked = browser.text(&format!(
        "{cells}.filter((text) => text.length === 3).join(' ')"
    ));
    assert_eq!(marked, "!00 *00 #00");
    assert_eq!(
        browser.text("document.querySelector('#stations tbody').rows[1].cells[1].textContent"),
        "error 0502 SCIparity"
    );
    assert!(
        browser
            .text("document.querySelector('#said').textContent")
            .starts_with("! 2->1: flip 0")
    );
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// What a page of another origin may try: to read, to post, and to show the page in a frame.
#[test]
fn another_web_site_gets_nothing() {
    let Some(mut browser) = Browser::start(&folder("live-attack")) else {
        return;
    };
    let served = Served::start(&["sim", "--rig", "sim:3"]);
    let (place, token) = served.url.split_once('#').expect("a token");
    let attacker = folder("live-attack-page").join("attack.html");
    std::fs::write(&attacker, "<!DOCTYPE html><title>evil</title>").expect("room");
    browser.open(&attacker);
    for options in [
        "{}".to_owned(),
        "{method: 'POST', mode: 'no-cors', body: '{\"place\":1,\"fault\":0}'}".to_owned(),
        format!(
            "{{method: 'POST', headers: {{'Content-Type': 'application/json', 'Drivebench-Token': '{token}'}}, body: '{{\"place\":1,\"fault\":0}}'}}"
        ),
    ] {
        let tried = browser.text(&format!(
            "fetch('{place}fault', {options}).then(async (reply) => reply.type + (await reply.text()), () => 'failed')"
        ));
        assert!(["failed", "opaque"].contains(&tried.as_str()), "{tried}");
    }
    // The bench has had no fault: its page shows drives that are normal.
    browser.go(&served.url);
    browser.until("document.querySelectorAll('#stations tbody tr').length === 3");
    let states = browser.text("[...document.querySelectorAll('#stations tbody tr')].map((row) => row.cells[1].textContent).join()");
    assert_eq!(states, "normal,normal,normal");
    // Without the token the page shows nothing of the bench.
    browser.go("about:blank");
    browser.go(place);
    browser.until("document.querySelector('#link').textContent.startsWith('The token is missing')");
    assert_eq!(
        browser.text("document.querySelector('#stations').textContent"),
        ""
    );
}

/// The page fits narrow and wide windows, and every control has a name.
#[test]
fn every_bus_has_a_page_that_fits() {
    let Some(mut browser) = Browser::start(&folder("live-sizes")) else {
        return;
    };
    for arguments in [
        &["sim", "--rig", "sim:40"][..],
        &["sim", "--bus", "unitek", "--drives", "2"],
        &["sim", "--bus", "nordac", "--slaves", "8,9"],
        &["top", "--rig", "sim:2"],
        &["top", "--rig", "sim:unitek:2"],
    ] {
        let served = Served::start(arguments);
        browser.go(&served.url);
        browser.until("document.querySelectorAll('#stations tbody tr').length > 1");
        if arguments[0] == "sim" {
            browser.value("document.querySelector('#scripts button').click()");
            browser.until("document.querySelectorAll('#rows tbody tr').length > 0");
        }
        for width in [390, 768, 1200] {
            let size = serde_json::json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false});
            browser.call("Emulation.setDeviceMetricsOverride", size);
            browser.until(&format!("innerWidth === {width}"));
            let wide = browser.value("document.documentElement.scrollWidth");
            assert!(
                wide.as_u64() <= Some(width),
                "{arguments:?} at {width}: {wide}"
            );
        }
        let nameless = "[...document.querySelectorAll('button')].filter((button) => !button.textContent.trim()).length";
        assert_eq!(browser.value(nameless), 0, "{arguments:?}");
        // It must not ask for more when the program has ended.
        browser.go("about:blank");
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());
}
