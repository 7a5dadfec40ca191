//! The list of parameters, typed from chapter 5 and section 4.1.3 of the manual; what the ledger of errata corrects is corrected (E1 to E7, E23 to E28).
//!
//! 4.1.3 prints no flags, limits and defaults: those of its eight numbers are ours. Where 5.6 and 5.4 print no range, the limits are those of the type
//! (ours), and where they print no default it is 0.

use super::parameter::{Limit, Parameter};
use super::units::Unit;
use Limit::{Clim1, Clim2, Fmax, Fmin, MinusFmax, Raw};

const S_0_05: Unit = Unit::of(5, 2, "s");
const HZ_0_1: Unit = Unit::of(1, 1, "Hz");
const NUMBER: Unit = Unit::of(1, 0, "");
const RPM_1: Unit = Unit::of(1, 0, "min-1");
const A_0_01: Unit = Unit::of(1, 2, "A");
const V_1: Unit = Unit::of(1, 0, "V");
const KW_0_01: Unit = Unit::of(1, 2, "kW");
const HUNDREDTHS: Unit = Unit::of(1, 2, "");
const OHM_0_01: Unit = Unit::of(1, 2, "Ohm");
const A_0_1: Unit = Unit::of(1, 1, "A");
const V_0_1: Unit = Unit::of(1, 1, "V");
const S_0_1: Unit = Unit::of(1, 1, "s");
const S_0_01: Unit = Unit::of(1, 2, "s");
const PERCENT_1: Unit = Unit::of(1, 0, "%");
const HZ_0_05: Unit = Unit::of(5, 2, "Hz");
const V_0_02: Unit = Unit::of(2, 2, "V");
const HZ_1: Unit = Unit::of(1, 0, "Hz");
const PERCENT_0_1: Unit = Unit::of(1, 1, "%");
const PERCENT_PER_MS_0_01: Unit = Unit::of(1, 2, "%/ms");
const PERCENT_MS_0_1: Unit = Unit::of(1, 1, "%ms");
const MS_1: Unit = Unit::of(1, 0, "ms");
const PERCENT_PER_S_1: Unit = Unit::of(1, 0, "%/s");
const PERCENT_PER_MS_0_1: Unit = Unit::of(1, 1, "%/ms");
const REV_0_001: Unit = Unit::of(1, 3, "rev");
const REV_2: Unit = Unit::of(2, 0, "rev");
const REV_0_01: Unit = Unit::of(1, 2, "rev");
const C_1: Unit = Unit::of(1, 0, "C");
const C_0_1: Unit = Unit::of(1, 1, "C");
const H_1: Unit = Unit::of(1, 0, "h");

/// A row: number, name, unit, lowest value, highest value, factory setting, flags, number of sub-indices, section.
#[expect(clippy::too_many_arguments, reason = "the columns of a table")]
const fn row(
    number: u16,
    name: &'static str,
    unit: Unit,
    least: Limit,
    most: Limit,
    default: i32,
    flags: &'static str,
    count: u8,
    section: &'static str,
) -> Parameter {
    Parameter {
        number,
        name,
        unit,
        least,
        most,
        default,
        flags,
        count,
        section,
    }
}

/// Units of the elements of arrays whose elements differ (NORDAC 5.7): the past faults, the frequency, the temperature.
pub(super) const ELEMENT_UNITS: [(&[u16], &[Unit]); 3] = [
    (
        &[1801, 1802, 1803, 1804, 1805],
        &[NUMBER, H_1, HZ_0_1, V_1, A_0_1, C_0_1, NUMBER],
    ),
    (&[1813], &[HZ_0_1, A_0_1, A_0_1]),
    (&[1825], &[C_1, NUMBER, V_1]),
];

/// Every parameter in order of its number. The GSD names no parameter; 5.6 needs the PosiCon option.
#[rustfmt::skip]
pub static PARAMETERS: [Parameter; 172] = [
    // 4.1.3
    row(918, "User address", NUMBER, Raw(1), Raw(126), 0, "R", 1, "4.1.3"),
    row(927, "PKW operating priority", NUMBER, Raw(0), Raw(1), 1, "R", 1, "4.1.3"),
    row(947, "Error number", NUMBER, Raw(0), Raw(25), 0, "R", 4, "4.1.3"),
    row(965, "Profile number", NUMBER, Raw(0), Raw(65535), 768, "R", 1, "4.1.3"),
    row(967, "Control word", NUMBER, Raw(0), Raw(65535), 0, "R", 1, "4.1.3"),
    row(968, "Status word", NUMBER, Raw(0), Raw(65535), 0, "R", 1, "4.1.3"),
    row(970, "Load data set", NUMBER, Raw(0), Raw(1), 1, "", 1, "4.1.3"),
    row(971, "Transfer to the non-volatile memory", NUMBER, Raw(0), Raw(1), 0, "", 1, "4.1.3"),
    // 5.1
    row(1202, "Accel. time", S_0_05, Raw(1), Raw(32000), 100, "PO", 1, "5.1"),
    row(1203, "Decel. time", S_0_05, Raw(1), Raw(32000), 100, "PO", 1, "5.1"),
    row(1204, "Minimum frequ.", HZ_0_1, Raw(0), Fmax, 0, "PO", 1, "5.1"),
    row(1205, "Maximum frequ.", HZ_0_1, Fmin, Raw(9990), 700, "PO", 1, "5.1"),
    row(1206, "Control mode", NUMBER, Raw(0), Raw(3), 3, "P", 1, "5.1"),
    row(1207, "Operating mode", NUMBER, Raw(0), Raw(1), 0, "", 1, "5.1"),
    // 5.2
    row(1300, "Standard motor", NUMBER, Raw(-1), Raw(46), 5, "P", 1, "5.2"),
    row(1301, "Nomin. frequency", HZ_0_1, Raw(0), Raw(9990), 500, "P", 1, "5.2"),
    row(1302, "Nominal speed", RPM_1, Raw(0), Raw(30000), 1425, "P", 1, "5.2"),
    row(1303, "Nominal current", A_0_01, Raw(0), Raw(825), 500, "P", 1, "5.2"),
    row(1304, "Nominal voltage", V_1, Raw(0), Raw(460), 400, "P", 1, "5.2"),
    row(1305, "Nominal power", KW_0_01, Raw(0), Raw(330), 220, "P", 1, "5.2"),
    row(1306, "Nomin. Cos(PHI)", HUNDREDTHS, Raw(50), Raw(100), 80, "P", 1, "5.2"),
    row(1307, "Motor connection", NUMBER, Raw(0), Raw(1), 0, "P", 1, "5.2"),
    row(1308, "Stator resistance", OHM_0_01, Raw(0), Raw(4000), 200, "P", 1, "5.2"),
    row(1309, "No-load current", A_0_01, Raw(0), Raw(750), 200, "P", 1, "5.2"),
    // 5.3
    row(1400, "Ramp response", NUMBER, Raw(0), Raw(1), 1, "PO", 1, "5.3"),
    row(1401, "Current limit 1", A_0_1, Raw(0), Clim2, 77, "PO", 1, "5.3"),
    row(1402, "Current limit 2", A_0_1, Clim1, Raw(82), 82, "PO", 1, "5.3"),
    row(1403, "Braking delay", NUMBER, Raw(0), Raw(1), 0, "PO", 1, "5.3"),
    row(1404, "Ramp down", NUMBER, Raw(0), Raw(1), 1, "PO", 1, "5.3"),
    row(1405, "Corner frequency", HZ_0_1, Raw(200), Raw(9990), 500, "PO", 1, "5.3"),
    row(1406, "Static boost", V_0_1, Raw(0), Raw(1000), 0, "PO", 1, "5.3"),
    row(1407, "Dynam. Boost", V_0_1, Raw(0), Raw(1200), 0, "PO", 1, "5.3"),
    row(1408, "Duration dyn. boost", S_0_1, Raw(1), Raw(200), 1, "PO", 1, "5.3"),
    row(1409, "DC brake", NUMBER, Raw(0), Raw(2), 0, "PO", 1, "5.3"),
    row(1410, "DC brake time", S_0_1, Raw(1), Raw(600), 10, "PO", 1, "5.3"),
    row(1411, "DC brake voltage", V_0_1, Raw(0), Raw(1200), 0, "PO", 1, "5.3"),
    row(1412, "Setpoint delay", S_0_01, Raw(0), Raw(1000), 0, "PO", 1, "5.3"),
    row(1413, "Ramp smoothing", PERCENT_1, Raw(0), Raw(100), 0, "PO", 1, "5.3"),
    row(1414, "Flying start feature", NUMBER, Raw(0), Raw(4), 0, "P", 1, "5.3"),
    row(1415, "Flying start offset", HZ_0_1, Raw(-100), Raw(100), 0, "P", 1, "5.3"),
    row(1416, "Flying start resol.", HZ_0_05, Raw(1), Raw(100), 20, "P", 1, "5.3"),
    row(1417, "Slip compensation", NUMBER, Raw(0), Raw(1), 1, "PO", 1, "5.3"),
    row(1418, "Aut. frequ. increase", NUMBER, Raw(0), Raw(1), 0, "PO", 1, "5.3"),
    row(1419, "P-factor frequ. incr.", NUMBER, Raw(0), Raw(32000), 1000, "PO", 1, "5.3"),
    row(1420, "Torque limit", PERCENT_1, Raw(24), Raw(400), 24, "PO", 1, "5.3"),
    // 5.4
    row(1500, "Mode an. input 1", NUMBER, Raw(0), Raw(5), 0, "PO", 1, "5.4"),
    row(1501, "Alignment1: 0%", V_0_02, Raw(-32768), Raw(32767), 0, "", 1, "5.4"),
    row(1502, "Alignment1: 100%", V_0_02, Raw(-32768), Raw(32767), 500, "", 1, "5.4"),
    row(1503, "Filter an. inp. 1", NUMBER, Raw(0), Raw(1), 0, "O", 1, "5.4"),
    row(1504, "Funct. an. inp. 2", NUMBER, Raw(0), Raw(7), 0, "P", 1, "5.4"),
    row(1505, "Mode an. inp. 2", NUMBER, Raw(0), Raw(5), 0, "", 1, "5.4"),
    row(1506, "Alignment2: 0%", V_0_02, Raw(-32768), Raw(32767), 0, "", 1, "5.4"),
    row(1507, "Alignment2: 100%", V_0_02, Raw(-32768), Raw(32767), 500, "", 1, "5.4"),
    row(1508, "Filter an. inp. 2", NUMBER, Raw(0), Raw(1), 0, "O", 1, "5.4"),
    row(1509, "Frequency 100%", HZ_1, Raw(0), Raw(999), 50, "PO", 1, "5.4"),
    row(1510, "PI controller P", PERCENT_0_1, Raw(0), Raw(8000), 1000, "PO", 1, "5.4"),
    row(1511, "PI controller I", PERCENT_PER_MS_0_01, Raw(0), Raw(10000), 1000, "PO", 1, "5.4"),
    row(1512, "PI controller D", PERCENT_MS_0_1, Raw(0), Raw(4000), 0, "PO", 1, "5.4"),
    row(1513, "PI controller T", MS_1, Raw(2), Raw(32000), 2, "PO", 1, "5.4"),
    row(1514, "Limit PI controller", HZ_0_1, Raw(20), Raw(9990), 100, "PO", 1, "5.4"),
    row(1515, "Current limit 100%", A_0_1, Raw(0), Raw(110), 82, "PO", 1, "5.4"),
    row(1516, "Torque 100%", PERCENT_1, Raw(25), Raw(400), 100, "PO", 1, "5.4"),
    row(1517, "Analogue output", NUMBER, Raw(0), Raw(10), 0, "O", 1, "5.4"),
    row(1518, "Norm. An. output", PERCENT_1, Raw(10), Raw(500), 100, "O", 1, "5.4"),
    row(1520, "Digital input 2", NUMBER, Raw(0), Raw(13), 2, "", 1, "5.4"),
    row(1521, "Digital input 3", NUMBER, Raw(0), Raw(13), 9, "", 1, "5.4"),
    row(1522, "Digital input 4", NUMBER, Raw(0), Raw(14), 5, "", 1, "5.4"),
    row(1523, "Digital input 5", NUMBER, Raw(0), Raw(15), 6, "", 1, "5.4"),
    row(1524, "Digital input 6", NUMBER, Raw(0), Raw(16), 4, "", 1, "5.4"),
    row(1525, "Enable active", NUMBER, Raw(0), Raw(1), 0, "", 1, "5.4"),
    row(1526, "Mot. temp. protect.", NUMBER, Raw(0), Raw(1), 0, "O", 1, "5.4"),
    row(1527, "Relay 1 fct. (binary)", NUMBER, Raw(0), Raw(4095), 2048, "PO", 1, "5.4"),
    row(1528, "Relay 1 logic", NUMBER, Raw(0), Raw(1), 0, "PO", 1, "5.4"),
    row(1529, "Relay 1 current", A_0_1, Raw(0), Raw(110), 55, "PO", 1, "5.4"),
    row(1530, "Relay 1 I-hyst.", PERCENT_1, Raw(0), Raw(20), 10, "PO", 1, "5.4"),
    row(1531, "Relay 1 frequ.", HZ_0_1, Raw(0), Fmax, 505, "PO", 1, "5.4"),
    row(1532, "Relay 1 contour.", RPM_1, Raw(0), Raw(500), 100, "PO", 1, "5.4"),
    row(1533, "Relay 1 slip", PERCENT_1, Raw(0), Raw(400), 300, "PO", 1, "5.4"),
    row(1534, "Relay 1 torque", PERCENT_1, Raw(0), Raw(400), 300, "PO", 1, "5.4"),
    row(1535, "Relay 2 fct.", NUMBER, Raw(0), Raw(4095), 4, "PO", 1, "5.4"),
    row(1536, "Relay 2 logic", NUMBER, Raw(0), Raw(1), 0, "PO", 1, "5.4"),
    row(1537, "Relay 2 current", A_0_1, Raw(0), Raw(110), 55, "PO", 1, "5.4"),
    row(1538, "Relay 2 I-hyst.", PERCENT_1, Raw(0), Raw(20), 10, "PO", 1, "5.4"),
    row(1539, "Relay 2 frequ.", HZ_0_1, Raw(0), Fmax, 505, "PO", 1, "5.4"),
    row(1540, "Relay 2 contour.", RPM_1, Raw(0), Raw(500), 100, "PO", 1, "5.4"),
    row(1541, "Relay 2 slip", PERCENT_1, Raw(0), Raw(400), 300, "PO", 1, "5.4"),
    row(1542, "Relay 2 torque", PERCENT_1, Raw(0), Raw(400), 300, "PO", 1, "5.4"),
    // 5.5
    row(1600, "Language", NUMBER, Raw(0), Raw(5), 0, "O", 1, "5.5"),
    row(1601, "Keyboard control", NUMBER, Raw(0), Raw(1), 0, "O", 1, "5.5"),
    row(1602, "Factory setting", NUMBER, Raw(0), Raw(1), 0, "", 1, "5.5"),
    row(1603, "Password", NUMBER, Raw(0), Raw(9999), 0, "", 1, "5.5"),
    row(1604, "Change password", NUMBER, Raw(0), Raw(9999), 0, "", 1, "5.5"),
    row(1605, "Fixed frequency 1", HZ_0_1, MinusFmax, Fmax, 100, "PO", 1, "5.5"),
    row(1606, "Fixed frequency 2", HZ_0_1, MinusFmax, Fmax, 200, "PO", 1, "5.5"),
    row(1607, "Fixed frequency 3", HZ_0_1, MinusFmax, Fmax, 400, "PO", 1, "5.5"),
    row(1608, "Loss reduction", NUMBER, Raw(0), Raw(1), 0, "PO", 1, "5.5"),
    row(1609, "Switching frequ.", NUMBER, Raw(0), Raw(3), 2, "PO", 1, "5.5"),
    row(1610, "Skip frequ. 1 high", HZ_0_1, Raw(0), Fmax, 0, "PO", 1, "5.5"),
    row(1611, "Skip frequ. 1 low", HZ_0_1, Raw(0), Fmax, 0, "PO", 1, "5.5"),
    row(1612, "Skip frequ. 2 high", HZ_0_1, Raw(0), Fmax, 0, "PO", 1, "5.5"),
    row(1613, "Skip frequ. 2 low", HZ_0_1, Raw(0), Fmax, 0, "PO", 1, "5.5"),
    row(1614, "Quick stop at fault", NUMBER, Raw(0), Raw(1), 0, "P", 1, "5.5"),
    row(1615, "Quick stop time", S_0_05, Raw(1), Raw(200), 2, "P", 1, "5.5"),
    row(1616, "Autom. acknowl.", NUMBER, Raw(0), Raw(10), 0, "", 1, "5.5"),
    row(1617, "Abs. min. frequency", HZ_0_1, Raw(1), Raw(100), 10, "O", 1, "5.5"),
    row(1618, "Mains voltage", V_1, Raw(303), Raw(506), 303, "", 1, "5.5"),
    row(1619, "Bus mode", NUMBER, Raw(0), Raw(2), 2, "", 1, "5.5"),
    row(1620, "USS-Modus", NUMBER, Raw(0), Raw(3), 0, "", 1, "5.5"),
    row(1621, "Interface", NUMBER, Raw(0), Raw(6), 0, "", 1, "5.5"),
    row(1622, "PPO type", NUMBER, Raw(0), Raw(3), 0, "", 1, "5.5"),
    row(1623, "Baud rate", NUMBER, Raw(0), Raw(3), 1, "", 1, "5.5"),
    row(1624, "Bus address", NUMBER, Raw(1), Raw(126), 126, "", 1, "5.5"),
    row(1625, "Bus timeout", S_0_1, Raw(0), Raw(1000), 0, "", 1, "5.5"),
    row(1626, "Rstat adaption", NUMBER, Raw(0), Raw(1), 0, "PO", 1, "5.5"),
    row(1627, "Servo mode", NUMBER, Raw(0), Raw(1), 0, "P", 1, "5.5"),
    row(1628, "Shaft encoder resol.", NUMBER, Raw(0), Raw(7), 6, "", 1, "5.5"),
    row(1629, "Speed controller P", PERCENT_1, Raw(0), Raw(800), 100, "PO", 1, "5.5"),
    row(1630, "Speed controller I", PERCENT_PER_S_1, Raw(0), Raw(800), 10, "PO", 1, "5.5"),
    row(1631, "Current controller P", PERCENT_1, Raw(0), Raw(800), 100, "PO", 1, "5.5"),
    row(1632, "Current controller I", PERCENT_PER_MS_0_1, Raw(0), Raw(10000), 3000, "PO", 1, "5.5"),
    row(1633, "Limit current contr.", V_1, Raw(0), Raw(400), 100, "PO", 1, "5.5"),
    row(1634, "Field weaken. contr. P", PERCENT_1, Raw(0), Raw(400), 50, "PO", 1, "5.5"),
    row(1635, "Field weaken. contr. I", PERCENT_PER_MS_0_1, Raw(0), Raw(1000), 100, "PO", 1, "5.5"),
    row(1636, "Field weakening limit", PERCENT_1, Raw(0), Raw(100), 100, "PO", 1, "5.5"),
    row(1641, "ISD control gain", PERCENT_1, Raw(25), Raw(400), 100, "PO", 1, "5.5"),
    // 5.6
    row(1700, "Current position", REV_0_001, Raw(-50000000), Raw(50000000), 0, "LAR", 1, "5.6"),
    row(1701, "Position control", NUMBER, Raw(0), Raw(1), 0, "P", 1, "5.6"),
    row(1702, "SSC mode", NUMBER, Raw(0), Raw(4), 0, "", 1, "5.6"),
    row(1703, "SCI mode", NUMBER, Raw(0), Raw(2), 0, "", 1, "5.6"),
    row(1704, "Setpoint mode", NUMBER, Raw(0), Raw(8), 0, "", 1, "5.6"),
    row(1705, "Bus 100% Pos.", REV_2, Raw(0), Raw(25000), 1, "P", 1, "5.6"),
    row(1706, "Pos. recognition", NUMBER, Raw(0), Raw(2), 0, "", 1, "5.6"),
    row(1707, "SSI resolution/rev", NUMBER, Raw(0), Raw(6), 6, "", 1, "5.6"),
    row(1708, "SSI max. revolu.", NUMBER, Raw(0), Raw(3), 3, "", 1, "5.6"),
    row(1709, "Offset abs. pos.", REV_0_001, Raw(-50000000), Raw(50000000), 0, "OL", 1, "5.6"),
    row(1710, "Curr. pos. check", NUMBER, Raw(0), Raw(1), 0, "", 1, "5.6"),
    row(1711, "SSC check", NUMBER, Raw(0), Raw(1), 0, "", 1, "5.6"),
    row(1712, "Reduction", NUMBER, Raw(-10000), Raw(10000), 1, "", 1, "5.6"),
    row(1713, "Multiplication", NUMBER, Raw(-10000), Raw(10000), 1, "O", 1, "5.6"),
    row(1714, "Ref. pt. mode", NUMBER, Raw(0), Raw(3), 0, "", 1, "5.6"),
    row(1715, "Frequ. ref. point", HZ_0_1, Raw(0), Raw(9990), 50, "PO", 1, "5.6"),
    row(1716, "Position", REV_0_001, Raw(-50000000), Raw(50000000), 0, "POLA", 64, "5.6"),
    row(1717, "Pos. increm.", REV_0_001, Raw(-50000000), Raw(50000000), 0, "POLA", 64, "5.6"),
    row(1718, "Pos. controller P", PERCENT_0_1, Raw(10), Raw(1000), 500, "PO", 1, "5.6"),
    row(1719, "Displacement calcul.", NUMBER, Raw(0), Raw(1), 1, "PO", 1, "5.6"),
    row(1720, "Large destin. window", REV_0_01, Raw(0), Raw(5000), 0, "PO", 1, "5.6"),
    row(1721, "Relay 3 functions", NUMBER, Raw(1), Raw(8), 8, "P", 1, "5.6"),
    row(1722, "Relay 3 pos.", REV_0_001, Raw(-50000000), Raw(50000000), 0, "PL", 1, "5.6"),
    row(1723, "Rel. 3 abs. pos.", REV_0_001, Raw(0), Raw(50000000), 0, "PL", 1, "5.6"),
    row(1724, "Relay 3 hyst.", REV_0_01, Raw(0), Raw(5000), 100, "P", 1, "5.6"),
    row(1725, "Relais 4 fct.s", NUMBER, Raw(1), Raw(16), 1, "P", 1, "5.6"),
    row(1726, "Relay 4 pos.", REV_0_001, Raw(-50000000), Raw(50000000), 0, "PL", 1, "5.6"),
    row(1727, "Rel. 4 abs. pos.", REV_0_001, Raw(0), Raw(50000000), 0, "PL", 1, "5.6"),
    row(1728, "Relay 4 hyst.", REV_0_01, Raw(0), Raw(5000), 100, "P", 1, "5.6"),
    row(1731, "Pos.softw. vers.", NUMBER, Raw(0), Raw(32000), 0, "", 2, "5.6"),
    row(1732, "Minimum pos.", REV_0_001, Raw(-50000000), Raw(50000000), 0, "L", 1, "5.6"),
    row(1733, "Maximum pos.", REV_0_001, Raw(-50000000), Raw(50000000), 0, "L", 1, "5.6"),
    row(1734, "Current setp. pos.", REV_0_001, Raw(-50000000), Raw(50000000), 0, "LR", 1, "5.6"),
    // 5.7
    row(1800, "New error", NUMBER, Raw(0), Raw(25), 0, "R", 1, "5.7"),
    row(1801, "Past fault 1", NUMBER, Raw(0), Raw(25), 0, "R", 7, "5.7"),
    row(1802, "Past fault 2", NUMBER, Raw(0), Raw(25), 0, "R", 7, "5.7"),
    row(1803, "Past fault 3", NUMBER, Raw(0), Raw(25), 0, "R", 7, "5.7"),
    row(1804, "Past fault 4", NUMBER, Raw(0), Raw(25), 0, "R", 7, "5.7"),
    row(1805, "Past fault 5", NUMBER, Raw(0), Raw(25), 0, "R", 7, "5.7"),
    row(1806, "Fault counters", NUMBER, Raw(0), Raw(1000), 0, "R", 25, "5.7"),
    row(1807, "Warning counters", NUMBER, Raw(0), Raw(1000), 0, "R", 5, "5.7"),
    row(1808, "Operating period", NUMBER, Raw(0), Raw(65000), 0, "R", 1, "5.7"),
    row(1810, "Event MFR1", NUMBER, Raw(0), Raw(1), 0, "R", 1, "5.7"),
    row(1811, "Event MFR2", NUMBER, Raw(0), Raw(1), 0, "R", 1, "5.7"),
    row(1812, "Software vers.", NUMBER, Raw(0), Raw(65000), 0, "R", 2, "5.7"),
    row(1813, "Frequency", HZ_0_1, Raw(0), Raw(9990), 0, "R", 3, "5.7"),
    row(1825, "Temp. heat sink", C_1, Raw(0), Raw(10000), 0, "R", 3, "5.7"),
];
