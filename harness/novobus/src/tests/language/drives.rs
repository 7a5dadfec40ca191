//! Drives outside the bus and their cells: what happens to them, what must hold of them, and values with
//! units.

use super::{entry, fails, passes, play, refused};

/// A scenario for two plain drives, which hold what they are given, with these lines.
pub(crate) fn plain(lines: &str) -> String {
    format!("title test\nring 2\n{lines}\n")
}

/// A scenario for two nd21 with these lines.
pub(crate) fn nd21(lines: &str) -> String {
    format!("title test\nring 2\ndrive 0..last model nd21\n{lines}\n")
}

#[test]
fn stimuli_are_header_lines_and_steps() {
    for word in [
        "input GPIN3 GPIN5 high",
        "input ESCHN low",
        "analogue 5V",
        "analogue -2.5 V",
        "analogue 250mV",
        "frequency 20kHz",
        "frequency 0 Hz",
        "frequency 1MHz",
        "cooler 95C",
        "cooler -5.5 C",
        "cooler 95°C",
        "motor-sensor 5000ohm",
        "motor-sensor 5 kohm",
        "rail 850V",
        "resolver off",
        "resolver on",
        "load 5A",
        "load -500mA",
        "load 2.5 Aeff",
        "rotor jammed",
        "rotor free",
        "phases shorted",
        "phases sound",
        "power off",
        "power on",
    ] {
        passes(&nd21(&format!(
            "drive 0..last {word}\n> 80\ndrive 1 {word}\n+5ms drive 0 {word}\n@9ms drive 1 {word}"
        )));
    }
    // In the header they happen before anything is sent, and are no step.
    let lines = nd21("drive 0 input GPIN3 high\ndrive 1 power off\n> 80*3\n? received 0 bytes");
    assert_eq!(entry(&lines).expect("no mistake").scenario.head().steps, 2);
    passes(&lines);
    passes(&nd21(
        "> 80\n< 80\ndrive 0 power off\n> 80\n+5ms drive 0 power on\n? received 1 bytes",
    ));
}

/// ND21 11.8: a whole drive reports its reset by itself, whatever the header says that `Status` held.
#[test]
fn a_header_resets_no_drive() {
    passes(&nd21(
        "drive 0 memory Status = C0\n> 80*9\n? drive 0 Status & C0 = 80\n? drive 0 normal",
    ));
}

/// ND21 9.7: a drive with another sum sends the same zeros before it begins to add, after FF too, which with 1 is 00.
#[test]
fn a_zero_of_the_error_mode_is_no_sum() {
    for (deviation, sum) in [
        ("increments-twice-in-error-mode", 2),
        ("adds-3-in-error-mode", 3),
    ] {
        passes(&format!(
            "title t\nring 1\ndrive 0 deviates {deviation}\n> 08 FF*3 00*14\n< 00*17 0{sum}\n"
        ));
    }
}

#[test]
fn stimuli_that_cannot_be_are_refused() {
    let lines = |line: &str| nd21(&format!("{line}\n> 80"));
    refused(
        &lines("drive 0 input GPIN9 high"),
        "GPIN9",
        "an input",
        Some("GPIN"),
    );
    refused(
        &lines("drive 0 input GPIN3 hihg"),
        "hihg",
        "`high`, `low`",
        Some("`high`"),
    );
    refused(&lines("drive 0 input GPIN3"), "", "`high`, `low`", None);
    refused(
        &lines("drive 0 inptu GPIN3 high"),
        "inptu",
        "a setting or a condition",
        Some("`input`"),
    );
    refused(
        &lines("drive 0 analogue 11V"),
        "11V",
        "11 V is not possible",
        None,
    );
    refused(
        &lines("drive 0 analogue 5A"),
        "5A",
        "`A` does not fit",
        None,
    );
    refused(&lines("drive 0 analogue 5"), "", "a unit (V or mV)", None);
    refused(
        &lines("drive 0 frequency 2MHz"),
        "2MHz",
        "not possible",
        None,
    );
    refused(
        &lines("drive 0 frequency 20kHzz"),
        "kHzz",
        "not a unit",
        Some("`kHz`"),
    );
    refused(&lines("drive 0 cooler 201C"), "201C", "not possible", None);
    refused(&lines("drive 0 rail 1001V"), "1001V", "not possible", None);
    refused(&lines("drive 0 load 101A"), "101A", "not possible", None);
    refused(
        &lines("drive 0 load 9999999999999A"),
        "9999999999999",
        "too many digits",
        None,
    );
    refused(
        &lines("drive 0 rotor stuck"),
        "stuck",
        "(free, jammed)",
        None,
    );
    refused(
        &lines("drive 0 type 5611"),
        "5611",
        "5605, 5610, 5615 or 5620",
        None,
    );
    refused(
        "title x\nring 2\ndrive 1 model nd21\ndrive 0..1 input GPIN3 high\n> 80\n",
        "drive 0..1 input GPIN3 high",
        "drive 0 has no plugs",
        Some("`drive 0 model nd21`"),
    );
    refused(
        "title x\nring 2\ndrive 0 model plain\n> 80\n+5ms drive 0 input GPIN3 high\n",
        "+5ms drive 0 input GPIN3 high",
        "drive 0 has no plugs",
        Some("`drive 0 model nd21`"),
    );
    refused(
        "title x\nring 1\ndrive 0 model plain\n? drive 0 GPO1 high\n",
        "0 GPO1 high",
        "drive 0 has no plugs",
        Some("model nd21"),
    );
    refused(
        &nd21("> 80\ndrive 0 memory FE13 = 88"),
        "drive",
        "after the first step",
        Some("`? drive"),
    );
    refused(
        &nd21("> 80\n+5ms drive 0 model nd21"),
        "drive 0 model nd21",
        "after the first",
        None,
    );
}

#[test]
fn a_drives_monitoring_reports_errors() {
    passes(&nd21(
        "! drive 0: error 0151\n? drive 0 errorcode = 0151\ndrive 0 Status & 20 = 20",
    ));
    passes(&nd21(
        "! drive 0: error ASICread0\ndrive 0 errorcode = 0151\ndrive 1 errorcode = 0000",
    ));
    passes(&nd21("! drive 0: error strom a\ndrive 0 errorcode = 0112"));
    passes(&nd21(
        "! drive 0 @20ms: error 0151\n@19ms ? drive 0 errorcode = 0000\n@21ms ? drive 0 errorcode = 0151",
    ));
    passes(&nd21(
        "+5ms ! drive 0: error 0151\ndrive 0 errorcode = 0151",
    ));
    let (outcome, _) = play(&nd21("! drive 0 from 20ms: error 0151\n> 80\n< 80"));
    assert!(
        outcome.remarks[0].contains("drive 0 at 20.000 ms: error 0151"),
        "{outcome:?}"
    );
    refused(
        &nd21("! drive 0: error 0999"),
        "0999",
        "an error code",
        None,
    );
    refused(
        &nd21("! drive 0: error ASICraed0"),
        "ASICraed0",
        "an error code",
        Some("`ASICread0`"),
    );
    refused(
        &nd21("! drive 0 byte 3: error 0151"),
        "3",
        "not timed in bytes",
        None,
    );
    refused(
        "title x\nring 1\ndrive 0 model plain\n! drive 0: error 0151\n",
        "0",
        "drive 0 has no monitoring",
        None,
    );
}

#[test]
fn cells_are_checked_by_their_names() {
    let cells = |check: &str| {
        plain(&format!(
            "drive 0..last memory nist = 1500rpm\ndrive 0..last memory nRampe+ = 100000rpm/s\n\
             drive 0..last memory Slipping error = 90deg\ndrive 0..last memory Flags2 = E4\n\
             drive 0..last memory umdrist = 10.25turns\ndrive 0..last memory umdrsoll = -10.25turns\n\
             drive 0..last memory imax = 10.0A\n\
             drive 0..last memory ps_status = 21\n{check}"
        ))
    };
    for check in [
        "nist = 1500rpm",
        "nist = 1500 rpm +-1%",
        "nist = 1510rpm +-10.2rpm",
        "nist = 161E",
        "nist = 16 xx",
        "nist > 1499rpm",
        "nist <= 1500.2rpm",
        "nist < 2000",
        "nist >= 161E",
        "nist > FFFF",
        "nRampe+ = 100000rpm/s +-1%",
        "nRampe+ = 10472rad/s2 +-1%",
        "Slipping error = 0.25turns",
        "Flags2 = E4",
        "Flags2 & E0 = E0",
        "ps_status & 20 = 20",
        "umdrist = 10.25turns +-0.01turns",
        "umdrist = 10.25turns",
        "umdrist = 3690deg",
        "umdrist = 000A",
        "umdrist = 000A4000",
        "position = 10.25turns",
        "position > 10.2turns",
        "lageist = 90deg",
        "umdrsoll = -10.25turns",
        "umdrsoll < 0turns",
        "imax = 10.0A +-1%",
        "imax = 10Aeff +-1%",
        "imax < 11A",
        "scope_puffer = 0000",
        "memory nist = 161E",
        "memory FF0C = 16 1E",
        "not in error",
    ] {
        passes(&cells(&format!("? drive 0..last {check}")));
        // Behind `drive` alone, `memory` sets cells.
        if !check.starts_with("memory") {
            passes(&cells(&format!("drive 0..last {check}")));
        }
        passes(&cells(&format!("until drive 0..last {check} within 1ms")));
    }
    for (check, message) in [
        (
            "nist = 1600rpm +-1%",
            "drive 0: nist is 1499.9 rpm (161E), expected 1600 rpm +-1 % (and 1 drive more)",
        ),
        (
            "nist = 1501rpm",
            "drive 0: nist is 1499.9 rpm (161E), expected 1501 rpm (1622)",
        ),
        (
            "nist < 1400rpm",
            "nist is 1499.9 rpm (161E), expected < 1400 rpm",
        ),
        ("nist < 1000", "nist is 161E (5662), expected < 4096"),
        (
            "Flags2 & E0 = 80",
            "Flags2 & E0 is E0 (E4 (referencing, monitoring)), expected 80",
        ),
        (
            "ps_status = 01",
            "ps_status is 21 (calculated, finished), expected 01 (finished)",
        ),
        (
            "position = 370deg +-1deg",
            "position is 3690 deg (000A4000), expected 370 deg +-1 deg",
        ),
        (
            "umdrist = 10turns",
            "umdrist is 10.25 turns (000A4000), expected 10 turns (000A0000)",
        ),
        ("imax = 5.0A", "imax is 9.976 A (3A), expected 5 A (1D)"),
        ("nRampe- = off", "nRampe- is 0000, expected 7FFF"),
        (
            "memory FF43 = 01",
            "cell FF43 of drive 0 holds 21, expected 01",
        ),
    ] {
        fails(&cells(&format!("? drive 0..last {check}")), message);
    }
    passes("title x\nring 1, 1\ndrive 2:0 memory nist = 100rpm\ndrive 2:0 nist = 100rpm\n");
    fails(
        "title x\nring 1, 1\ndrive 2:0 nist = 100rpm\n",
        "drive 2:0: nist is 0 rpm (0000)",
    );
}

#[test]
fn cells_that_cannot_be_are_refused() {
    let check = |check: &str| plain(&format!("? drive 0 {check}"));
    refused(&check("nits = 00"), "nits", "a condition", Some("`nist`"));
    refused(&check("nist 1500rpm"), "1500rpm", "`=`, `<`", None);
    refused(
        &check("nist = 1500rpn"),
        "rpn",
        "`rpn` is not a unit",
        Some("`rpm`"),
    );
    refused(
        &check("nist = 1500A"),
        "1500A",
        "`A` does not fit here",
        None,
    );
    refused(
        &check("nist = 9000rpm"),
        "9000rpm",
        "at most 8000 expected",
        None,
    );
    refused(&check("nist = 12"), "12", "1 byte where `nist` has 2", None);
    refused(
        &check("nist = 1500rpm +-1A"),
        "1A",
        "`A` does not fit",
        None,
    );
    refused(
        &check("nist = 1500rpm +-"),
        "",
        "a number with a unit",
        None,
    );
    refused(&check("nist = 161E +-1%"), "+", "follows bytes", None);
    refused(
        &check("nist & FF = 0000"),
        "FF",
        "1 byte where `nist` has 2",
        None,
    );
    refused(
        &check("Flags2 & E0 = 04"),
        "04",
        "that the mask excludes",
        None,
    );
    refused(&check("Flags2 & E0 > 00"), ">", "bits are compared", None);
    refused(&check("uP = 5rpm"), "5rpm", "no unit for `uP`", None);
    refused(&check("stack < 00"), "stack", "is not a number", None);
    refused(
        &check("nRampe+ < off"),
        "off",
        "`off` is not a number",
        None,
    );
    refused(
        &check("imax = 5A"),
        "5A",
        "bytes or a number",
        Some("write `5 A` for"),
    );
    passes(&check("imax < 5 A"));
    fails(&check("imax = [5A]"), "imax is 00, expected 5A");
    refused(&check("display 5"), "5", "three digits", None);
    refused(&check("mode running"), "running", "a mode", None);
}

#[test]
fn outputs_are_checked() {
    passes(&nd21(
        "write-io 0 = 01\ndrive 0 GPO1 high\ndrive 1 GPO1 low\ndrive 0..1 GPO2 low",
    ));
    fails(
        &nd21("drive 0 GPO1 high"),
        "drive 0: GPO1 is low, expected high",
    );
    // Without power nothing is shown.
    passes(&nd21(
        "drive 0 power off\ndrive 0 ready open\ndrive 0 mode reset\ndrive 0 display blank\n\
         drive 0 analogue-output = 0V\ndrive 0 GPO1 low\ndrive 0 analogue-output = 50mV +-0.1V",
    ));
    let off = |check: &str| nd21(&format!("drive 0 power off\n{check}"));
    fails(
        &off("drive 0 ready closed"),
        "ready is open, expected closed",
    );
    fails(&off("drive 0 mode go"), "mode is reset, expected go");
    fails(
        &off("drive 0 display 508"),
        "display is blank, expected 508",
    );
    fails(
        &off("drive 0 analogue-output = 2.5V +-0.1V"),
        "analogue-output is 0 V, expected 2.5 V +-0.1 V",
    );
    fails(&off("drive 0 encoder = 1024 +-2"), "expected 1024 +-2");
    fails(&off("drive 0 encoder = -1024"), "expected -1024");
}

#[test]
fn values_are_written_in_units() {
    passes(&plain(
        "drive 0 memory nMax = 3000rpm\ndrive 0 memory FF66 = 5A\ndrive 0 memory FF68 = 2C3D\n> 80",
    ));
    passes(&plain(
        "drive 0 memory nMax = 3000rpm\n? drive 0 memory nMax = 2C3D",
    ));
    passes(&nd21(
        "drive 0 eeprom nMax = 3000rpm\ndrive 1 eeprom EE_Vtippen = 100rpm\ndrive 1 eeprom EE_RAM = 01 02\n\
         drive 0 eeprom nRampe+ = off\ndrive 1 eeprom 47 = 80\n\
         drive 0 nMax = 2C3D\ndrive 1 Vtippen = 100rpm\ndrive 1 HwVersion = 01\ndrive 1 HwVersion2 = 02\n\
         drive 0 nRampe+ = 7FFF",
    ));
    // Every type and range has its own scale.
    passes(&plain(
        "drive 0 memory imax = 10.0A\ndrive 1 type 5620\ndrive 0..1 memory i0 = 10.0A\n\
         drive 0 memory nsoll = 1500rpm\ndrive 1 memory nsoll = 1500rpm\ndrive 1 eeprom SwVersion2 = 00\n\
         ? drive 0 memory i0 = 3A\n? drive 1 memory i0 = 1D\n? drive 0 memory nsoll = 161E\n\
         ? drive 1 memory nsoll = 0B0F\ndrive 0..1 nsoll = 1500rpm",
    ));
    passes(&plain(
        "drive 1 eeprom 23 = 00\ndrive 1 memory SwVersion2 = 80\ndrive 1 memory nsoll = 1500rpm\n? drive 1 memory nsoll = 161E",
    ));
    passes(&plain(
        "write-word 0 nsoll = 1500rpm\nread-word 0 nsoll = 161E\nread-word 0 nsoll = 1500rpm\n\
         read-word 0 nsoll = 1490rpm +-1%\nwrite-byte 0 imax = 10 A\nread-byte 0 imax = 10Aeff +-1%\n\
         write-word 0 umdrist = 10turns\nwrite-word 0 lageist = 90deg\nread-long 0 umdrist = 10.25turns",
    ));
    fails(
        &plain("drive 0 memory nist = 1498.3rpm\nread-word 0 nist = 1550rpm +-1%"),
        "drive 0: nist is 1498.3 rpm (1618), expected 1550 rpm +-1 %",
    );
    fails(
        &nd21("read-word 0 nist = 1500rpm"),
        "nist is 0 rpm (0000), expected 1500 rpm (161E)",
    );
    let refused_line = |line: &str, place: &str, message: &str| {
        refused(&nd21(&format!("{line}\n> 80")), place, message, None);
    };
    refused_line("drive 0 memory nMax = 8001rpm", "8001rpm", "at most 8000");
    refused_line("drive 0 memory nMax = 3000V", "3000V", "does not fit");
    refused_line(
        "drive 0 memory FE13 = 3000rpm",
        "3000rpm",
        "no cell begins at FE13",
    );
    refused_line(
        "drive 0 eeprom nist = 3000rpm",
        "nist",
        "not loaded from the EEPROM",
    );
    refused_line(
        "drive 0 eeprom EE_Vtipen = 3000rpm",
        "EE_Vtipen",
        "an EEPROM address",
    );
    refused_line(
        "write-byte 0 nsoll = 1500rpm",
        "nsoll",
        "has 2 bytes, the job has 1 byte",
    );
    refused_line("or 0 imax = 10 A", "10 A", "bits are not a number");
    refused_line("write-word 0 nsoll = 1500rpm +-1%", "+-1%", "complete");
}

/// Every line of the page's tables that begins with `drive` is a line of the language.
#[test]
fn the_lines_of_the_page_are_accepted() {
    let page = include_str!("../../../../bench/src/scenario/LANGUAGE.md");
    let rows = page
        .lines()
        .filter_map(|line| line.strip_prefix("| `drive "));
    let mut lines = 0;
    for row in rows {
        let line = row.split('`').next().expect("the end of the code");
        let line = line
            .replace("95..99", "1..2")
            .replace("NAME = VALUE", "time-out = 12ms");
        let text = format!("title x\nring 4\ndrive 0..last model nd21\ndrive {line}\n> 80\n");
        assert!(entry(&text).is_ok(), "{line}: {:#?}", entry(&text).err());
        lines += 1;
    }
    assert!(lines > 25, "{lines}");
}
