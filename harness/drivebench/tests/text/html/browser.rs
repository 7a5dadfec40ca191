//! Pages in a browser: pictures, hover, keys, times, colours, print, and that no page needs a script.

use super::devtools::Browser;
use super::program::{drivebench, finding, path};
use super::{FAILS, folder, page, text};
use serde_json::json;
use std::path::Path;

/// Where the middle of a byte of the first picture stands in the window: `link` and `row` counted from 0.
fn middle(browser: &mut Browser, link: usize, row: usize) -> (f64, f64) {
    let found = browser.value(&format!(
        "(() => {{ const root = document.querySelector('.ring'); const data = JSON.parse(root.querySelector('script').textContent);
           const svg = root.querySelector('svg'); const box = svg.getBoundingClientRect();
           const scale = box.width / svg.viewBox.baseVal.width;
           return [box.left + scale * (data.left + data.column * ({link} + .5)), box.top + scale * (data.top + data.row * ({row} + .5))]; }})()"
    ));
    let at = |place: usize| found[place].as_f64().expect("a number");
    (at(0), at(1))
}

const TIP: &str = "document.querySelector('.tip:not([hidden])')?.textContent ?? ''";
const SAID: &str = "document.querySelector('.ring .said').textContent";

/// The browser with the page of the parity error of ND21 9.7, its diagram ready.
fn opened(name: &str) -> Option<Browser> {
    let home = folder(name);
    let mut browser = Browser::start(&home.join("profile"))?;
    let file = home.join("page.html");
    std::fs::write(
        &file,
        page(&[("9.7-parity-error", text("9.7-parity-error"))]),
    )
    .expect("a file");
    ready(&mut browser, &file);
    Some(browser)
}

/// Opens a page and waits until its first diagram is ready.
fn ready(browser: &mut Browser, file: &Path) {
    browser.open(file);
    browser.value("document.querySelector('.ring').scrollIntoView()");
    browser.until("!!document.querySelector('.ring .tools button')");
}

#[test]
fn a_byte_is_told_to_the_pointer() {
    let Some(mut browser) = opened("pointer") else {
        return;
    };
    let size = browser.value("(() => { const box = document.querySelector('.ring svg').getBoundingClientRect(); return [box.width, box.height]; })()");
    assert!(
        size[0].as_f64() > Some(800.0) && size[1].as_f64() > Some(200.0),
        "{size}"
    );

    // ND21 9.7: the damaged byte is the 10th of the link from 98 to 97.
    let (x, y) = middle(&mut browser, 2, 9);
    browser.point(x, y);
    browser.until(&format!("({TIP}) !== ''"));
    let tip = browser.text(TIP);
    assert!(tip.starts_with("Fault. 98->97, byte 10, "), "{tip}");
    assert!(
        tip.contains("13 sent, 12 received (parity)") && tip.contains("(ND21 "),
        "{tip}"
    );
    browser.point(2.0, 2.0);
    browser.until(&format!("({TIP}) === ''"));

    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn a_byte_is_told_to_keys() {
    let Some(mut browser) = opened("keys") else {
        return;
    };
    // By keys: the picture is reached by the tabulator, and says what the cursor is at.
    browser.value("document.querySelector('.ring .tools button:last-of-type').focus()");
    browser.press("Tab");
    assert_eq!(browser.text("document.activeElement.className"), "scroll");
    browser.press("ArrowRight");
    assert!(browser.text(SAID).starts_with("master->99, byte 1, "));
    browser.press("ArrowRight");
    browser.press("ArrowDown");
    let said = browser.text(SAID);
    assert!(
        said.starts_with("99->98, byte 2, ") && said.contains("(ND21 9.3)"),
        "{said}"
    );
    browser.press("f");
    let said = browser.text(SAID);
    assert!(said.starts_with("Fault. 98->97, byte 10, "), "{said}");
    browser.press("End");
    assert!(browser.text(SAID).contains("98->97, byte "));
    assert!(browser.value("!!document.querySelector('.said[role=status]')") == json!(true));

    // Larger, and back.
    let width = "document.querySelector('.ring svg').getBoundingClientRect().width";
    let before = browser.value(width).as_f64();
    browser.press("+");
    assert!(browser.value(width).as_f64() > before);
    browser.press("-");
    assert_eq!(browser.value(width).as_f64(), before);
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn bytes_stand_at_their_times() {
    let Some(mut browser) = opened("times") else {
        return;
    };
    browser.value("document.querySelector('.scroll').focus()");
    browser.press("ArrowRight");
    // The same byte where its time is.
    browser.press("Home");
    browser.press("f");
    let before = browser.value("document.querySelector('.cursor').getAttribute('y')");
    browser.press("t");
    assert_eq!(
        browser.text("document.querySelector('[aria-pressed]').getAttribute('aria-pressed')"),
        "true"
    );
    assert_ne!(
        browser.value("document.querySelector('.cursor').getAttribute('y')"),
        before
    );
    assert_eq!(
        browser.value("document.querySelectorAll('.by-time path').length > 3"),
        json!(true)
    );
    browser.value(
        "document.querySelector('.cursor').scrollIntoView({block: 'center', inline: 'center'})",
    );
    let place = browser.value("(() => { const box = document.querySelector('.cursor').getBoundingClientRect(); return [box.left + box.width / 2, box.top + box.height / 2]; })()");
    browser.press("Escape");
    browser.point(place[0].as_f64().expect("x"), place[1].as_f64().expect("y"));
    browser.until(&format!("({TIP}) !== ''"));
    let tip = browser.text(TIP);
    assert!(tip.starts_with("Fault. 98->97, byte 10, "), "{tip}");

    browser.press("t");
    assert_eq!(
        browser.value("document.querySelector('.by-time') === null"),
        json!(true)
    );
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// A telephone's width holds the page; `next` goes to the byte that differs; Escape closes what is shown of it; a search leaves the rows that fit.
#[test]
fn a_narrow_page_next_and_a_search() {
    let home = folder("narrow");
    let Some(mut browser) = Browser::start(&home.join("profile")) else {
        return;
    };
    let file = home.join("page.html");
    let names = ["9.2-synco", "9.7-parity-error", "9.8-check-sequence"];
    let others = names.map(|name| (name, text(name)));
    let all = [&[("fails", FAILS.to_owned())], &others[..]].concat();
    std::fs::write(&file, page(&all)).expect("a file");
    let narrow = json!({"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": false});
    browser.call("Emulation.setDeviceMetricsOverride", narrow);
    ready(&mut browser, &file);
    let width = browser.value("document.documentElement.scrollWidth");
    assert!(width.as_u64() <= Some(390), "{width}");
    browser.value("[...document.querySelector('.ring .tools').querySelectorAll('button')].find((button) => button.textContent === 'next').click()");
    let said = browser.text(SAID);
    assert!(said.starts_with("The first byte that differs. "), "{said}");
    browser.until(&format!("({TIP}) !== ''"));
    browser.value("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' }))");
    assert_eq!(browser.text(TIP), "");
    browser.value("(() => { const find = document.querySelector('.find'); find.value = '9.7-parity'; find.dispatchEvent(new Event('input')); })()");
    let rows = browser.value("[...document.querySelectorAll('table.rows tbody tr')].filter((row) => row.offsetHeight > 0).length");
    assert_eq!(rows, json!(1));
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn light_dark_print_and_without_scripts() {
    let home = folder("looks");
    let Some(mut browser) = Browser::start(&home.join("profile")) else {
        return;
    };
    let file = home.join("page.html");
    std::fs::write(
        &file,
        page(&[
            ("fails", FAILS.to_owned()),
            ("9.2-synco", text("9.2-synco")),
        ]),
    )
    .expect("a file");
    browser.open(&file);
    let page_colour = "getComputedStyle(document.body).backgroundColor";
    let mut colours = Vec::new();
    for scheme in ["light", "dark"] {
        let features = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.call("Emulation.setEmulatedMedia", features);
        colours.push((
            browser.text(page_colour),
            browser.text("getComputedStyle(document.querySelector('path.b')).fill"),
        ));
    }
    assert_eq!(colours[0].0, "rgb(255, 255, 255)");
    assert_ne!(colours[0].0, colours[1].0);
    assert_ne!(colours[0].1, colours[1].1);

    browser.call(
        "Emulation.setEmulatedMedia",
        json!({"media": "print", "features": []}),
    );
    let printed = "getComputedStyle(document.querySelector('nav')).display + ' ' + getComputedStyle(document.querySelector('.scroll')).overflow";
    assert_eq!(browser.text(printed), "none visible");
    browser.call("Emulation.setEmulatedMedia", json!({"media": ""}));
    assert_eq!(browser.complaints(), Vec::<String>::new());

    browser.call(
        "Emulation.setScriptExecutionDisabled",
        json!({"value": true}),
    );
    browser.open(&file);
    let bare = browser.value(
        "[document.querySelectorAll('.ring svg').length, document.querySelectorAll('.tools').length, document.querySelector('.ring svg').getBoundingClientRect().height > 50,
          document.querySelector('table.bytes').innerText.includes('C1')]",
    );
    assert_eq!(bare, json!([2, 0, true, true]));
}

/// The map of a campaign: its cells have a size, a colour for each outcome, and say to the pointer what happened.
#[test]
fn the_map_of_a_campaign() {
    let home = folder("map");
    let Some(mut browser) = Browser::start(&home.join("profile")) else {
        return;
    };
    let file = home.join("page.html");
    let output = drivebench(&["campaign", "9.9-silence", "--html", path(&file)]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    browser.open(&file);
    let cells = "[...document.querySelectorAll('table.heat td')]";
    let seen = browser.value(&format!(
        "(() => {{ const all = {cells}; const box = all[0].getBoundingClientRect();
           return [all.length > 20, box.width > 3 && box.height > 3, all.filter(cell => cell.title).every(cell => cell.className !== '' && /^[0-9]+ [a-z]/.test(cell.title) && cell.textContent !== ''),
             new Set(all.map(cell => getComputedStyle(cell).backgroundColor)).size > 1]; }})()"
    ));
    assert_eq!(seen, json!([true, true, true, true]));
    let titles = browser.value(&format!(
        "{cells}.map(cell => cell.title).filter(Boolean).length"
    ));
    assert!(titles.as_u64() > Some(20), "{titles}");
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// The page of a fuzzing finding has the picture, and the arrow keys read out its bytes.
#[test]
fn the_page_of_a_finding() {
    let home = folder("finding");
    let Some(mut browser) = Browser::start(&home.join("profile")) else {
        return;
    };
    let (_run, file) = finding(&home);
    ready(&mut browser, &file);
    browser.value("document.querySelector('.ring .scroll').focus()");
    browser.press("ArrowRight");
    let said = browser.text(SAID);
    assert!(said.contains("byte 1, "), "{said}");
    let (x, y) = middle(&mut browser, 0, 0);
    browser.point(x, y);
    browser.until(&format!("({TIP}) !== ''"));
    assert_eq!(browser.complaints(), Vec::<String>::new());
}
