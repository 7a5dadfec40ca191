//! A ring that another process serves.

use harness::port::PortAddress;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// The process and where its rings are; it ends with this value.
pub(crate) struct Served {
    pub(crate) child: Child,
    pub(crate) endpoints: Vec<PortAddress>,
    pub(crate) sizes: Vec<u8>,
    _folder: tempfile::TempDir,
}

impl Served {
    /// Serves rings of these sizes over `tcp` or `pty`.
    pub(crate) fn start(
        model: &str,
        sizes: &[u8],
        transport: &str,
        marks: bool,
        more: &[&str],
    ) -> Self {
        Self::start_with(model, sizes, transport, marks, more, &[])
    }

    /// The same with more lines of the header.
    pub(crate) fn start_with(
        model: &str,
        sizes: &[u8],
        transport: &str,
        marks: bool,
        more: &[&str],
        lines: &[&str],
    ) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let names: Vec<_> = sizes.iter().map(u8::to_string).collect();
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.args(["sim", "--rig", &format!("sim:{}", names.join(","))]);
        command.args(["--marks", if marks { "in-band" } else { "none" }]);
        command.args(more);
        let setup = folder.path().join("setup.scn");
        let header: String = ["", "2:"]
            .iter()
            .zip(sizes)
            .map(|(ring, _)| match model {
                "plain" => format!("drive {ring}0..last model plain\n"),
                _ => format!("drive {ring}0..last input GPIN3 GPIN5 high\n"),
            })
            .collect();
        let header = header + &lines.join("\n") + "\n";
        std::fs::write(&setup, header).expect("room");
        command.arg("--setup").arg(&setup);
        let mut paths: Vec<PathBuf> = Vec::new();
        for ring in 0..sizes.len() {
            let path = folder.path().join(format!("ring{ring}"));
            match transport {
                "pty" => command.arg("--pty").arg(&path),
                _ => command.args(["--tcp", "127.0.0.1:0"]),
            };
            paths.push(path);
        }
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program");
        let mut lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
        let mut endpoints = Vec::new();
        for path in paths {
            let Some(Ok(line)) = lines.next() else {
                let mut said = String::new();
                let stderr = child.stderr.take();
                let _all = stderr.map(|mut pipe| pipe.read_to_string(&mut said));
                panic!("the server did not start: {said}");
            };
            let place = line.rsplit(" at ").next().expect("a place").to_owned();
            endpoints.push(match transport {
                "pty" => PortAddress::Pty(path),
                _ => PortAddress::Tcp(place),
            });
        }
        Self {
            child,
            endpoints,
            sizes: sizes.to_vec(),
            _folder: folder,
        }
    }

    /// What a rig's file says of one of them under `[ring.1]`.
    pub(crate) fn lines(&self, ring: usize) -> String {
        let (transport, port) = match &self.endpoints[ring] {
            PortAddress::Pty(path) => ("pty", path.display().to_string()),
            PortAddress::Tcp(address) => ("tcp", address.clone()),
            other => panic!("{other}"),
        };
        let drives = self.sizes[ring];
        format!(
            "drives = {drives}\ntransport = \"{transport}\"\nport = \"{port}\"\nmarks = \"in-band\"\ntime_tolerance = \"20ms\"\n"
        )
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _gone = self.child.kill();
        let _gone = self.child.wait();
    }
}

/// What comes of a run in real time, or of the next one, four at most: a computer that stands still in its middle shows no wrong drive,
/// but it shows no right one either.
pub(crate) fn in_the_end(code: i32, mut run: impl FnMut() -> Output) -> Output {
    let mut output = run();
    for _ in 1..4 {
        if output.status.code() == Some(code) {
            break;
        }
        output = run();
    }
    output
}
