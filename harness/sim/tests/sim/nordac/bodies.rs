//! The bodies of the fuzz targets on random inputs.

use super::common::property;
use harness_sim::nordac::fuzz;
use proptest::prelude::*;

/// Octets of which many are those with which telegrams begin and end, and the addresses of the bench.
fn octet() -> impl Strategy<Value = u8> {
    let usual = vec![
        0x10, 0x16, 0x68, 0xA2, 0xDC, 0xE5, 0x08, 0x02, 0x88, 0x82, 0x49, 0x6D, 0x3C, 0x3E, 0x04,
        0x05, 0x07, 0x00,
    ];
    prop_oneof![proptest::sample::select(usual), any::<u8>()]
}

#[test]
fn fdl_takes_any_octets() {
    let octets = proptest::collection::vec(octet(), 0..200);
    property("fdl_takes_any_octets", 2_000, &octets, |octets| {
        fuzz::fdl(&octets);
        Ok(())
    });
}

/// Status requests with one octet changed, and whole ones.
#[test]
fn fdl_takes_damaged_telegrams() {
    let request = [0x10, 0x08, 0x02, 0x49, 0x53, 0x16];
    let one = (0..6_usize, octet(), 0..32_u8, 5..8_u8);
    let all = proptest::collection::vec(one, 1..20);
    property("fdl_takes_damaged_telegrams", 1_000, &all, |all| {
        let mut pairs = Vec::new();
        for (place, other, what, idle) in all {
            for (at, octet) in request.into_iter().enumerate() {
                let harm = if at == place { what } else { 0 };
                let octet = if at == place && what == 31 {
                    other
                } else {
                    octet
                };
                pairs.extend([harm | if at == 0 { idle } else { 0 }, octet]);
            }
        }
        fuzz::fdl(&pairs);
        Ok(())
    });
}

#[test]
fn dp_takes_any_data() {
    let data = proptest::collection::vec(any::<u8>(), 0..24);
    property("dp_takes_any_data", 5_000, &data, |data| {
        fuzz::dp(&data);
        Ok(())
    });
}
