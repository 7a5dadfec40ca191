"""Tests of the resource and the driver, with labgrid: a local environment, ssh, and a coordinator with an exporter at this computer."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from labgrid import Environment
from labgrid.binding import StateError

import drivebench

EXAMPLES = Path(__file__).parent.parent / "examples"
#: How long programs of labgrid may take to start, in seconds.
PATIENCE = 60


def driver(env: Environment) -> Any:
    return env.get_target("main").get_driver("DrivebenchDriver")


def ssh(folder: Path) -> Path:
    """A program that takes the place of ssh: it notes its host and runs the line here, as the shell of the host does."""
    program = folder / "ssh"
    program.write_text('#!/bin/sh\ntest "$*" = "${*#-T -o BatchMode=yes lab-1 }" && exit 255\nshift 4\necho "$*" >> "$0.log"\nexec sh -c "$*"\n')
    program.chmod(0o755)
    return program


def with_ssh(environment: Path, folder: Path) -> str:
    """An environment file of the examples that uses this `ssh`."""
    file = folder / environment.name
    file.write_text(environment.read_text() + f"tools:\n  ssh: {ssh(folder)}\n")
    return str(file)


def test_a_local_environment() -> None:
    env = Environment(str(EXAMPLES / "local.yaml"))
    own = driver(env)
    own.write(0, "nsoll", "200rpm")
    own.go(0)
    own.wait(1)
    speed = own.read(0, "nist")
    assert abs(speed - 200) < 5 and speed.unit == "rpm"
    own.stop()
    assert own.run("9.7-parity-error").passed
    rig = own.rig
    env.get_target("main").deactivate(own)
    assert rig.end["code"] == 0
    with pytest.raises(StateError):
        own.read(0, "nist")


def test_the_variable_names_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRIVEBENCH", "/nowhere/drivebench")
    with pytest.raises(drivebench.Error, match="failed to start /nowhere/drivebench"):
        driver(Environment(str(EXAMPLES / "local.yaml")))


def test_motion_is_off_by_default(tmp_path: Path) -> None:
    file = tmp_path / "env.yaml"
    file.write_text((EXAMPLES / "local.yaml").read_text().replace("allow_motion: true", "{}").replace("        {}", "        timeout: 20"))
    own = driver(Environment(str(file)))
    with pytest.raises(drivebench.Error) as caught:
        own.go(0)
    assert caught.value.exit_code == 2
    own.target.deactivate(own)


def test_a_rig_behind_ssh(tmp_path: Path) -> None:
    local = tmp_path / "local.yaml"
    local.write_text((EXAMPLES / "local.yaml").read_text().replace('rig: "sim:3"', 'rig: "sim:4"\n        host: lab-1'))
    folder = tmp_path / "tools"
    folder.mkdir()
    own = driver(Environment(with_ssh(local, folder)))
    assert len(own.rig.drives) == 4
    own.target.deactivate(own)
    assert (folder / "ssh.log").read_text() == "drivebench shell --json --rig sim:4 --move\n"


def free_port() -> int:
    with socket.socket() as own:
        own.bind(("127.0.0.1", 0))
        return int(own.getsockname()[1])


def program(name: str) -> str:
    return str(Path(sys.executable).parent / f"labgrid-{name}")


class Lab:
    """A coordinator and an exporter."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.address = f"127.0.0.1:{free_port()}"
        self.log = (folder / "lab.log").open("w")
        self.children = [self.start("coordinator", "--listen", self.address)]

    def start(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        # The coordinator keeps its places in the folder in which it was started.
        return subprocess.Popen([program(name), *words], cwd=self.folder, stdout=self.log, stderr=self.log, stdin=subprocess.DEVNULL)

    def client(self, *words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([program("client"), "--coordinator", self.address, *words], capture_output=True, text=True)

    def wait_for(self, words: str, *request: str) -> None:
        end = time.monotonic() + PATIENCE
        while True:
            answer = self.client(*request)
            if words in answer.stdout:
                return
            assert time.monotonic() < end, answer
            assert all(child.poll() is None for child in self.children), Path(self.log.name).read_text()

    def end(self) -> None:
        for child in reversed(self.children):
            child.kill()
        for child in self.children:
            child.wait(PATIENCE)
        self.log.close()


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    own = Lab(tmp_path)
    try:
        # The coordinator is there before the exporter, which does not ask twice.
        end = time.monotonic() + PATIENCE
        while own.client("places").returncode != 0:
            assert time.monotonic() < end
        own.children.append(own.start("exporter", "--coordinator", own.address, "--name", "exporter", str(EXAMPLES / "exporter.yaml")))
        own.wait_for("exporter/bench/DrivebenchRig", "resources")
        yield own
    finally:
        own.end()


def test_coordinator_and_exporter(lab: Lab, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for words in ["create"], ["add-match", "exporter/bench/DrivebenchRig"], ["acquire"]:
        answer = lab.client("--place", "desk", *words)
        assert answer.returncode == 0, answer
    monkeypatch.setenv("LG_COORDINATOR", lab.address)
    folder = tmp_path / "tools"
    folder.mkdir()
    own = driver(Environment(with_ssh(EXAMPLES / "place.yaml", folder)))
    assert own.rig.drives == ["0", "1", "2"]
    assert own.read(0, "nist").unit == "rpm"
    own.target.deactivate(own)
    assert "drivebench shell --json --rig sim:3 --move" in (folder / "ssh.log").read_text()
    assert lab.client("--place", "desk", "release").returncode == 0
