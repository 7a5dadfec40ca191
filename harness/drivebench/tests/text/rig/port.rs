//! Rig files with a port of drives on CAN.

use super::*;
use harness::port::PortAddress;

/// A rig of a UNITEK drive, with more behind it.
fn port(more: &str) -> String {
    format!(
        "schema = 2\n[rig]\nid = \"lab\"\n[port.1]\nbus = \"unitek\"\ndrives = [{{ node = 1 }}]\n{more}\n"
    )
}

/// A port of a CAN bus: its adapter, its drives by number or identifiers, and what may be sent.
#[test]
fn a_port_of_drives_on_can() {
    let rig = good(
        &port(
            "socketcand = \"lab:29536\"\nchannel = \"can1\"\nrate = 250\n[limits]\nallow_motion = true\nmax_speed = \"10%\"\nallow_registers = [\"0x85\"]",
        )
        .replace("{ node = 1 }", "{ node = 3 }, { rx = 0x210, tx = 0x190 }"),
    );
    let port = rig.port().expect("a port");
    let drives: Vec<_> = (0..)
        .zip(&port.drives)
        .map(|(index, node)| rig.buses.drive(port.bus, index, *node))
        .collect();
    assert_eq!(drives, [(3, vec![0x203, 0x183]), (2, vec![0x210, 0x190])]);
    assert!(!rig.is_simulated() && rig.rings().count() == 0);
    let printed = toml::to_string(&rig.file).expect("a text");
    assert_eq!(good(&printed).file, rig.file);
    let simulated = find("sim:unitek:2", Path::new("nowhere")).expect("a rig");
    assert!(
        simulated.is_simulated() && simulated.port().is_some_and(|port| port.drives.len() == 2)
    );
    assert!(find("sim:unitek:0", Path::new("nowhere")).is_err());
}

/// A port of a line of octets: its adapter, its slaves by address, its limits with their units.
#[test]
fn a_port_of_slaves_on_a_line() {
    let text = port("tcp = \"lab:4200\"\nrate = 93.75\necho = true\nmarks = \"in-band\"\n[limits]\nallow_motor_data = true\nmax_frequency = \"35.5Hz\"\nmax_eeprom_writes = 20")
        .replace("unitek", "nordac")
        .replace("{ node = 1 }", "{ address = 8, ppo = 2 }, { address = 9 }");
    let rig = good(&text);
    let port = rig.port().expect("a port");
    let addresses: Vec<_> = (0..)
        .zip(&port.drives)
        .map(|(index, node)| rig.buses.drive(port.bus, index, *node).0)
        .collect();
    assert_eq!(addresses, [8, 9]);
    assert_eq!(port.rate.bits_per_second(), 93_750);
    let printed = toml::to_string(&rig.file).expect("a text");
    assert_eq!(good(&printed).file, rig.file);
    let simulated = find("sim:nordac:2", Path::new("nowhere")).expect("a rig");
    let drives = simulated.port().map(|port| port.drives.clone());
    let addresses: Vec<_> = drives.iter().flatten().map(|drive| drive.address).collect();
    assert!(simulated.is_simulated());
    assert_eq!(addresses, [Some(8), Some(9)]);
    assert!(find("sim:nordac:120", Path::new("nowhere")).is_err());
}

/// A line of octets by `transport` and `port`, as a ring has them.
#[test]
fn a_line_behind_rfc_2217() {
    let line = |more: &str| {
        let text = port(more).replace("unitek", "nordac");
        text.replace("{ node = 1 }", "{ address = 8 }")
    };
    let rig = good(&line("transport = \"rfc2217\"\nport = \"lab:4200\""));
    let place = rig.port().and_then(|port| port.line());
    assert_eq!(place, Some(PortAddress::Rfc2217("lab:4200".to_owned())));
    let printed = toml::to_string(&rig.file).expect("a text");
    assert_eq!(good(&printed).file, rig.file);
    for (more, words) in [
        ("transport = \"rfc2217\"", "needs `port`"),
        (
            "transport = \"rfc2217\"\ntcp = \"lab:4200\"",
            "`port` expected in place",
        ),
        (
            "transport = \"rfc2217\"\nport = \"lab\"",
            "is not an address",
        ),
        (
            "transport = \"rfc2217\"\nport = \"lab:4200\"\nmarks = \"in-band\"",
            "cannot carry",
        ),
        ("transport = \"sim\"", "in a table [sim]"),
        ("port = \"lab:4200\"", "needs `transport`"),
        (
            "tcp = \"lab:1\"\ntransport = \"tcp\"\nport = \"lab:2\"",
            "two adapters",
        ),
    ] {
        let mistakes = read(&line(more)).expect_err(more).join("\n");
        assert!(mistakes.contains(words), "{more}: {mistakes}");
    }
    let can = read(&port("transport = \"rfc2217\"\nport = \"lab:4200\"")).expect_err("no adapter");
    assert!(
        can.join("\n").contains("the bus unitek has no `port`"),
        "{can:?}"
    );
}

#[test]
fn mistakes_of_ports_are_shown_with_line_and_column() {
    let cases = [
        (
            "no drives at all",
            "schema = 2\n[rig]\nid = \"x\"\n".to_owned(),
        ),
        (
            "rings and a port",
            serial("[port.1]\nbus = \"unitek\"\ndrives = [{ node = 1 }]\nslcan = \"/dev/ttyACM0\""),
        ),
        (
            "a port of the first schema",
            port("slcan = \"/dev/ttyACM0\"").replace("schema = 2", "schema = 1"),
        ),
        (
            "a bus that is not there",
            port("").replace("unitek", "unitec"),
        ),
        ("a port without an adapter", port("")),
        (
            "a simulated port without its bus",
            port("[sim]\nsetup = []"),
        ),
        (
            "setup lines of a simulated port",
            port(
                "[sim]\nbus = \"unitek\"\nsetup = [\"drive 1 property map-reply nativ\", \"drve 1\"]",
            ),
        ),
        (
            "a setup line of another bus",
            port("[sim]\nbus = \"unitek\"\nsetup = [\"title T\", \"bus novobus\"]"),
        ),
        (
            "a setup line of another drive",
            port("[sim]\nbus = \"unitek\"\nsetup = [\"drive 2\"]"),
        ),
        (
            "two adapters",
            port("slcan = \"/dev/ttyACM0\"\nsocketcand = \"lab:29536\""),
        ),
        ("an adapter nowhere", port("slcan = \"ttyACM0\"")),
        ("an interface without a name", port("socketcan = \"\"")),
        (
            "an interface beside an adapter",
            port("slcan = \"/dev/ttyACM0\"\nsocketcan = \"can0\""),
        ),
        ("a server without a port", port("socketcand = \"lab\"")),
        (
            "a channel of an adapter with one",
            port("slcan = \"/dev/ttyACM0\"\nchannel = \"can0\""),
        ),
        (
            "a bit rate that no bus has",
            port("rate = 501\nslcan = \"/dev/ttyACM0\""),
        ),
        (
            "drives without identifiers",
            port("slcan = \"/dev/ttyACM0\"")
                .replace("{ node = 1 }", "{ node = 1, rx = 0x210 }, {}"),
        ),
        (
            "drives with the same identifiers",
            port("slcan = \"/dev/ttyACM0\"").replace(
                "{ node = 1 }",
                "{ node = 1 }, { node = 1 }, { rx = 0x201, tx = 0x201 }",
            ),
        ),
        (
            "what only rings have",
            port(
                "slcan = \"/dev/ttyACM0\"\n[limits]\nallow_reset = true\n[[interlock]]\ndrive = 0\ncell = \"nist\"\nmax = \"9rpm\"",
            ),
        ),
        (
            "interlocks on what no drive has",
            port("slcan = \"/dev/ttyACM0\"").replace(
                "[limits]",
                "",
            ) + "\n[[interlock]]\ndrive = 1\nregister = \"SPED_ACTUAL\"\nmax = \"20%\"\n\
                 [[interlock]]\ndrive = 2\nregister = \"SPEED_ACTUAL\"\nmax = \"20\"\n\
                 [[interlock]]\ndrive = 1\nregister = \"STATUS\"\nbit = \"Enable\"\nlevel = \"high\"\n\
                 [[interlock]]\ndrive = 1\nregister = \"T_MOTOR\"\nmin = \"9\"\nmax = \"8\"\n\
                 [[interlock]]\ndrive = 1\nparameter = \"1202\"\nmax = \"9s\"\n\
                 [[interlock]]\ndrive = 1\nregister = \"T_MOTOR\"\n",
        ),
        (
            "interlocks on what no inverter has",
            port("tcp = \"lab:4200\"")
                .replace("unitek", "nordac")
                .replace("{ node = 1 }", "{ address = 8 }")
                + "\n[[interlock]]\ndrive = 8\nparameter = \"Accel time\"\nmax = \"9s\"\n\
                   [[interlock]]\ndrive = 8\nparameter = \"1202\"\nmax = \"9\"\n\
                   [[interlock]]\ndrive = 8\nparameter = \"HIW\"\nmax = \"20Hz\"\n\
                   [[interlock]]\ndrive = 8\nparameter = \"ZSW\"\nmax = \"0F37\"\n\
                   [[interlock]]\ndrive = 8\nregister = \"STATUS\"\nmax = \"1\"\n\
                   [[interlock]]\ndrive = 8\n",
        ),
        (
            "what only ports have",
            serial("[limits]\nallow_bus_settings = true\nmax_speed = \"10%\""),
        ),
        (
            "limits that mean nothing",
            port(
                "slcan = \"/dev/ttyACM0\"\n[limits]\nallow_registers = [\"B0\", \"FUN_SPEZIA\"]\nbit_rate_way_back = \"\"\nstore_bus_settings = \"yes\"",
            ),
        ),
        (
            "ranges that no register has",
            port(
                "slcan = \"/dev/ttyACM0\"\n[limits]\nranges = [{ register = \"SPEED_K\" }, { register = \"0x2C\", max = 65536 }, { register = \"76\", min = 3, max = -3 }, { register = \"SPEED_ACTUAL\" }, { register = \"1C\", max = 1000 }]",
            ),
        ),
        (
            "what only other buses have",
            port(
                "serial = \"/dev/ttyUSB0\"\nslcan = \"/dev/ttyACM0\"\n[limits]\nmax_setpoint = \"50%\"",
            ),
        ),
        (
            "slaves without an address, and limits that no line of octets has",
            port("serial = \"ttyUSB0\"\nrate = 45.45\n[limits]\nmax_speed = \"10%\"\nmax_setpoint = \"50%\"\nmax_frequency = \"35Hz\"")
                .replace("unitek", "nordac")
                .replace("{ node = 1 }", "{ node = 1 }, { address = 2 }, { address = 8 }, { address = 8 }"),
        ),
        (
            "values without their unit",
            port("tcp = \"lab\"\n[limits]\nmax_setpoint = \"50\"\nmax_frequency = \"35rpm\"")
                .replace("unitek", "nordac")
                .replace("{ node = 1 }", "{ address = 8 }"),
        ),
        (
            "a drive beyond the last",
            port("slcan = \"/dev/ttyACM0\"").replace("{ node = 1 }", "{ node = 200 }"),
        ),
        (
            "steps among the lines of a setup",
            port("[sim]\nbus = \"unitek\"\nsetup = [\"drive 1 input run low\", \"write 1 SPEED_CMD = 10%\", \"wait 1ms\"]"),
        ),
        (
            "a highest speed above all",
            port("slcan = \"/dev/ttyACM0\"\n[limits]\nmax_speed = \"120%\""),
        ),
    ];
    kept("port-mistakes.txt", &mistakes(&cases));
}
