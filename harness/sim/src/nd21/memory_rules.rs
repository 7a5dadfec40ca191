//! Which writes from the bus reach a cell (ND21 14.2.1).

use crate::novobus::cells::Cells;
use harness_proto::nd21::cells::{CellAccess, cell_at};
use harness_proto::novobus::memory::RAM;

/// What a cell holds after the bus has written `data` to it; `None` where nothing can be written. Read-only
/// cells and bits stay as they are.
pub(super) fn written(address: u16, data: u8, cells: &Cells) -> Option<u8> {
    if !RAM.contains(&address) {
        return None;
    }
    let cell = cell_at(address).filter(|cell| cell.access != CellAccess::Read)?;
    Some(cells.byte(address) & cell.read_only_bits | data & !cell.read_only_bits)
}
