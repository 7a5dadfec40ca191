//! Tests of what is known of drives.

use super::*;
use harness_proto::nd21::bits::hw_version2;

const CELL: CellByte = (0, 1, 0xFF74);

/// ND21 10.3: And and Or decide the bits of their masks, and no others.
#[test]
fn masks_decide_their_bits_only() {
    let mut known = Knowledge::default();
    known.write(CELL, Write::Or(0x0F));
    assert_eq!(known.read(CELL, 0x0F, 0x5E), ByteRead::Wrong);
    assert_eq!(known.read(CELL, 0x0F, 0x5F), ByteRead::Learned);
    assert_eq!(known.read(CELL, 0x0F, 0x5F), ByteRead::Right);
    assert_eq!(known.read(CELL, 0x0F, 0x4F), ByteRead::Wrong);
    known.write(CELL, Write::And(0xF0));
    assert_eq!(known.read(CELL, 0x00, 0x50), ByteRead::Right);
    assert_eq!(known.read(CELL, 0x00, 0x51), ByteRead::Wrong);
    known.write(CELL, Write::Set(0x12));
    // What was learned before is replaced.
    assert_eq!(known.read(CELL, 0x12, 0x50), ByteRead::Wrong);
    assert_eq!(known.read(CELL, 0x12, 0x12), ByteRead::Right);
    known.reset(0, 1);
    assert_eq!(known.read(CELL, 0x00, 0x00), ByteRead::Right);
    assert_eq!(known.read(CELL, 0x00, 0x77), ByteRead::Learned);
}

/// ND21 10.4: `WriteIO` decides the outputs that the drive's configuration leaves to the bus, once the master has read it.
#[test]
fn outputs_hold_what_was_written_where_nothing_else_uses_them() {
    let outputs = (0, 1, OUTPUTS);
    let configured = |hardware: u8, hardware2: u8| {
        let mut known = Knowledge::default();
        known.read((0, 1, ram::HW_VERSION), 0x84, hardware);
        known.read((0, 1, ram::HW_VERSION2), 0x84, hardware2);
        let set = Command::WriteIo(harness_proto::novobus::output::OutputChange {
            output: Output::Gpo1,
            set: true,
        });
        for (address, write) in writes(&set) {
            known.write((0, 1, address), write);
        }
        known
    };
    let mut known = configured(0x80, 0xFF);
    // The other bits of the port are the drive's.
    assert_eq!(known.read(outputs, 0x80, 0x9F), ByteRead::Own);
    assert_eq!(known.read(outputs, 0x80, 0x00), ByteRead::Wrong);
    assert_eq!(known.read(outputs, 0x80, 0x20), ByteRead::Wrong);
    known.write(outputs, Write::Or(GPO2));
    assert_eq!(known.read(outputs, 0xA0, 0xA0), ByteRead::Own);
    assert_eq!(known.read(outputs, 0xA0, 0x80), ByteRead::Wrong);
    // GPO2 shows a message, GPO1 the analogue output, the cycle control or a completed positioning.
    for (hardware, hardware2) in [(0x80, 0xBF), (0x88, 0xFF), (0x84, 0xFF)] {
        assert_eq!(
            configured(hardware, hardware2).read(outputs, 0x80, 0x00),
            ByteRead::Own
        );
    }
    let mut shows = configured(0xC0, 0xFF);
    shows.write(outputs, Write::Or(GPO2));
    assert_eq!(shows.read(outputs, 0xA0, 0x80), ByteRead::Own);
    // Nothing is known of the configuration, or a reset may have activated another one.
    known.reset(0, 1);
    known.write(outputs, Write::Or(GPO1));
    assert_eq!(known.read(outputs, 0x80, 0x00), ByteRead::Own);
}

/// ND21 14.4.1: bit 6 of `Status` comes back only with another reset.
#[test]
fn no_drive_resets_itself() {
    let status = (0, 1, ram::STATUS);
    let mut known = Knowledge::default();
    // The drive's self-test is longer than the model's.
    assert_eq!(known.read(status, 0x00, 0x40), ByteRead::Own);
    assert_eq!(known.read(status, 0x00, 0x01), ByteRead::Own);
    assert_eq!(known.read(status, 0x00, 0x40), ByteRead::Wrong);
    known.reset(0, 1);
    assert_eq!(known.read(status, 0x00, 0x40), ByteRead::Own);
    // Its power may have been switched.
    assert_eq!(known.read(status, 0x00, 0x00), ByteRead::Own);
    known.converse(true);
    assert_eq!(known.read(status, 0x00, 0x40), ByteRead::Own);
    assert_eq!(known.read(status, 0x00, 0x00), ByteRead::Own);
    known.converse(false);
    assert_eq!(known.read(status, 0x00, 0x40), ByteRead::Own);
}

/// ND21 10.5: what was not saved in the EEPROM is lost with a reset. One value may be what the drive loads; three are not.
#[test]
fn a_cell_that_outlives_three_resets_was_not_reset() {
    let outlives_at = |place, values: [u8; 3], read: &dyn Fn(u8) -> u8, save: bool| {
        let mut known = Knowledge::default();
        known.begin();
        let readings = values.map(|value| {
            known.write(place, Write::Set(value));
            if save {
                known.write((0, 1, ram::EEPROM_CONTROL), Write::Set(0x84));
            }
            known.reset(0, 1);
            known.read(place, 0, read(value))
        });
        readings[2]
    };
    let outlives = |values, read: &dyn Fn(u8) -> u8, save| outlives_at(CELL, values, read, save);
    // The recording of the oscilloscope: "every data".
    for recorded in [0xFDA0, 0xFE40, 0xFE97] {
        let place = (0, 1, recorded);
        assert_eq!(
            outlives_at(place, [1, 2, 3], &|byte| byte, false),
            ByteRead::Wrong
        );
        assert_eq!(
            outlives_at(place, [1, 2, 3], &|_| 2, false),
            ByteRead::Learned
        );
    }
    assert_eq!(outlives([1, 2, 3], &|byte| byte, false), ByteRead::Wrong);
    assert_eq!(outlives([1, 2, 3], &|_| 2, false), ByteRead::Learned);
    assert_eq!(outlives([2, 2, 2], &|byte| byte, false), ByteRead::Learned);
    assert_eq!(outlives([1, 2, 3], &|byte| byte, true), ByteRead::Learned);
}

/// ND21 14.10.3: where process data go is known from a write by any command, and from a read.
#[test]
fn process_data_are_followed() {
    let data_in = (0, 1, ram::DATA_IN);
    let written = |known: &Knowledge| known.written_now(CELL, 0);
    let mut known = Knowledge::default();
    known.write(data_in, Write::Set(0xF4));
    known.write(data_in, Write::And(0x7F));
    known.take_process_data(0, 1, [1, 2]);
    assert_eq!(known.read(CELL, 1, 1), ByteRead::Right);
    assert_eq!(written(&known), 0xFF);
    known.reset(0, 1);
    assert_eq!(known.read(data_in, 0, 0x74), ByteRead::Learned);
    known.take_process_data(0, 1, [3, 4]);
    assert_eq!(known.read(CELL, 3, 2), ByteRead::Wrong);
    // The model's own DataIn points elsewhere.
    assert_eq!(known.read(CELL, 0, 3), ByteRead::Right);
    // Where nothing is known of `DataIn`, any cell of the page may have been written.
    known.reset(0, 1);
    known.write(CELL, Write::Set(9));
    known.take_process_data(0, 1, [5, 6]);
    assert_eq!(written(&known), 0);
    assert_eq!(known.read(CELL, 9, 5), ByteRead::Learned);
}

/// ND21 13.3, 14.4: what the master wrote to cells of the drive's own program stays until that program is started.
#[test]
fn own_cells_hold_what_was_written_until_their_part_starts() {
    let position = (0, 1, ram::PS_POSITION_H);
    let mut known = Knowledge::default();
    known.write(position, Write::Set(0x12));
    assert_eq!(known.read(position, 0x12, 0x13), ByteRead::Wrong);
    known.write((0, 1, ram::PS_STATUS), Write::Set(0x40));
    assert_eq!(known.read(position, 0x12, 0x13), ByteRead::Own);
    let flags = (0, 1, ram::FLAGS2);
    known.write(flags, Write::Or(flags2::MONITORING));
    assert_eq!(known.read(flags, 0x04, 0x00), ByteRead::Wrong);
    assert_eq!(known.read(flags, 0x04, 0xFF), ByteRead::Own);
    // A drive in error may block itself, and does not stop itself.
    let status = (0, 1, ram::STATUS);
    known.write(status, Write::Set(0x80));
    assert_eq!(known.read(status, 0x80, 0x81), ByteRead::Wrong);
    assert_eq!(known.read(status, 0x80, 0xA1), ByteRead::Own);
    known.write(status, Write::Set(0x01));
    assert_eq!(known.read(status, 0x01, 0x80), ByteRead::Wrong);
    assert_eq!(known.read(status, 0x01, 0xA1), ByteRead::Wrong);
    assert_eq!(known.read(status, 0x01, 0x20), ByteRead::Own);
    assert_eq!(known.read(status, 0x01, 0x05), ByteRead::Own);
}

/// ND21 14.10.5.2, 14.10.5.3: bit 4 or bit 5 of `EEPROMcontrol` reports the end of an order, and not only after seconds.
#[test]
fn an_order_to_the_eeprom_comes_to_an_end() {
    let control = (0, 1, ram::EEPROM_CONTROL);
    let ordered = || {
        let mut known = Knowledge::default();
        known.converse(false);
        known.write(control, Write::Set(READ_BYTE));
        known
    };
    let after = |known: &mut Knowledge, ms: u64, wanted, value| {
        known.proceed_to(Instant::START + Span::from_millis(ms));
        known.read(control, wanted, value)
    };
    let mut known = ordered();
    assert_eq!(after(&mut known, 3_999, READ, 0x81), ByteRead::Own);
    assert_eq!(after(&mut known, 4_001, READ, 0x81), ByteRead::Wrong);
    // A model that takes as long itself, as a profile may say.
    assert_eq!(after(&mut known, 4_002, 0x81, 0x81), ByteRead::Own);
    // It has come to an end before.
    assert_eq!(after(&mut known, 4_003, READ, READ), ByteRead::Own);
    assert_eq!(after(&mut known, 4_004, READ, 0x00), ByteRead::Own);
    // The master has confirmed the end, and the supply of a drive may have failed.
    let mut known = ordered();
    known.write(control, Write::Set(0x10));
    assert_eq!(after(&mut known, 5_000, READ, 0x00), ByteRead::Own);
    let mut known = ordered();
    known.converse(true);
    known.write(control, Write::Set(READ_BYTE));
    assert_eq!(after(&mut known, 5_000, READ, 0x00), ByteRead::Own);
}

/// ND21 14.10.1: a confirmed error is deleted, and neither the AF nor the code of a bus error stays.
#[test]
fn a_confirmed_error_is_deleted() {
    let code = (0, 1, ram::ERRORCODE);
    let after = |ms: u64, wanted, value| {
        let mut known = Knowledge::default();
        known.converse(false);
        known.write(code, Write::Set(CONFIRM_ERROR));
        known.proceed_to(Instant::START + Span::from_millis(ms));
        known.read(code, wanted, value)
    };
    assert_eq!(after(499, 0, CONFIRM_ERROR), ByteRead::Own);
    assert_eq!(after(501, 0, CONFIRM_ERROR), ByteRead::Wrong);
    assert_eq!(after(501, 0, OF_THE_BUS), ByteRead::Wrong);
    // The drive has an error of its own, or another one of the bus came.
    assert_eq!(after(501, 0, 0x02), ByteRead::Own);
    assert_eq!(after(501, OF_THE_BUS, OF_THE_BUS), ByteRead::Own);
}

/// ND21 9.7: a 00 is what the cell holds once the checking byte after it was right.
#[test]
fn a_zero_is_learned_with_its_checking_byte() {
    let mut known = Knowledge::default();
    assert_eq!(known.read(CELL, 0x00, 0x00), ByteRead::Right);
    assert_eq!(known.read(CELL, 0x00, 0x05), ByteRead::Learned);
    let mut known = Knowledge::default();
    assert_eq!(known.read(CELL, 0x00, 0x00), ByteRead::Right);
    known.confirm_zero(CELL);
    assert_eq!(known.read(CELL, 0x00, 0x00), ByteRead::Right);
    assert_eq!(known.read(CELL, 0x00, 0x05), ByteRead::Wrong);
    // A write in between is what counts.
    let mut known = Knowledge::default();
    assert_eq!(known.read(CELL, 0x00, 0x00), ByteRead::Right);
    known.write(CELL, Write::Or(0x01));
    known.confirm_zero(CELL);
    assert_eq!(known.read(CELL, 0x01, 0x05), ByteRead::Learned);
}

/// ND21 10.4, 14.3.3, 14.3.4: `WriteIO` of one output leaves the other.
#[test]
fn an_output_of_the_bus_keeps_its_level() {
    let mut known = Knowledge::default();
    for cell in [ram::HW_VERSION, ram::HW_VERSION2] {
        assert_eq!(known.read((0, 1, cell), 0x00, 0x00), ByteRead::Right);
        known.confirm_zero((0, 1, cell));
    }
    let outputs = (0, 1, OUTPUTS);
    known.write(outputs, Write::Or(0x20));
    known.write(outputs, Write::And(0x7F));
    assert_eq!(known.read(outputs, 0x20, 0x20), ByteRead::Own);
    // Also where the model, whose output shows something else, agrees.
    assert_eq!(known.read(outputs, 0x20, 0x00), ByteRead::Wrong);
    assert_eq!(known.read(outputs, 0x00, 0x00), ByteRead::Wrong);
}

/// ND21 10.5: a model that ignores resets does not explain a drive that has lost its data.
#[test]
fn a_model_that_ignores_resets_is_refuted() {
    let readings = |values: [u8; 2]| {
        let mut known = Knowledge::default();
        known.begin();
        values.map(|value| {
            known.write(CELL, Write::Set(value));
            known.reset(0, 1);
            known.read(CELL, value, 9)
        })
    };
    assert_eq!(readings([1, 2]), [ByteRead::Learned, ByteRead::Wrong]);
    // One value may be what the model loads.
    assert_eq!(readings([1, 1]), [ByteRead::Learned, ByteRead::Learned]);
}

/// ND21 10.4, 10.5: the levels of outputs that only `WriteIO` sets are lost with a reset. One of them may be what the drive sets then.
#[test]
fn outputs_that_outlive_three_resets_were_not_reset() {
    let outputs = (0, 1, OUTPUTS);
    let last = |hardware2: u8, after: &dyn Fn(u8) -> u8| {
        let mut known = Knowledge::default();
        known.begin();
        let mut last = ByteRead::Own;
        for level in [0x00, GPO1, GPO2] {
            let configure = |known: &mut Knowledge| {
                for (cell, value) in [(ram::HW_VERSION, 0x00), (ram::HW_VERSION2, hardware2)] {
                    known.read((0, 1, cell), value, value);
                    known.confirm_zero((0, 1, cell));
                }
            };
            configure(&mut known);
            known.write(outputs, Write::And(!(GPO1 | GPO2)));
            known.write(outputs, Write::Or(level));
            known.reset(0, 1);
            configure(&mut known);
            // The other bits are the drive's.
            last = known.read(outputs, 0x00, after(level) | 0x01);
        }
        last
    };
    let both = hw_version2::NO_ANALOGUE_OUTPUT;
    assert_eq!(last(both, &|level| level), ByteRead::Wrong);
    assert_eq!(last(both, &|_| GPO2), ByteRead::Own);
    // The analogue output has GPO1 (14.7.4).
    assert_eq!(last(0x00, &|level| level), ByteRead::Own);
}
