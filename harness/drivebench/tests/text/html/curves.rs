//! Curves in a browser: the cursor by pointer and keys, widths, dark, and a picture of its own.

use super::devtools::Browser;
use super::folder;
use super::parser::{parse, sound};
use super::program::{drivebench, path};
use serde_json::json;

const TIP: &str = "document.querySelector('.tip:not([hidden])')?.textContent ?? ''";
const SAID: &str = "document.querySelector('.plot .said').textContent";

/// Two recordings of different units, with a gap.
const RECORDING: &str =
    "time_ms,0 nist [rpm],0 UZK [V]\n0,0,600\n10,100,601\n20,,602\n30,300,603\n40,400,604\n";

#[test]
fn a_cursor_tells_samples_to_pointer_and_keys() {
    let home = folder("curves");
    let recording = home.join("r.csv");
    std::fs::write(&recording, RECORDING).expect("a file");
    let (page, picture) = (home.join("r.html"), home.join("r.svg"));
    for file in [&page, &picture] {
        let output = drivebench(&["plot", path(&recording), "--output", path(file)]);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
    }
    sound(&parse(&std::fs::read_to_string(&page).expect("a page")));
    let Some(mut browser) = Browser::start(&home.join("profile")) else {
        return;
    };
    browser.open(&page);
    browser.value("document.querySelector('.plot').focus()");
    browser.press("ArrowRight");
    assert_eq!(
        browser.text(SAID),
        "0.000 ms; r: 0 nist: 0 rpm; r: 0 UZK: 600 V"
    );
    browser.press("ArrowRight");
    browser.press("ArrowRight");
    // There nist has no sample: the nearest one is named with its own time.
    let said = browser.text(SAID);
    assert!(
        said.starts_with("20.000 ms; r: 0 nist: 300 rpm at 30.000 ms; r: 0 UZK: 602 V"),
        "{said}"
    );
    browser.press("End");
    let said = browser.text(SAID);
    assert!(said.starts_with("40.000 ms; r: 0 nist: 400 rpm"), "{said}");
    let cursor = "getComputedStyle(document.querySelector('.plot .cursor'))";
    assert_eq!(browser.text(&format!("{cursor}.visibility")), "visible");
    assert_ne!(browser.text(&format!("{cursor}.stroke")), "none");
    browser.press("Escape");
    assert_eq!(browser.text(&format!("{cursor}.visibility")), "hidden");

    // The widths of telephones, windows and screens: nothing is cut off, and text keeps its size.
    for width in [390, 800, 1400] {
        let metrics =
            json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false});
        browser.call("Emulation.setDeviceMetricsOverride", metrics);
        let seen = browser.value(
            "(() => { const line = document.querySelector('.q').getBoundingClientRect(), text = document.querySelector('.chart text');
               return [document.documentElement.scrollWidth <= innerWidth, line.left > 0 && line.right <= innerWidth && line.width > 250,
                       parseFloat(getComputedStyle(text).fontSize) >= 12]; })()",
        );
        assert_eq!(seen, json!([true, true, true]), "{width}");
        // The pointer at the right end of the curve is at its last sample.
        let end = browser.value("(() => { const box = document.querySelector('.q').getBoundingClientRect(); return [box.right - 1, box.top + 2]; })()");
        let at = |place: usize| end[place].as_f64().expect("a number");
        browser.point(at(0), at(1));
        browser.until(&format!("({TIP}).startsWith('40.000 ms')"));
        browser.point(2.0, 2.0);
        browser.until(&format!("({TIP}) === ''"));
    }

    // Dark, in the page and in the picture.
    let colour = "getComputedStyle(document.querySelector('.q0')).stroke";
    for file in [&page, &picture] {
        browser.open(file);
        let mut seen = Vec::new();
        for scheme in ["light", "dark"] {
            let feature = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
            browser.call("Emulation.setEmulatedMedia", feature);
            seen.push(browser.text(colour));
        }
        assert_eq!(seen, ["rgb(5, 80, 174)", "rgb(121, 184, 255)"]);
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());
}
