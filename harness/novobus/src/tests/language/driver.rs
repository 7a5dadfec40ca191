//! Lines that begin with `master`: the driver works in the middle of a scenario.

use super::drives::nd21;
use super::{fails, passes, refused, steps};

#[test]
fn every_call_does_what_it_says() {
    passes(&steps(
        "master write-byte 0..last FE13 = 42\nmaster read-byte 0..last FE13 = 42\nmaster count = N\n\
         master write-word 1 nsoll = 1500rpm\nmaster read-word 1 nsoll = 161E\nmaster or 1 FF08 = 01\n\
         master read-word 1 nsoll = 171E\nread-word 1 nsoll = 171E",
    ));
    passes(&nd21(
        "drive 0..last input GPIN3 GPIN5 high\nmaster stop 1\nwait 1ms\ndrive 1 mode stop\nmaster go 0..last\n\
         wait 1ms\ndrive 0..last mode go\nmaster init-ps 1\nmaster write-ps 1 = 00010000\nmaster start-ps 1\n\
         master wait-for-end 1\ndrive 1 umdrsoll = 1turns\nmaster write-ps 1 = by -0.5turns\nmaster start-ps 1\n\
         master wait-for-end 1\ndrive 1 umdrsoll = 0.5turns\nmaster write-eeprom 1 60 = 12\n\
         master read-eeprom 1 60 = 12\nmaster read-eeprom 1 60 = xx\nmaster read-eeprom 1 60\n\
         master ram-to-eeprom 1\nmaster set-actual-value 1 = 00030000\ndrive 1 umdrist = 3turns +-0.01turns",
    ));
    passes(
        "title x\nring 2, 3\nmaster count = 2\nmaster count ring 2 = 3\nmaster write-byte 2:1 FE13 = 07\nread-byte 2:1 FE13 = 07\n",
    );
}

#[test]
fn faults_on_the_way_are_repaired() {
    passes(&steps(
        "! 2->1 byte 12: flip 3\nmaster write-byte 0..last FE13 = 42\nmaster read-byte 0..last FE13 = 42\n\
         ? corrected 1\n? drives 0..last normal",
    ));
}

#[test]
fn what_cannot_be_done_fails_with_words() {
    fails(
        &steps("master read-byte 1 FE13 = 42"),
        "drive 1 holds 00, expected 42",
    );
    fails(
        &steps("master count = 4"),
        "the ring has 3 drives, expected 4",
    );
    fails(
        &steps("! 2->1: cut\nmaster read-byte 1 FE13"),
        "nothing comes back",
    );
    fails(
        &nd21("master start-ps 1"),
        "waited 5000.000 ms for the calculation of drive 1",
    );
    fails(
        &nd21("! drive 1: error 0151\nmaster reference 1"),
        "drive 1 is in error mode: 0151 ASICread0",
    );
    fails(
        &nd21("drive 1 input GPIN5 high\nmaster reference 1"),
        "the referencing run was interrupted by stop",
    );
}

#[test]
fn mistakes_are_found_before_anything_is_sent() {
    refused(
        &steps("master raed-byte 1 FE13"),
        "raed-byte",
        "a job of the driver expected",
        Some("`read-byte`"),
    );
    refused(&steps("master read-byte 3 FE13"), "3", "drive 3", None);
    refused(
        &steps("master write-byte 1 1000 = 00"),
        "1000",
        "does not reach",
        None,
    );
    refused(
        &steps("master write-ps 1 = 20000turns"),
        "20000turns",
        "20000",
        None,
    );
    refused(
        &steps("master write-ps 1 = 0001"),
        "0001",
        "2 bytes where 4",
        None,
    );
    refused(&steps("master count = 300"), "300", "300 drives", None);
    refused(&steps("master write-eeprom 1 60"), "", "`=`", None);
}
