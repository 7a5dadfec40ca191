//! What a diagnosis and a status word can be, whatever has happened to a slave.

use harness_bench::counted::counted;
use harness_proto::nordac::IDENT;
use harness_proto::nordac::words::zsw;
use harness_proto::profibus::dp::Diagnosis;

/// Bits that are always 0: of octet 1 Station_Non_Existent, Not_Supported, Invalid_Slave_Response and Master_Lock, of octet 2 bits 1, 6 and 7.
const ZERO: [u8; 3] = [0xB1, 0xC2, 0xFF];

/// What is wrong with the data of a diagnosis (EN 2); `None` if a right slave can send it.
pub(super) fn wrong(data: &[u8]) -> Option<String> {
    let Some(sent) = Diagnosis::decode(data) else {
        return Some(format!(
            "a diagnosis of {} is sent: 6, or 8 are expected",
            counted(data.len(), "octet")
        ));
    };
    let with_master = sent.master.is_some();
    let waits = sent.has_mode(Diagnosis::PRM_REQ);
    let faults = sent.has(Diagnosis::PRM_FAULT) || sent.has(Diagnosis::CFG_FAULT);
    let modes = sent.has_mode(Diagnosis::WD_ON)
        || sent.has_mode(Diagnosis::FREEZE)
        || sent.has_mode(Diagnosis::SYNC);
    let ready = !sent.has(Diagnosis::NOT_READY);
    let never = sent
        .status
        .iter()
        .zip(ZERO)
        .any(|(byte, zero)| byte & zero != 0);
    let extension = match sent.extension {
        None => !sent.has(Diagnosis::EXT_DIAG),
        Some(0) => !sent.has(Diagnosis::EXT_DIAG),
        Some(bits) => bits == 4 && sent.has(Diagnosis::EXT_DIAG),
    };
    let rules = [
        (sent.ident != IDENT, "the ident number is not 7531"),
        (never, "a bit is 1 that is always 0"),
        (!sent.has_mode(Diagnosis::ALWAYS), "bit 2 of octet 2 is 0"),
        (
            waits == with_master,
            "Prm_Req and the address of a master contradict each other",
        ),
        (
            waits && (ready || modes),
            "the slave waits for parameters, and is ready or has a mode on",
        ),
        (
            ready && faults,
            "the slave is ready, and has refused parameters or configuration",
        ),
        (
            !extension,
            "Ext_Diag and the extension contradict each other",
        ),
        (
            sent.master.is_some_and(|master| master > 126),
            "the master has no address",
        ),
    ];
    let broken = rules.into_iter().find(|(broken, _)| *broken);
    broken.map(|(_, rule)| rule.to_owned())
}

/// What is wrong with a status word beside an actual value (3.2.2, 3.3); `None` if a right inverter can show it.
pub(super) fn wrong_status(word: u16, actual: u16) -> Option<(&'static str, &'static str)> {
    const STATE: u16 = 0x4F;
    // Start-disable, ready to start, ready, enabled or quick stop, fault reaction and fault; and with bit 1 as it may be while a quick stop
    // or a fault reaction runs.
    const STATES: [u16; 8] = [0x40, 0x01, 0x03, 0x07, 0x0F, 0x08, 0x05, 0x0D];
    let (right, left) = (word & zsw::CLOCKWISE != 0, word & zsw::ANTICLOCKWISE != 0);
    let actual = actual.cast_signed();
    let rest = [0x40, 0x08].contains(&(word & STATE));
    let rules = [
        (
            word & 0x2000 != 0,
            "3.2.2",
            "bit 13 of the status word is 1",
        ),
        (
            !STATES.contains(&(word & STATE)),
            "3.3",
            "bits 6 and 3 to 0 of the status word show no state",
        ),
        (right && left, "3.2.2", "both directions are shown"),
        (
            actual > 0 && !right || actual < 0 && !left,
            "3.2.2",
            "the direction contradicts the actual value",
        ),
        (
            rest && actual != 0,
            "3.2.5",
            "the actual value is not 0 while the output is off",
        ),
    ];
    let broken = rules.into_iter().find(|(broken, ..)| *broken);
    broken.map(|(_, section, rule)| (section, rule))
}
