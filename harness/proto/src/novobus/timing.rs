//! How many bytes an exchange takes (ND21 8.2), from first principles.

use super::address::RingSize;

/// Bytes of a telegram with an address byte for one drive, above those with a short address.
const ADDRESS: u64 = 1;

/// Bytes that a cyclic exchange of nominal and actual values takes (ND21 8.2, first table): a sync byte
/// and two process data bytes a drive, and one address byte a round. A ring of one needs no address:
/// every telegram is for the same drive.
#[must_use]
pub fn exchange_bytes(ring: RingSize) -> u64 {
    round(ring, 3)
}

/// Bytes that new position targets take (ND21 8.2, second table): two telegrams a drive, each a sync
/// byte and a `WriteWord` of six (ps_positionH, ps_positionL), and one address byte a round.
#[must_use]
pub fn position_bytes(ring: RingSize) -> u64 {
    round(ring, 14)
}

fn round(ring: RingSize, bytes_per_drive: u64) -> u64 {
    let drives = u64::from(ring.drives());
    let address = if drives == 1 { 0 } else { ADDRESS };
    bytes_per_drive * drives + address
}
