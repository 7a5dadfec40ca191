//! The register table: 256 rows, typed from the dump of all registers (2017-07-04, firmware 472).

use super::register::{Access, Register, Unit, Width};

/// One row a register: number, access, sign and width, value in the dump, unit, origin in the manual, name, label and meaning.
macro_rules! registers {
    ($($number:literal $access:ident $kind:ident $dump:literal $unit:ident $origin:literal $name:literal $label:literal $meaning:literal;)+) => {
        /// Every register in order of its number.
        ///
        /// Number, access, width and value are the dump's. The sign is that of the dump's decimal column where the top bit is set, and
        /// elsewhere follows from the meaning (our choice). Names and labels are the dump's; it cuts names to 13 letters. Blanks that the
        /// page breaks of the dump put into words are removed. The meaning is empty where the dump repeats the number or prints `??`.
        ///
        /// The dump calls 33 (an error) and B0 (the boot loader) RW (E37).
        pub static REGISTERS: [Register; 256] = [$(Register {
            number: $number,
            name: $name,
            label: $label,
            meaning: $meaning,
            access: Access::$access,
            width: registers!(@width $kind),
            signed: registers!(@signed $kind),
            dump: $dump,
            unit: Unit::$unit,
            origin: $origin,
        },)+];
    };
    (@width u16) => { Width::Bits16 };
    (@width s16) => { Width::Bits16 };
    (@width u32) => { Width::Bits32 };
    (@width s32) => { Width::Bits32 };
    (@signed u16) => { false };
    (@signed u32) => { false };
    (@signed s16) => { true };
    (@signed s32) => { true };
}

/// Other spellings of the chapters and the appendix, with the register that they mean (E34).
pub const ALIASES: [(&str, u8); 21] = [
    ("SPEED_SOLL", 0x31),
    ("SPEED_COMMAND", 0x31),
    ("SPEED_IST", 0x30),
    ("POS_SOLL", 0x6E),
    ("TORQUE-CMD", 0x90),
    ("TORQUE_COMMAND", 0x90),
    ("KERN_STATUS", 0x40),
    ("FUNC_REF_START", 0x78),
    ("CURRENT_ACTUAL", 0x20),
    ("CURRENT_DEVICE", 0xC6),
    ("CURRENT_200PC", 0xD9),
    ("SPEED_RPMMAX_INT", 0xCE),
    ("LOGICMAP_ERRORS", 0x8F),
    ("LOGICMAP_IO", 0xD8),
    ("CAN-ID-RX", 0x68),
    ("REGID_READ", 0x3D),
    ("ACC-RAMP", 0x35),
    ("DEC-RAMP", 0xED),
    ("BTB", 0xE2),
    ("NBT", 0x73),
    ("T-OUT", 0xD0),
];

#[rustfmt::skip]
registers! {
    0x00 UK u16 0x0000 Raw        "dump" "rsv" "(rsv)" "(reserved)";
    0x01 UK u16 0x0000 Raw        "dump" "USER_SPEC_OPT" "Usr-Opt" "(Deif) Options";
    0x02 RO u16 0x0000 Raw        "dump" "USER_SPEC_STA" "SC-info" "(Deif) Safety-State";
    0x03 SP u16 0x0000 Raw        "dump" "USER_SPEC_DEM" "Cmd-Spec" "(Deif) Cmd-Specials";
    0x04 SP u16 0x0000 Raw        "dump" "USER_KEY" "(Key)" "User Key";
    0x05 RW u16 0x05DC Raw        "dump" "MOTOR_NOM_F" "F nom" "Nominal motor frequency (FU)";
    0x06 RW u16 0x0000 Raw        "dump" "MOTOR_NOM_V" "V nom" "Motor nominal voltage (FU)";
    0x07 RW u32 0x00000000 Raw        "dump" "UF_TDC" "T dc" "Time DC-pre-mag. (FU)";
    0x08 RW u32 0x00000000 Raw        "dump" "UF_UDC" "V dc" "DC voltages (FU)";
    0x09 RW u32 0x00000064 Raw        "dump" "UF_SPEZIAL" "F dc" "F dc";
    0x0A RW u32 0x00000000 Raw        "dump" "UF_UMIN" "U min" "Minimum voltage (FU)";
    0x0B RW u32 0x00000000 Raw        "dump" "UF_FMIN" "F min" "Minimum frequency (FU)";
    0x0C RW u32 0x00000000 Raw        "dump" "UF_UECK" "V corner" "Voltage für max. frequency (FU)";
    0x0D RW u32 0x00000000 Raw        "dump" "UF_FECK" "F corner" "Frequency for max. voltage (FU)";
    0x0E RW u16 0x0000 Raw        "dump" "UF_POWF" "Cos Phi" "Power factor (FU)";
    0x0F RW u16 0x0064 Raw        "dump" "UF_EXTRA" "(...)" "";
    0x10 SP u16 0x0000 Raw        "dump" "CAPTURE_CHAN" "Chan" "Oscilloscope trigger channel";
    0x11 RO u32 0xCB5E37B4 Raw        "dump" "CONTROL_STATU" "Ctrl" "Control-Status";
    0x12 SP u16 0x7AE8 Raw        "dump" "CAPTURE_TRIGL" "Trig. Level" "Oscilloscope trigger level";
    0x13 SP u16 0x0001 Raw        "dump" "CAPTURE_TRIGE" "Trig. Edge" "Oscilloscope trigger function";
    0x14 SP u16 0x9134 Raw        "dump" "CAPTURE_TRIGS" "Trig. Sce" "Oscilloscope trigger source";
    0x15 SP u16 0x0001 Raw        "dump" "CAPTURE_SOURC" "Source" "Oscilloscope source";
    0x16 SP u16 0x0001 Raw        "dump" "CAPTURE_SKIP" "Skip" "Oscilloscope skip";
    0x17 FN u16 0x0000 Raw        "dump" "CAPTURE_READ" "Read Cmd" "Oscilloscope read";
    0x18 FN u16 0xFACE Raw        "dump" "CAPTURE_RUN" "Run Cmd" "Oscilloscope Run";
    0x19 RW u16 0x0000 Raw        "dump" "PWM-FREQ" "PWM freq." "Frequency PWM-stage";
    0x1A SP u16 0x0000 Raw        "dump" "LOOKUP_TEMP" "Look-up" "lookup field (temperary)";
    0x1B RO u16 0x01D8 Raw        "dump" "FW-VERSION" "FW" "Firmware";
    0x1C RW u16 0x000A Raw        "dump" "I_KP" "Kp" "Proportional amplification current controller";
    0x1D RW u16 0x03E8 Raw        "dump" "I_KI" "Ti" "Integral action time current controller";
    0x1E RW u16 0x0000 Raw        "dump" "DIG_CUTOFF" "Cutoff (dig.)" "Cutoff-digital-cmd";
    0x1F RO u16 0x07F0 Raw        "dump" "I3_ISTOFFSET" "??" "Offset actual current 3";
    0x20 RO s16 0x0002 Current    "App 7" "I_IST" "I actual" "current actual value";
    0x21 SP s16 0x0000 Current    "dump" "I_SOLLOFFSET" "Id set (dig.)" "D-current setpoint";
    0x22 RO s16 0x0000 Current    "dump" "I_REF" "I cmd (ramp)" "current set point numeric";
    0x23 RO s16 0x0000 Current    "dump" "ID_REF" "Id ref" "D-Current reference";
    0x24 RO u16 0x013F Current    "dump" "I_MAXPLUS" "I max inuse" "I max inuse";
    0x25 RW u16 0x03E9 Raw        "dump" "I_DELTAMAXPLU" "Ramp" "Icmd ramp";
    0x26 RO s16 0x0000 Current    "dump" "I_SOLL" "I cmd" "command current";
    0x27 RO s16 0xFFFF Current    "dump" "IQ_ACTUAL" "Iq actual" "Q-current actual";
    0x28 RO s16 0xFFFD Current    "dump" "ID_ACTUAL" "Id actual" "D-current actual";
    0x29 RO s16 0x0000 Raw        "dump" "VQ" "Vq" "Q-Outputvoltage";
    0x2A RO s16 0x0000 Raw        "dump" "VD" "Vd" "D-Outputvoltage";
    0x2B RW u16 0x0050 Raw        "dump" "I_ERRSUMMAX" "TiM" "Max. integration sample count";
    0x2C RW u16 0x000A Raw        "dump" "SPEED_KP" "Kp" "Proportional gain speed";
    0x2D RW u16 0x0064 Raw        "dump" "SPEED_KI" "Ti" "Integration time speed";
    0x2E RW u16 0x0000 Raw        "dump" "SPEED_KD" "Td" "D_ speed";
    0x2F RW u32 0x10000000 Raw        "dump" "ANALOG_OFFSET" "Ain1 offset/scale" "Offset/scale Ain1";
    0x30 RO s16 0x0000 Speed      "App 7" "SPEED_ACTUAL" "N actual" "Speed actual value";
    0x31 RW s16 0x0000 Speed      "App 5" "SPEED_CMD" "N set (dig.)" "Digital Speed Set Point";
    0x32 RO s16 0x0000 Speed      "dump" "SPEED_REF" "N cmd (ramp)" "Command speed after ramp";
    0x33 RW s16 0x0000 Speed      "dump" "SPEED_ERR" "N error" "Speed error";
    0x34 RW s16 0x7FFF Speed      "6.1" "SPEED_LIMIT" "N-Lim" "Speed limit";
    0x35 RW u32 0x00010064 Ramp       "ex 6" "SPEED_DELTAMA" "Accel." "Speed/torque acceleration ramp times";
    0x36 RW u16 0x0000 Raw        "dump" "COMMAND_SOURC" "Command" "Selection command speed";
    0x37 RO u16 0x0002 Raw        "dump" "SPEED_COUNTMA" "Loop" "current to speed loop factor";
    0x38 RO s16 0x0000 Current    "dump" "IQ_ERR" "Iq error" "Current Iq error";
    0x39 RO s16 0x0000 Current    "dump" "ID_ERR" "Id error" "Current Id error";
    0x3A RW u16 0xFACE Raw        "dump" "0x3a (...)" "?? (...)" "";
    0x3B RW u16 0x0050 Raw        "dump" "SPEED_ERRSUMM" "TiM" "Max. integration sample count";
    0x3C RW u16 0x7FFF Raw        "dump" "I_RD_N" "I-red-N" "Current derating speed";
    0x3D FN u16 0x0618 Raw        "5.2" "READ" "Read" "Function";
    0x3E RW s16 0x8000 Speed      "dump" "SPEED_CLIP_NE" "N-Lim-" "Speed limit negative";
    0x3F RW s16 0x7FFF Speed      "dump" "SPEED_CLIP_PO" "N-Lim+" "Speed limit positive";
    0x40 RO u32 0x00000380 Status     "App 7" "STATUS" "Status map" "Status";
    0x41 RO u16 0x0000 Raw        "dump" "INCR_DELTA" "incr_delta" "incr_delta";
    0x42 RO s16 0x86B9 Raw        "dump" "MPOS_ACTUAL_M" "MotorPos mech" "Motor actual angular position mechanical";
    0x43 RO u16 0x6A13 Raw        "dump" "MPOS_ACTUAL_E" "MotorPos elec" "Motor actual angular position electrical";
    0x44 RW s16 0xFDB0 Raw        "dump" "MPOS_ISTOFFSE" "FB-Offset" "phase angle offset Feedback";
    0x45 RO u32 0x00000000 Raw        "dump" "IT_RG_MONITOR" "I2t & Regen. Energy" "monitor i2t & regen circuit";
    0x46 RW u16 0x7FFF Current    "dump" "I_LIMIT" "I lim dig" "Current limit with a digital switch";
    0x47 RW u16 0xFACE Raw        "dump" "..." "..." "";
    0x48 RO u16 0x013F Current    "dump" "I_LIM_INUSE" "I lim inuse" "actual current limit";
    0x49 RO u16 0x0000 Raw        "dump" "T_MOTOR" "T-motor" "motor temperature";
    0x4A RO u16 0x0000 Raw        "dump" "T_IGBT" "T-igbt" "power stage temperature";
    0x4B RO u16 0x0000 Raw        "dump" "T_AIR" "T-air" "air temperature";
    0x4C RW u16 0x0000 Raw        "dump" "I_RD_TE" "I-red-TE" "Current derate Temp.";
    0x4D RW u16 0x0035 Raw        "6.1" "MOTOR_I_MAX" "I max" "max. motor current";
    0x4E RW u16 0x0035 Raw        "6.1" "MOTOR_I_DAUER" "I nom" "Motor continuous current";
    0x4F RW u16 0x0006 Raw        "dump" "MOTOR_POLE" "M-Pole" "Motor pole count";
    0x50 RW u16 0x0000 Raw        "dump" "AIN1_CUTOFF" "Cutoff" "cutoff window Ain1";
    0x51 SP u16 0x0000 Mode       "ex 2" "MODE" "Mode" "Mode State";
    0x52 SP u32 0x0000F811 Status     "ex 10" "STATUS_MASK" "Status mask" "Status mask";
    0x53 RW u16 0x0000 Raw        "dump" "AIN2_CUTOFF" "Cutoff" "cutoff window Ain2";
    0x54 RO s16 0xFFFF Current    "dump" "I1_IST" "I1 actual" "Current actual value I1";
    0x55 RO s16 0x0004 Current    "dump" "I2_IST" "I2 actual" "Current actual value I2";
    0x56 RO s16 0x0002 Current    "dump" "I3_IST" "I3 actual" "Current actual value I3";
    0x57 RO s16 0x0000 Current    "dump" "I_LIM_INUSE_R" "I lim inuse rmp" "I lim inuse rmp";
    0x58 RW u16 0x0000 Raw        "dump" "I_RD-TD" "I-red-TD" "I-red-TD";
    0x59 RW u16 0x0BB8 Rpm        "dump" "MOTOR_RPMMAX" "N nom" "Rated motor speed";
    0x5A RW u32 0x00000808 Raw        "dump" "KERN_OPTIONS" "Device Options" "Device settings (options)";
    0x5B RW u16 0x0000 Raw        "dump" "SPEED_KS" "Kacc" "Acceleration amplification";
    0x5C RO u16 0x86B9 Raw        "dump" "ROTOR" "Rotor" "Rotor signals";
    0x5D RO s16 0x0000 Speed      "dump" "SPEED_CMD_INT" "N cmd (int)" "Command speed internal";
    0x5E RW u16 0x0002 Raw        "dump" "SPEED_FILTER_" "Filter" "Filter speed actual value";
    0x5F RO s16 0x0000 Current    "dump" "I_IST_FILT" "I act (filt)" "Filtered actual current";
    0x60 RW u16 0x0000 Raw        "dump" "AINx_FILT" "Filter" "Filter";
    0x61 RO u16 0x0000 Raw        "dump" "IT_MONITOR" "I t" "I t monitor";
    0x62 RW u32 0x075BCD15 Raw        "dump" "DEVICE_SERIAL" "S-Nr." "Device Serial number Servo";
    0x63 RO u16 0x0000 Raw        "dump" "POWER_BOARD_S" "fpga Status" "FPGA Status";
    0x64 RW u16 0x00E6 Raw        "dump" "DEVICE_MAINS" "Mains" "Mains supply voltage";
    0x65 RW u32 0x00500019 Raw        "dump" "DEVICE_EXT_RE" "Regen-P, Regen-R" "Regenerative Resistor power rating";
    0x66 RO u16 0xFACE Raw        "dump" "DC_BUS" "Vdc-Bat" "Battery voltage";
    0x67 RW u32 0x00011313 Raw        "dump" "DEVICE_AUTO_I" "Type" "Device type";
    0x68 RW u16 0x0201 Identifier "3.1" "CAN_ID_RX" "Rx ID" "CAN-Bus drive rx address";
    0x69 RW u16 0x0181 Identifier "3.1" "CAN_ID_TX" "Tx ID" "CAN-Bus drive tx address";
    0x6A RW u16 0x000F Raw        "dump" "POS_KP" "Kp" "position controller proportional amplification P-N";
    0x6B RW u16 0x01F5 Raw        "dump" "POS_KI" "Ti" "integral action time (Integral part) position controller P-N";
    0x6C RW u16 0x0000 Raw        "dump" "POS_KD" "Td" "advancing-time (Differezial-part) position controller P-N";
    0x6D RO s32 0x000086B9 Position   "App 6" "POS_ACTUAL" "Pos actual" "actuael position numeric";
    0x6E SP s32 0x00000000 Position   "App 6" "POS_DEST" "Pos dest" "position-destination";
    0x6F RO s32 0x00000000 Position   "dump" "RegName_0x6f" "Pos actual 2" "Pos actual 2";
    0x70 RO s32 0x00000000 Position   "dump" "POS_ERR" "Pos error" "position error";
    0x71 RW u16 0x0033 Raw        "dump" "POS_ERRSUMMAX" "TiM" "Max.integration sample count, position";
    0x72 RW s32 0x00000000 Position   "dump" "POS_REF_OFFSE" "Off. Ref." "reference zero offset";
    0x73 RW u16 0x4025 BitTiming  "3.1" "CAN_BTR" "NBT" "CAN-BUS transmission rate";
    0x74 RO s16 0x91BE Raw        "dump" "POS_ZEROCAPTU" "Zero-Capture" "Pos Zero Capture";
    0x75 RW u16 0x0000 Raw        "dump" "POS_REFRESOED" "Reso edge" "Reso pos. at Rsw";
    0x76 RW s16 0x0078 Raw        "dump" "SPEED_CALIB_F" "Speed 1" "Reference speed (fast)";
    0x77 RW s16 0x0078 Raw        "dump" "SPEED_CALIB_S" "Speed 2" "Reference speed (slow)";
    0x78 FN u16 0x444D Raw        "App 5" "FUN_REF_START" "Start park cycle" "Start park cycle";
    0x79 RW u16 0x0064 Position   "dump" "POS_WINDOW" "Tol-wind" "Tolerance window for position";
    0x7A SP u32 0xFD944F98 Position   "App 6" "POS_PRESET" "Preset" "Preset value";
    0x7B RO u32 0x00000000 Position   "dump" "POS_VAR_OFFSE" "Off. Var" "user zero offset";
    0x7C RW u32 0x00000000 Raw        "dump" "NDRIVE_SCALE" "ND-Scale" "Display-conversion factor-position";
    0x7D RW u32 0x00000000 Raw        "dump" "NDRIVE_OFFSET" "ND-Offset" "Verschiebefaktor Pos-Anzeige";
    0x7E RW u32 0x00000000 Raw        "dump" "ENCODER_2_SCA" "Factor-ext" "Scale 2nd encoder";
    0x7F RW u32 0x00000000 Raw        "dump" "OFFSET_SLACK" "??" "";
    0x80 RW u16 0x86B9 Raw        "dump" "POS_DIFF_SLAC" "??" "";
    0x81 UK u16 0xFACE Raw        "dump" "..." "..." "";
    0x82 RO u16 0xFACE Raw        "dump" "DEVICE_SERIAL" "" "Device serial number ext.";
    0x83 FN u16 0x444D Raw        "dump" "FUN_PARAREAD" "??" "";
    0x84 FN u16 0x444D Raw        "ex 7" "FUN_PARAWRITE" "??" "";
    0x85 FN u16 0x0000 Raw        "dump" "FUN_SPEZIAL" "Auto-Fn" "Auto-Functions";
    0x86 UK s16 0xFACE Raw        "dump" "READ_INFO" "??" "";
    0x87 RW u16 0xFACE Raw        "dump" "..." "..." "";
    0x88 RW u32 0x00000000 Identifier "dump" "CAN_ID_RX_2" "Rx ID 2" "CAN-Bus drive rx 2 address";
    0x89 RW u32 0x00000000 Identifier "dump" "CAN_ID_TX_2" "Tx ID 2" "CAN-Bus drive tx 2 address";
    0x8A RO s16 0x0000 Raw        "dump" "VOUT" "V out" "Output-voltage usage";
    0x8B RW u16 0x0000 Raw        "dump" "VRED" "V red" "Start point field reduction";
    0x8C RW u16 0x0000 Raw        "dump" "VKP" "V kp" "Proportional amplification field reduction";
    0x8D RW u16 0x0000 Raw        "dump" "VTI" "V-Ti" "Time constant integral part field reduction";
    0x8E FN u16 0x444D Raw        "dump" "FUN_ERRCANCEL" "??" "Clear error list";
    0x8F RO u32 0x00000020 Errors     "App 7" "ERR_BITMAP1" "Warning-Error map" "Warning-Error map";
    0x90 SP s16 0x0000 Torque     "App 5" "TORQUE_SETPOI" "M set (dig.)" "Digital Torque Set Point";
    0x91 RO u32 0x000086B9 Position   "dump" "POS_COMMAND" "Pos cmd" "Command position";
    0x92 RO u16 0x0000 Raw        "dump" "CAN_ERROR_BUS" "??" "CAN-BUS Bus-Off count";
    0x93 RO u16 0x0000 Raw        "dump" "CAN_ERRWRITET" "??" "CAN-BUS ??";
    0x94 RO u16 0x0000 Raw        "dump" "POWER_BOARD_E" "fpga 1st error" "FPGA 1st Error";
    0x95 RO u16 0x0000 Raw        "dump" "CAN_COUNTREAD" "??" "CAN-BUS ??";
    0x96 RO u16 0x0000 Raw        "dump" "CAN_COUNTWRIT" "??" "CAN-BUS ??";
    0x97 RO u16 0x0000 Raw        "dump" "CAN_COUNTREJ" "??" "CAN-BUS";
    0x98 RO s16 0xFACE Raw        "dump" "LOG_O_BLOCK" "O-Block" "O-Block";
    0x99 RO u16 0x02B5 Raw        "dump" "INFO_INTERRUP" "Info Intr" "Info - Interrupt time";
    0x9A RO s16 0x0000 Raw        "dump" "TEMP" "(dbg) temp" "(dbg) Temp";
    0x9B RO u16 0xFACE Raw        "dump" "LOG_I_BLOCK" "in Block" "I-Block";
    0x9C UK s16 0xFACE Raw        "dump" "T-PT-1" "Pt100-1" "Temp. Sensor Pt100-1";
    0x9D UK s16 0xFACE Raw        "dump" "T-PT-2" "Pt100-2" "Temp. Sensor Pt100-2";
    0x9E UK s16 0xFACE Raw        "dump" "T-PT-3" "Pt100-3" "Temp. Sensor Pt100-3";
    0x9F UK s16 0xFACE Raw        "dump" "T-PT-4" "Pt100-4" "Temp. Sensor Pt100-4";
    0xA0 RO s16 0x0000 Raw        "dump" "TORQUE_OUT" "M out" "Digital Torque Intern";
    0xA1 RO u16 0x0000 Raw        "dump" "BALLAST_COUNT" "Ballast counter" "Ballast counter";
    0xA2 RW u16 0x15E0 Raw        "dump" "I_RD_TM" "I-red-TM" "I-red-TM";
    0xA3 RW u16 0x1B58 Raw        "dump" "MOTOR_TEMP_ER" "M-Temp" "Motor-Temperatur Abschaltpunkt";
    0xA4 RW u16 0x3001 Raw        "dump" "MOTOR_OPTION" "Label 0xa4" "";
    0xA5 RW u32 0x00000064 Raw        "dump" "DEVICE_DCBUS_" "DC-Bus min, DC-Bus max" "DC-Bus min, DC-Bus max";
    0xA6 RW u16 0x0400 Raw        "dump" "MOTOR_GEBER_I" "FB-Incr (Mot)" "Increments per Rpm";
    0xA7 RW u16 0x0002 Raw        "dump" "MOTOR_GEBER_P" "FB-Pole" "Resolver pole";
    0xA8 RO s16 0x0000 Speed      "5.2" "SPEED_ACTUAL_" "N act (filt)" "Actual speed value (filtered)";
    0xA9 RO u16 0x07EF Raw        "dump" "I1_ADC" "I3 adc" "Current sensor M1";
    0xAA RO u16 0x07EE Raw        "dump" "I2_ADC" "I2 adc" "Current sensor M3";
    0xAB RO u16 0xFDE8 Raw        "dump" "LOGIC_HZ" "Logic freq." "Forerground frequency";
    0xAC RO u16 0x0618 Raw        "dump" "PWM1" "pwm1 (5/6)" "pulse widths modulation Ph1";
    0xAD RO u16 0x0618 Raw        "dump" "PWM2" "pwm2 (3/4)" "pulse widths modulation Ph2";
    0xAE RO u16 0x0618 Raw        "dump" "PWM3" "pwm3 (1/2)" "pulse widths modulation Ph3";
    0xAF RO u16 0x007D Raw        "dump" "TIMER_DELTA" "T-intr" "Intr. time";
    0xB0 RW u16 0x444D Raw        "dump" "FUN_SERIALBOO" "??" "";
    0xB1 RW u16 0x0000 Raw        "dump" "MOTOR_INDUCTA" "L sigma-q" "Stator Leakage inductance";
    0xB2 RW u16 0x0000 Raw        "dump" "ID_NOM" "Id nom" "nominal magnetising current";
    0xB3 RW u16 0x007B Raw        "dump" "MOTOR_MAGN_L" "L magnet." "Motor magnetising inductance";
    0xB4 RW u16 0x0000 Raw        "dump" "MOTOR_ROTOR_R" "R rotor" "rotor resistance";
    0xB5 RW u16 0x0000 Raw        "dump" "ID_MIN" "Id min" "minimum magnetising current";
    0xB6 RW u16 0x07D0 Raw        "dump" "MOTOR_TR" "TC rotor" "time constant rotor";
    0xB7 SP u16 0x9133 Raw        "dump" "TEMP1_PTR" "(dbg) ptr1" "(dbg) ptr1";
    0xB8 UK u16 0x0000 Raw        "dump" "TEMP1_PTR_IND" "(dbg) *ptr1" "(dbg) *ptr1";
    0xB9 SP u16 0x902B Raw        "dump" "TEMP2_PTR" "(dbg) ptr2" "(dbg) ptr2";
    0xBA UK u16 0x0002 Raw        "dump" "TEMP2_PTR_IND" "(dbg) *ptr2" "(dbg) *ptr2";
    0xBB RW u16 0x0000 Raw        "dump" "MOTOR_INDUCTA" "L sigma-d" "leakage inductance ph-ph";
    0xBC RW u16 0x007B Raw        "dump" "MOTOR_STATOR_" "R stator" "stator resistance ph-ph";
    0xBD RW u16 0x0000 Raw        "dump" "MOTOR_SPECS_I" "TC stator" "time constant stator";
    0xBE RW u16 0x8005 Raw        "dump" "LOGIC_DEFINE_" "Label 0xbe" "";
    0xBF RW u16 0x8004 Raw        "dump" "LOGIC_DEFINE_" "Label 0xbf" "";
    0xC0 RW u16 0x800C Raw        "dump" "LOGIC_DEFINE_" "Label 0xc0" "";
    0xC1 RW u16 0x800C Raw        "dump" "LOGIC_DEFINE_" "Label 0xc1" "";
    0xC2 RW u16 0x0000 Raw        "dump" "LOGIC_DEFINE_" "Label 0xc2" "";
    0xC3 RW u16 0x0000 Raw        "dump" "LOGIC_DEFINE_" "Label 0xc3" "";
    0xC4 RW u16 0x20A3 Raw        "dump" "DEVICE_I_MAX_" "I max pk" "Limit for peak current (Servo)";
    0xC5 RW u16 0x3A3D Raw        "dump" "DEVICE_I_CNT_" "I con eff" "Limit for continius current (Servo)";
    0xC6 RW u16 0x0032 DeciAmpere "App 7" "DEVICE_I" "I device" "Type current, protected";
    0xC7 RW u16 0x000A Millis     "dump" "SPEED_DELTAMA" "R-Lim" "Emergency stops time ramp, limit switch for 100 % speed command";
    0xC8 RW u16 0x0E10 Rpm        "dump" "SPEED_RPMMAX" "Nmax-100%" "Maximum rotation speed in turns per minute (Servo)";
    0xC9 RW u16 0x0000 Raw        "dump" "I_KP2" "xKp2" "proportional amplification position controller P-I";
    0xCA RW u16 0x0000 Raw        "dump" "POSI_KI" "Ti" "integral action time (Integral part) position controller P-I";
    0xCB RW u16 0x0000 Raw        "dump" "I_KF" "Kf" "Kf";
    0xCC RO s16 0xC953 Raw        "dump" "POSI_ERR" "0xcc" "";
    0xCD RW u16 0x0000 Raw        "dump" "POSI_ERRSUMMA" "TiM" "Limit integral storeroom peak v alue P-I";
    0xCE RO u16 0x0E10 Rpm        "App 7" "SPEED_RPMMAX_" "Label 0xce" "";
    0xCF RW u16 0x0000 Raw        "dump" "POSI_KY" "Label 0xcf" "";
    0xD0 SP u16 0x0000 Millis     "dump" "CAN_TIMEOUT" "T-Out" "CAN timeout";
    0xD1 RW s32 0x0000003E Raw        "App 6" "VAR1" "Var1" "Comparison variable-1";
    0xD2 RW s32 0x00002710 Raw        "App 6" "VAR2" "Var2" "Comparison variable-2";
    0xD3 RW s32 0x00000000 Raw        "App 6" "VAR3" "Var3" "Comparison variable-3";
    0xD4 RW s32 0x00000000 Raw        "App 6" "VAR4" "Var4" "Comparison variable-4";
    0xD5 RO s32 0xFFE0FFE0 Raw        "6.1" "AIN1" "Ain1" "Analog Ain1 in/scaled";
    0xD6 RO s32 0x00580058 Raw        "6.1" "AIN_2" "Ain2" "Analog Ain2 in/scaled";
    0xD7 RW u32 0x10000000 Raw        "dump" "AIN2_OFFSET" "Offset 2" "analog input 2 offset compensation";
    0xD8 RO u16 0x0020 Io         "App 7" "LOGIC_READ_BI" "Label 0xd8" "";
    0xD9 RO u16 0x0349 Raw        "App 7" "KERN_I_200PC" "Label 0xd9" "";
    0xDA RW u16 0x0000 Raw        "dump" "LOGIC_DEFINE_" "" "";
    0xDB RW u16 0x0000 Raw        "dump" "LOGIC_DEFINE_" "" "";
    0xDC RW u16 0x0030 Raw        "App 3" "DEFINE_DAC" "??" "";
    0xDD UK u16 0xFACE Raw        "dump" "..." "..." "";
    0xDE RO u16 0x0000 Flag       "dump" "O_DOUT3" "out Dout3" "Digital output 3";
    0xDF RO u16 0x0000 Flag       "dump" "O_DOUT4" "out Dout4" "Digital output 4";
    0xE0 RO u16 0x0000 Flag       "dump" "O_DOU1" "out Dout1" "Digital output 1";
    0xE1 RO u16 0x0000 Flag       "dump" "O_DOU2" "out Dout2" "Digital output 2";
    0xE2 RO u16 0x0000 Flag       "ex 11" "O_BTB" "out Rdy (BTB)" "Device ready";
    0xE3 RO u16 0x0000 Flag       "dump" "O_GO" "O Go" "Internal run";
    0xE4 RO u16 0x0000 Flag       "dump" "I_END1" "(in) Limit1" "Digital input END1";
    0xE5 RO u16 0x0000 Flag       "dump" "I_END2" "(in) Limit2" "Digital input END2";
    0xE6 RO u16 0x0000 Flag       "dump" "I_DIN1" "(in) Din1" "Digital input DIN1";
    0xE7 RO u16 0x0000 Flag       "dump" "I_DIN2" "(in) Din2" "Digital input DIN2";
    0xE8 RO u16 0x0000 Flag       "ex 11" "I_FRG" "(in) Run (Frg)" "Digital input RUN";
    0xE9 RO u16 0x0000 Flag       "dump" "I_FAULT" "I Fault" "internal error message of the power part";
    0xEA RO u16 0x0000 Flag       "dump" "I_BALLAST" "I Regen" "message regen circuit";
    0xEB RO u16 0x0001 Raw        "dump" "DC_BUS" "Vdc-Bus" "DC-Bus voltage";
    0xEC RO u16 0x0000 Flag       "dump" "I_LOS" "I LossOfSignal" "Resolver fault. Incorrect or missing cable";
    0xED RW u32 0x00010064 Ramp       "ex 11" "SPEED_DELTAMA" "Decel." "Speed/torque deceleration ramp times";
    0xEE RW u16 0x0226 Raw        "dump" "IIST_100PC" "I 100% (Stromsensor)" "Current sensor justage (protect ed)";
    0xEF RO u16 0x0001 Flag       "dump" "O_NOFAULT" "Label 0xef" "";
    0xF0 RW u16 0x0005 Raw        "dump" "TIME_IPEAK" "T-peak" "Timing for peak current";
    0xF1 RW u16 0x00FA Raw        "dump" "USER_T_BRAKE" "Brake delay" "Brake delay time";
    0xF2 RO u16 0x0001 Flag       "dump" "VO_BRAKE" "O Brake" "Brake on";
    0xF3 RO u16 0x0000 Flag       "dump" "VO_ICNS" "O Icns" "message continuous current";
    0xF4 RO u16 0x0000 Flag       "ex 12" "VO_TOLER" "O Toler" "message position in tolerance";
    0xF5 RO u16 0x0001 Flag       "dump" "VO_Less_ N0" "O Less N0" "message speed <1%";
    0xF6 RO u16 0x0000 Raw        "dump" "POWER" "Power" "Power";
    0xF7 RO u16 0x0000 Raw        "dump" "WORK" "Work" "Work";
    0xF8 RW u32 0x0000444D Raw        "dump" "ASCII_USER" "Axis" "Axis label";
    0xF9 FN u16 0x444D Raw        "dump" "ASCII_WR_EEP" "??" "";
    0xFA FN u16 0x444D Raw        "dump" "ASCII_RD_EEP" "??" "";
    0xFB RO s16 0xFFD4 Raw        "dump" "AIN1_CALC" "Ain1 calc" "Ain1 calc";
    0xFC RO s16 0x0054 Raw        "dump" "AIN2_CALC" "Ain2 calc" "Ain2 calc";
    0xFD UK u16 0xFACE Raw        "dump" "..." "..." "";
    0xFE UK u16 0xFACE Raw        "dump" "..." "..." "";
    0xFF UK s16 0xFACE Raw        "dump" "rsv" "rsv" "reserved";
}
