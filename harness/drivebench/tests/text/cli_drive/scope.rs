//! `drivebench scope`: a run-up and the mistakes.

use super::*;

/// ND21 14.10.6: the run-up of a drive, in time order and in its units.
#[test]
fn scope_of_a_run_up() {
    let folder = folder("scope");
    let arguments: Vec<_> =
        "scope 0 nist nsollrampe --trigger nist --level 100rpm --time-base 864us \
        --delay -5ms --then nsoll=1500rpm --move --csv s.csv --html s.html --svg s.svg"
            .split_whitespace()
            .collect();
    let (code, stdout, stderr) = drivebench_in(&folder, &arguments);
    assert_eq!(code, 0, "{stderr}");
    assert!(
        stderr.starts_with("drive 0 is in go, and nsoll orders a motion"),
        "{stderr}"
    );
    for part in [
        "drive 0 nist, every 1.728 ms\n  1492 rpm |",
        "drive 0 nsollrampe, every 1.728 ms\n",
        "\nthe trigger is at 5.184 ms\n",
    ] {
        assert!(stdout.contains(part), "{part}\n{stdout}");
    }
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a file");
    for drawn in [read("s.html"), read("s.svg")] {
        assert!(
            drawn.contains("Oscilloscope of drive 0")
                && drawn.contains("Times count from the trigger."),
            "{drawn}"
        );
        assert!(
            drawn.contains("0 nist [rpm]: 128 samples") && drawn.contains(">1500</text>"),
            "{drawn}"
        );
    }
    let csv = std::fs::read_to_string(folder.join("s.csv")).expect("a file");
    let lines: Vec<_> = csv.lines().collect();
    assert_eq!(lines.len(), 257);
    assert_eq!(lines[0], "time_us,signal,name,raw,value,unit");
    assert!(lines[1].starts_with("-5184,"), "{}", lines[1]);
    let values = |name: &str| -> Vec<f64> {
        let of = lines.iter().filter(|line| line.contains(name));
        of.map(|line| {
            line.split(',')
                .nth(4)
                .and_then(|value| value.parse().ok())
                .expect("a number")
        })
        .collect()
    };
    let nist = values(",nist,");
    assert_eq!(nist.len(), 128);
    assert!(
        nist.windows(2).all(|pair| pair[0] <= pair[1]),
        "a run-up: {nist:?}"
    );
    assert!(nist[0] < 100.0 && nist[127] > 1400.0, "{nist:?}");
}

#[test]
fn scope_without_a_trigger_and_its_mistakes() {
    let flat = shown("scope 0 nist --time-base 1ms");
    assert!(
        flat.starts_with("drive 0 nist, every 0.972 ms\n  0 rpm |**"),
        "{flat}"
    );
    assert!(
        flat.ends_with("recorded at once, without a trigger\n"),
        "{flat}"
    );
    for (line, part) in [
        (
            "scope 0 RefV1",
            "`RefV1` is not a signal of the oscilloscope",
        ),
        (
            "scope 0 EE_pole",
            "`EE_pole` is not a signal of the oscilloscope",
        ),
        ("scope 0 nist --level 3rpm", "--trigger"),
        (
            "scope 0 nist --trigger nist --level 9999rpm",
            "at most 8000",
        ),
        (
            "scope 0 nist --time-base 50us",
            "at least 108 expected (ND21 14.10.6.2)",
        ),
        ("scope 0 nist --time-base 1rpm", "us or ms or s"),
        (
            "scope 0 nist --trigger nist --level 5rpm --delay -9s",
            "14.10.6.4",
        ),
        ("scope 0 nist --delay 5ms", "--trigger"),
    ] {
        refused(line, 2, &[part]);
    }
    refused(
        "scope 0 nist --trigger nist --level 100rpm --wait 100ms",
        1,
        &["drive 0: the trigger did not come within 100.000 ms; the recording was stopped"],
    );
}
