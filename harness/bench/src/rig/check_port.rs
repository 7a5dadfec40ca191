//! The part of the check that is about `[port.1]`.

use super::check::{RigCheck, is_address};
use super::file::{Endpoint, SCHEMA, Transport};
use super::port_file::{CONFIRMATION, Port};
use crate::file::schema::PathStep;
use crate::file::values::MaxSpeed;

const PORT: [PathStep<'static>; 2] = [PathStep::Key("port"), PathStep::Key("1")];

impl RigCheck<'_> {
    /// Checks whether the file has rings or a port, and what it says of the port. Returns whether it has a port in place of rings.
    pub(crate) fn has_port(&mut self) -> bool {
        let (rings, ports) = (&self.file.ring, &self.file.port);
        let port = match (rings, ports) {
            (Some(_), None) => {
                self.of_rings();
                return false;
            }
            (None, Some(ports)) => &ports.first,
            (Some(_), Some(_)) => {
                let expected = "either [ring.1] or [port.1] expected";
                self.wrong(&["port".into()], "the file has rings and a port", expected);
                return true;
            }
            (None, None) => {
                let expected = "a table [ring.1], or [port.1] for drives on a shared line or a CAN bus, expected";
                self.wrong(&[], "the file has no drives", expected);
                return true;
            }
        };
        if self.file.schema < SCHEMA {
            let message = format!("schema {} has no `port`", self.file.schema);
            self.wrong(&["schema".into()], message, "2 expected here");
        }
        self.only_of_rings();
        self.of_other_buses(port);
        self.adapter(port);
        self.nodes(port);
        self.port_limits(port);
        self.port_interlocks(port);
        true
    }

    /// What only a port has is no part of a file with rings.
    fn of_rings(&mut self) {
        let limits = &self.file.limits;
        for key in limits.port.given() {
            let message = format!("`{key}` is for benches with [port.1]");
            self.wrong(
                &["limits".into(), key.into()],
                message,
                "nothing expected here",
            );
        }
        for (index, interlock) in self.file.interlock.iter().enumerate() {
            let given = [
                ("register", interlock.register.is_some()),
                ("parameter", interlock.parameter.is_some()),
                ("bit", interlock.bit.is_some()),
            ];
            for (key, _) in given.into_iter().filter(|(_, given)| *given) {
                let path = ["interlock".into(), index.into(), key.into()];
                let message = format!("`{key}` is for benches with [port.1]");
                self.wrong(&path, message, "`cell` or `input` expected in its place");
            }
        }
        if matches!(limits.max_speed, Some(MaxSpeed::Percent(_))) {
            let path = ["limits".into(), "max_speed".into()];
            let message = "drives of a ring have no speed of 100 %";
            self.wrong(&path, message, "a speed such as \"300rpm\" expected here");
        }
        if self.file.sim.as_ref().is_some_and(|sim| sim.bus.is_some()) {
            let message = "`bus` is for a simulated [port.1]";
            self.wrong(
                &["sim".into(), "bus".into()],
                message,
                "nothing expected here",
            );
        }
    }

    /// What only rings have is no part of a file with a port.
    fn only_of_rings(&mut self) {
        let file = self.file;
        let tables = [
            ("tap", !file.tap.is_empty()),
            ("interposer", !file.interposer.is_empty()),
            ("drive", !file.drive.is_empty()),
            ("deviation", !file.deviation.is_empty()),
        ];
        for (key, _) in tables.into_iter().filter(|(_, given)| *given) {
            let message = format!("[[{key}]] is for benches with rings");
            self.wrong(
                &[key.into()],
                message,
                "no such table expected in a file with [port.1]",
            );
        }
        let limits = &file.limits;
        let keys = [
            ("allow_reset", limits.allow_reset),
            ("allow_outputs", limits.allow_outputs),
            ("allow_monitoring", limits.allow_monitoring),
            (
                "max_bytes_per_second",
                limits.max_bytes_per_second.is_some(),
            ),
        ];
        for (key, _) in keys.into_iter().filter(|(_, given)| *given) {
            let message = format!("`{key}` is for benches with rings");
            self.wrong(
                &["limits".into(), key.into()],
                message,
                "nothing expected here",
            );
        }
    }

    /// What only other buses have is no part of a file for this one.
    fn of_other_buses(&mut self, port: &Port) {
        let row = self.buses.port(port.bus);
        let limits = &self.file.limits;
        let speed = limits.max_speed.map(|_| "max_speed");
        let given = limits.port.given().into_iter().chain(speed);
        let adapters = port.adapters().into_iter();
        let adapters = adapters.map(|key| (key, row.adapters));
        let more = port.more().into_iter().map(|key| (key, row.keys));
        let of_port = adapters.chain(more).map(|(key, known)| {
            let path = vec![PORT[0], PORT[1], PathStep::Key(key)];
            (path, key, known)
        });
        let of_limits = given.map(|key| {
            let path = vec![PathStep::Key("limits"), PathStep::Key(key)];
            (path, key, row.limits)
        });
        let all: Vec<_> = of_port.chain(of_limits).collect();
        for (path, key, known) in all {
            if !known.contains(&key) {
                let message = format!("the bus {} has no `{key}`", port.bus.name());
                let known: Vec<_> = known.iter().map(|key| format!("`{key}`")).collect();
                let expected = format!("one of {} expected here", known.join(", "));
                self.wrong(&path, message, expected);
            }
        }
    }

    /// One adapter, or simulated drives.
    fn adapter(&mut self, port: &Port) {
        let at = |key| [PORT[0], PORT[1], PathStep::Key(key)];
        let sim = self.file.sim.as_ref();
        let adapters = port.adapters();
        match (adapters.first(), adapters.get(1), sim) {
            (Some(_), Some(second), _) => self.wrong(
                &at(second),
                "two adapters are given",
                "one adapter expected",
            ),
            (None, None, None) if port.transport.is_some() => {}
            (None, None, None) => self.wrong(
                &PORT,
                "the port has no adapter",
                format!(
                    "`{}`, or a table [sim] with `bus` for simulated drives, expected",
                    self.buses.port(port.bus).adapters.join("`, `")
                ),
            ),
            (None, None, Some(sim)) if sim.bus != Some(port.bus) => {
                let expected = format!("`bus = \"{}\"` expected in [sim]", port.bus.name());
                self.wrong(&["sim".into()], "the simulated bus is missing", expected);
            }
            (None, None, Some(sim)) => self.lines(port, &sim.setup),
            (_, _, Some(_)) => self.wrong(
                &["sim".into()],
                "[sim] is only for simulated drives; this port has an adapter",
                "no [sim] expected here",
            ),
            (_, _, None) => {}
        }
        if let Some(place) = &port.slcan
            && !place.contains('/')
            && !is_address(place)
        {
            let message = format!("`{place}` is neither a device nor an address");
            let expected = "a device such as \"/dev/ttyACM0\", or host:port, expected here";
            self.wrong(&at("slcan"), message, expected);
        }
        let addresses = [
            ("socketcand", &port.socketcand, "127.0.0.1:29536"),
            ("tcp", &port.tcp, "127.0.0.1:4200"),
        ];
        for (key, place, example) in addresses {
            if let Some(place) = place.as_ref().filter(|place| !is_address(place)) {
                let message = format!("`{place}` is not an address");
                let expected = format!("host:port such as \"{example}\" expected here");
                self.wrong(&at(key), message, expected);
            }
        }
        if let Some(place) = port.serial.as_ref().filter(|place| !place.contains('/')) {
            let message = format!("`{place}` is not a device");
            let expected = "a device such as \"/dev/ttyUSB0\" expected here";
            self.wrong(&at("serial"), message, expected);
        }
        self.transport(port);
        let name = |name: &&String| {
            let fits = |c: char| c.is_ascii_alphanumeric() || ".-_".contains(c);
            name.is_empty() || name.len() > 15 || !name.chars().all(fits)
        };
        for (key, given) in [("channel", &port.channel), ("socketcan", &port.socketcan)] {
            if let Some(given) = given.as_ref().filter(name) {
                let message = format!("`{given}` is not the name of a bus");
                let expected =
                    "1 to 15 letters, digits, `.`, `_` or `-` expected here, such as \"can0\"";
                self.wrong(&at(key), message, expected);
            }
        }
        let named = port.channel.as_ref().is_some_and(|channel| !name(&channel));
        if named && port.socketcand.is_none() {
            let expected = "`channel` only beside `socketcand` expected";
            self.wrong(&at("channel"), "this adapter has one bus", expected);
        }
        if !(self.buses.port(port.bus).has_rate)(port.rate.bits_per_second()) {
            let message = format!("no bus runs at {} kbit/s", port.rate);
            self.wrong(&at("rate"), message, "such as 500 expected here");
        }
    }

    /// A line of octets by its transport, as a ring has it.
    fn transport(&mut self, port: &Port) {
        let at = |key| [PORT[0], PORT[1], PathStep::Key(key)];
        match (port.transport, &port.port) {
            (None, None) => {}
            (None, Some(_)) => self.wrong(
                &at("port"),
                "`port` needs `transport`",
                "`transport = \"rfc2217\"`, or another one, expected beside it",
            ),
            (Some(Transport::Sim), _) => self.wrong(
                &at("transport"),
                "simulated drives stand in a table [sim]",
                "\"serial\", \"pty\", \"tcp\" or \"rfc2217\" expected here",
            ),
            (Some(_), None) if !port.adapters().is_empty() => self.wrong(
                &at("transport"),
                "`transport` is for `port`",
                "`port` expected in place of the other adapter",
            ),
            (Some(transport), given) => self.endpoint(
                &PORT,
                &Endpoint {
                    transport,
                    port: given.clone(),
                    udev: Default::default(),
                    line: Default::default(),
                    marks: port.marks,
                    low_latency: true,
                },
            ),
        }
    }

    /// The lines of `setup` are about drives of the port.
    fn lines(&mut self, port: &Port, lines: &[String]) {
        let at = |index: usize| {
            [
                PathStep::Key("sim"),
                PathStep::Key("setup"),
                PathStep::Index(index),
            ]
        };
        let long = |line: &String| line.contains(['\n', '\r']);
        if let Some(index) = lines.iter().position(long) {
            let expected = "one line expected here";
            self.wrong(&at(index), "this is more than one line", expected);
            return;
        }
        for (index, problem) in self.buses.port(port.bus).line_mistakes(port, lines) {
            self.add(&at(index), &problem);
        }
    }

    /// Every drive has identifiers of its own.
    fn nodes(&mut self, port: &Port) {
        let row = self.buses.port(port.bus);
        let mut seen: Vec<(u16, usize)> = Vec::new();
        let mut numbers: Vec<u8> = Vec::new();
        for (index, node) in port.drives.iter().enumerate() {
            let path = [
                PORT[0],
                PORT[1],
                PathStep::Key("drives"),
                PathStep::Index(index),
            ];
            if let Err((message, expected)) = (row.named)(*node) {
                self.wrong(&path, message, expected);
                continue;
            }
            let (number, identifiers) = (row.drive)(index, *node);
            if numbers.contains(&number) {
                let message = format!("drive {number} is listed twice");
                self.wrong(&path, message, "another drive expected here");
            }
            numbers.push(number);
            for identifier in identifiers {
                if let Some((_, other)) = seen.iter().find(|(other, _)| *other == identifier) {
                    let message = format!(
                        "identifier {identifier:03X} is used twice, first by the drive in place {}",
                        other + 1
                    );
                    self.wrong(&path, message, "other identifiers expected here");
                } else {
                    seen.push((identifier, index));
                }
            }
        }
    }

    /// Interlocks are on registers of drives that the port lists.
    fn port_interlocks(&mut self, port: &Port) {
        let row = self.buses.port(port.bus);
        let file = self.file;
        let listed = port.drives.iter().enumerate();
        let listed: Vec<u8> = listed.map(|(at, node)| (row.drive)(at, *node).0).collect();
        for (index, interlock) in file.interlock.iter().enumerate() {
            let entry = [PathStep::Key("interlock"), PathStep::Index(index)];
            let at = |key| [entry[0], entry[1], PathStep::Key(key)];
            let (key, read) = row.interlock;
            let register = interlock.register.is_some();
            let parameter = interlock.parameter.is_some();
            let foreign = [
                ("ring", interlock.ring != 1),
                ("cell", interlock.cell.is_some()),
                ("input", interlock.input.is_some()),
                ("register", register && key != "register"),
                ("parameter", parameter && key != "parameter"),
            ];
            let foreign: Vec<_> = foreign.iter().filter(|(_, given)| *given).collect();
            for (other, _) in &foreign {
                let message = format!("an interlock of this bus has no `{other}`");
                self.wrong(
                    &at(other),
                    message,
                    format!("`{key}` expected in its place"),
                );
            }
            if !listed.contains(&interlock.drive) {
                let message = format!("the port has no drive {}", interlock.drive);
                self.wrong(&at("drive"), message, "a drive of `drives` expected here");
            }
            if port.listen_only {
                let message = "nothing is sent with `listen_only = true`, so this cannot be read";
                self.wrong(&entry, message, "no such table expected here");
            }
            let named = [("register", register), ("parameter", parameter)];
            let named = named.contains(&(key, true));
            if !named && foreign.is_empty() {
                let message = "it is not clear what must hold";
                self.wrong(&entry, message, format!("`{key}` expected in here"));
            } else if named && let Err((key, message, expected)) = read(interlock) {
                self.wrong(&at(key), message, expected);
            }
        }
    }

    fn port_limits(&mut self, port: &Port) {
        let row = self.buses.port(port.bus);
        let limits = &self.file.limits.port;
        let at = |key| [PathStep::Key("limits"), PathStep::Key(key)];
        if limits.max_setpoint.is_some() && limits.max_frequency.is_some() {
            let expected = "`max_setpoint` or `max_frequency` expected";
            self.wrong(
                &at("max_frequency"),
                "two limits of the speed are given",
                expected,
            );
        }
        for mistake in (row.register_mistakes)(limits) {
            let path = [at(mistake.key).as_slice(), &[mistake.index.into()]].concat();
            self.wrong(&path, mistake.message, mistake.expected);
        }
        if limits
            .bit_rate_way_back
            .as_ref()
            .is_some_and(|way| way.trim().is_empty())
        {
            let expected = "a sentence that says how the drive is reached again expected here";
            self.wrong(&at("bit_rate_way_back"), "this says nothing", expected);
        }
        if limits
            .store_bus_settings
            .as_ref()
            .is_some_and(|text| text != CONFIRMATION)
        {
            let expected = format!("\"{CONFIRMATION}\" expected here");
            self.wrong(
                &at("store_bus_settings"),
                "this is no confirmation",
                expected,
            );
        }
    }
}
