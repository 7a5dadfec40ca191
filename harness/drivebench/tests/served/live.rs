//! The live page of the program, as a browser and an attacker see it: real sockets, the real program.

use crate::serve::{Sim, connect};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// A page of the program: where it is, and its token.
pub(crate) struct Page {
    address: String,
    token: String,
}

impl Page {
    /// From the line `page at http://127.0.0.1:40123/#0123...`.
    pub(crate) fn of(line: &str) -> Self {
        let url = line.strip_prefix("page at http://").expect("a page");
        let (address, token) = url.split_once("/#").expect("a token");
        Self {
            address: address.to_owned(),
            token: token.to_owned(),
        }
    }

    fn request(&self, line: &str, origin: &str, body: &str) -> String {
        let (address, token, length) = (&self.address, &self.token, body.len());
        format!(
            "{line} HTTP/1.1\r\nHost: {address}\r\nOrigin: {origin}\r\nDrivebench-Token: {token}\r\n\
             Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n{body}"
        )
    }

    /// Posts an order; gives the status and the answer.
    fn post(&self, path: &str, body: &str) -> (String, String) {
        self.post_from(&format!("http://{}", self.address), path, body)
    }

    fn post_from(&self, origin: &str, path: &str, body: &str) -> (String, String) {
        let mut stream = connect(&self.address);
        let text = self.request(&format!("POST {path}"), origin, body);
        stream.write_all(text.as_bytes()).expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        let status = answer.split(' ').nth(1).unwrap_or_default().to_owned();
        let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        (status, body.to_owned())
    }

    /// Opens the stream of events, and reads up to the scene.
    fn events(&self) -> Events {
        self.opened().0
    }

    /// The same, with the scene.
    fn opened(&self) -> (Events, String) {
        let mut stream = connect(&self.address);
        let text = self.request("GET /events", &format!("http://{}", self.address), "");
        stream.write_all(text.as_bytes()).expect("sent");
        let mut events = Events(BufReader::new(stream));
        let scene = events.until("\"title\":");
        (events, scene)
    }
}

/// A stream of events.
struct Events(BufReader<TcpStream>);

impl Events {
    /// Reads lines up to one with these words.
    fn until(&mut self, words: &str) -> String {
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            let read = self.0.read_line(&mut line).expect("a line in time");
            assert!(read > 0, "the stream has ended before {words}");
        }
        line
    }
}

/// ND21 9.7: the fault of a page is one of the ring, and its master reads zeros and the address of the drive behind the link.
#[test]
fn a_fault_of_the_page_reaches_the_master_of_a_socket() {
    let mut sim = Sim::start(&[
        "--rig",
        "sim:3",
        "--tcp",
        "127.0.0.1:0",
        "--web",
        "127.0.0.1:0",
    ]);
    let mut master = connect(&sim.address());
    let page = Page::of(&sim.line());
    let mut events = page.events();
    events.until("\"stations\":[[\"0\",\"normal\"");
    let (status, said) = page.post("/play", r#"{"script":0}"#);
    assert_eq!(status, "409", "{said}");
    assert!(said.contains("a master is connected"), "{said}");
    // Link 1 is 2->1; fault 0 flips a bit.
    let (status, said) = page.post("/fault", r#"{"place":1,"fault":0}"#);
    assert_eq!(
        (status.as_str(), said.starts_with("! 2->1: flip 0.")),
        ("200", true),
        "{said}"
    );
    master.write_all(&[0x80; 40]).expect("sent");
    let mut came = [0; 40];
    master.read_exact(&mut came).expect("as many bytes");
    assert_eq!((came[0], came[39]), (0, 1), "{came:02X?}");
    let line = events.until("Address 01 has reached the master");
    assert!(line.contains("came over link 2->1"), "{line}");
    let (status, said) = page.post("/fault", r#"{"place":4,"fault":0}"#);
    assert_eq!(
        (status.as_str(), said.as_str()),
        ("409", "there is no such link\n")
    );
}

/// Without a place for a master, the page itself sends.
#[test]
fn a_page_alone_plays_conversations_of_every_bus() {
    for (arguments, script, shown) in [
        (&["--rig", "sim:3"][..], 1, "\"8A\""),
        (&["--rig", "sim:2,2"], 3, "\"4C\""),
        (&["--bus", "unitek"], 0, "read 30 SPEED_ACTUAL"),
        (&["--bus", "nordac"], 1, "Slave_Diag"),
    ] {
        let mut sim = Sim::start(&[arguments, &["--web", "127.0.0.1:0"]].concat());
        let page = Page::of(&sim.line());
        let mut events = page.events();
        events.until("\"stations\":[[");
        let (status, said) = page.post("/play", &format!("{{\"script\":{script}}}"));
        assert_eq!(status, "200", "{arguments:?}: {said}");
        events.until(shown);
        let (status, said) = page.post("/play", r#"{"script":99}"#);
        assert_eq!(status, "409", "{arguments:?}: {said}");
    }
}

/// A lost frame and a lost telegram: what the page injects is what it shows.
#[test]
fn faults_of_frames_and_telegrams() {
    for (bus, fault, script, shown) in [
        ("unitek", "! frame 1: lost", 0, "[lost]"),
        ("nordac", "! telegram 1: lost", 1, "1 telegram lost"),
    ] {
        let mut sim = Sim::start(&["--bus", bus, "--web", "127.0.0.1:0"]);
        let page = Page::of(&sim.line());
        let mut events = page.events();
        events.until("\"stations\":[[");
        let (status, said) = page.post("/fault", r#"{"place":0,"fault":0}"#);
        assert_eq!(status, "200", "{bus}: {said}");
        assert!(said.starts_with(fault), "{bus}: {said}");
        page.post("/play", &format!("{{\"script\":{script}}}"));
        events.until(shown);
    }
}

#[test]
fn other_web_sites_change_nothing() {
    let mut sim = Sim::start(&["--rig", "sim:3", "--control", "-", "--web", "127.0.0.1:0"]);
    let page = Page::of(&sim.line());
    let body = r#"{"place":1,"fault":0}"#;
    for origin in ["http://evil.com", "null", "http://localhost:1"] {
        let (status, said) = page.post_from(origin, "/fault", body);
        assert_eq!(status, "403", "{origin}: {said}");
    }
    let foreign = Page {
        token: "0".repeat(32),
        ..Page::of(&format!("page at http://{}/#x", page.address))
    };
    assert_eq!(foreign.post("/fault", body).0, "403");
    assert_eq!(page.post("/play", r#"{"script":0}"#).0, "200");
    let mut events = page.events();
    let line = events.until("\"stations\":[[");
    assert!(!line.contains("error"), "{line}");
}

/// The taps hear the same while a page is open.
#[test]
fn a_tap_hears_all_bytes_beside_a_page() {
    let mut sim = Sim::start(&[
        "--rig",
        "sim:3",
        "--tcp",
        "127.0.0.1:0",
        "--tap",
        "2->1=127.0.0.1:0",
        "--web",
        "127.0.0.1:0",
    ]);
    let mut master = connect(&sim.address());
    let mut tap = connect(&sim.address());
    let page = Page::of(&sim.line());
    let mut came = [0; 3];
    for round in 0..3_u8 {
        let events = (round == 1).then(|| page.events());
        master.write_all(&[0x80, 0x80, 0x80]).expect("sent");
        tap.read_exact(&mut came).expect("what the link carries");
        assert_eq!(came, [0x80; 3], "round {round}");
        master.read_exact(&mut came).expect("as many bytes");
        drop(events);
    }
}

#[test]
fn a_page_for_other_machines_needs_permission() {
    for command in [
        &["sim", "--rig", "sim:3", "--web", "0.0.0.0:0"][..],
        &["sim", "--bus", "unitek", "--web", "0.0.0.0:0"],
        &["top", "--web", "0.0.0.0:0"],
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
            .args(command)
            .stdin(Stdio::null())
            .output()
            .expect("the program");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{command:?}: {said}");
        assert!(said.contains("--allow-remote"), "{command:?}: {said}");
    }
}

/// `top --web` of a rig, in its own process.
fn top(rig: &str, folder: &Path) -> (Child, Page) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["top", "--rig", rig, "--web", "127.0.0.1:0"])
        .current_dir(folder)
        .env("DRIVEBENCH_STATE", folder.join("state"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program");
    let mut line = String::new();
    let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
    out.read_line(&mut line).expect("a line");
    (child, Page::of(line.trim_end()))
}

fn terminate(child: &Child) {
    let ended = Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status();
    assert!(ended.expect("kill").success());
}

/// `top --web` of simulated drives shows the table of `top`, the traffic and the picture, and takes no order; a signal ends it.
#[test]
fn the_page_of_a_bench_in_use_only_looks_on() {
    let file = "schema = 1\n[rig]\nid = \"live\"\n[ring.1]\ndrives = 2\ntransport = \"sim\"\n";
    let ring = [
        "\"stations\":[[\"0\",",
        "\"traffic\":[[\"ring 1\",",
        "[0,\"FE\",\"d\"]",
    ];
    for (rig, columns, shown) in [
        ("sim:2", r#"["master->1","1->0","0->master"]"#, ring),
        ("live.toml", r#"["master->1","1->0","0->master"]"#, ring),
        (
            "sim:unitek:2",
            r#"["bench","drive 1","drive 2"]"#,
            [
                "\"stations\":[[\"1\",",
                "\"traffic\":[[\"bench\",",
                "30 SPEED_ACTUAL = ",
            ],
        ),
        (
            "sim:nordac",
            r#"["bench","slave 8"]"#,
            [
                "\"stations\":[[\"8\",",
                "[\"slave 8\",\"",
                "1813 Frequency = ",
            ],
        ),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("live.toml"), file).expect("room");
        let (mut child, page) = top(rig, folder.path());
        let (mut events, scene) = page.opened();
        assert!(scene.contains(&format!("\"columns\":{columns}")), "{scene}");
        for words in shown {
            events.until(words);
        }
        let (status, said) = page.post("/fault", r#"{"place":0,"fault":0}"#);
        assert_eq!(status, "403", "{rig}");
        assert!(said.starts_with("This page only looks on"), "{said}");
        terminate(&child);
        let status = child.wait().expect("an end");
        assert_eq!(status.code(), Some(130), "{rig}");
    }
}

/// `top --web` on a port shows what the bench exchanges: a column for each link of a ring that it hears, or for each station.
#[test]
fn the_page_of_a_bench_in_use_shows_what_it_exchanges() {
    let ring =
        "schema = 1\n[rig]\nid = \"live\"\n[ring.1]\ndrives = 3\ntransport = \"tcp\"\nport = ";
    let line = |bus: &str, drives: &str, way: &str| {
        format!(
            "schema = 2\n[rig]\nid = \"live\"\n[port.1]\nbus = \"{bus}\"\nrate = 500\ndrives = [{{ {drives} }}]\n{way} = "
        )
    };
    for (served, rig, columns, shown) in [
        (
            &["--rig", "sim:3", "--tcp", "127.0.0.1:0"][..],
            ring.to_owned(),
            r#"["master->2","0->master"]"#,
            // A command to drive 0 and its answer (ND21 9.3, 10.1): FD leaves the master, and C1 comes back.
            [r#"[0,"FD","d"]"#, r#"[1,"C1","d"]"#],
        ),
        (
            &["--bus", "unitek", "--slcan", "127.0.0.1:0"],
            line("unitek", "node = 1", "slcan"),
            r#"["bench","drive 1"]"#,
            ["read 30 SPEED_ACTUAL", "30 SPEED_ACTUAL = "],
        ),
        (
            &["--bus", "nordac", "--tcp", "127.0.0.1:0"],
            line("nordac", "address = 8, ppo = 1", "tcp"),
            r#"["bench","slave 8"]"#,
            ["1813 Frequency  [", "1813 Frequency = "],
        ),
    ] {
        let mut sim = Sim::start(served);
        let folder = tempfile::tempdir().expect("a folder");
        let rig = format!("{rig}\"{}\"\n", sim.address());
        std::fs::write(folder.path().join("live.toml"), rig).expect("room");
        let (mut child, page) = top("live.toml", folder.path());
        let (mut events, scene) = page.opened();
        assert!(scene.contains(&format!("\"columns\":{columns}")), "{scene}");
        for words in shown {
            events.until(words);
        }
        terminate(&child);
        assert_eq!(child.wait().expect("an end").code(), Some(130));
    }
}
