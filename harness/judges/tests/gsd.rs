//! The GSD file, read by the public crate gsd-parser, against the tables that the drive is made of.

use gsd_parser::SupportedSpeeds;
use harness_proto::nordac::{IDENT, PpoType};
use harness_proto::profibus::BusRate;
use std::path::Path;

const GSD: &str = include_str!("../../nordac/src/nordac.gsd");

/// GSD: ident number, rates with their longest reply delays, lengths and modules are those of the model; what the print says stands in the file.
#[test]
fn the_gsd_says_what_the_drive_does() {
    let read = gsd_parser::parser::parse(Path::new("nordac.gsd"), GSD);
    let gsd = read.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(gsd.ident_number, IDENT);
    assert_eq!(gsd.vendor, "GETRIEBEBAU NORD GmbH & Co");
    assert_eq!(
        (gsd.model.as_str(), gsd.revision.as_str()),
        ("NORDAC profibus", "1.1")
    );
    assert_eq!(gsd.implementation_type, "SPC4");
    assert!(gsd.freeze_mode_supported && gsd.sync_mode_supported && gsd.auto_baud_supported);
    assert!(!gsd.set_slave_addr_supported && gsd.modular_station);
    assert_eq!((gsd.max_modules, gsd.max_data_length), (4, 40));
    let speeds = SupportedSpeeds::B9600
        | SupportedSpeeds::B19200
        | SupportedSpeeds::B93750
        | SupportedSpeeds::B187500
        | SupportedSpeeds::B500000
        | SupportedSpeeds::B1500000;
    assert_eq!(gsd.supported_speeds, speeds);
    let delays = [
        gsd.max_tsdr.b9600,
        gsd.max_tsdr.b19200,
        gsd.max_tsdr.b93750,
        gsd.max_tsdr.b187500,
        gsd.max_tsdr.b500000,
        gsd.max_tsdr.b1500000,
    ];
    assert_eq!(
        delays.map(u64::from),
        BusRate::ALL.map(BusRate::max_tsdr_bits)
    );
    let modules: Vec<_> = gsd
        .available_modules
        .iter()
        .map(|module| module.config.as_slice())
        .collect();
    assert_eq!(modules, PpoType::ALL.map(PpoType::cfg));
    let longest = PpoType::ALL.map(PpoType::octets).into_iter().max();
    assert_eq!(Some(usize::from(gsd.max_input_length)), longest);
    assert_eq!(Some(usize::from(gsd.max_output_length)), longest);
    let bits: Vec<_> = gsd
        .unit_diag
        .bits
        .iter()
        .map(|(bit, info)| (*bit, info.text.as_str()))
        .collect();
    assert_eq!(
        bits,
        [(1, "SPM-FIFO overflow"), (2, "Actual value is not updated")]
    );
}
