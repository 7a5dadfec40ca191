"""A resource and a driver for labgrid: `imports: [drivebench.labgrid]` in an environment file makes them known."""

from __future__ import annotations

import shlex
from typing import Any

import attr
from labgrid.driver import Driver
from labgrid.factory import target_factory
from labgrid.resource import Resource
from labgrid.step import step

from . import TIMEOUT, Capture, Quantity, Rig, Run

__all__ = ["DrivebenchDriver", "DrivebenchRig"]


@target_factory.reg_resource
@attr.s(eq=False)
class DrivebenchRig(Resource):
    """A rig, at this computer or at `host`."""

    #: `sim:3`, a rig's file or its name, as `drivebench --rig` takes it.
    rig: str = attr.ib(default="sim:3", validator=attr.validators.instance_of(str))
    #: The computer at which the rig is; it is reached by ssh. Empty: this one.
    host: str = attr.ib(default="", validator=attr.validators.instance_of(str))
    #: The program there. Empty: `drivebench` at `host`; at this computer `$DRIVEBENCH`, or `drivebench`.
    program: str = attr.ib(default="", validator=attr.validators.instance_of(str))
    #: What an exporter adds; not used.
    extra: dict[str, Any] = attr.ib(factory=dict, repr=False)


@target_factory.reg_driver
@attr.s(eq=False)
class DrivebenchDriver(Driver):
    """Holds a rig while it is active. Its end takes the drives to their safe state."""

    bindings = {"resource": "DrivebenchRig"}
    #: Whether motors may turn, as far as the rig's file permits it.
    allow_motion: bool = attr.ib(default=False, validator=attr.validators.instance_of(bool))
    #: How long an answer is waited for, in seconds.
    timeout: float = attr.ib(default=TIMEOUT, converter=float)

    def __attrs_post_init__(self) -> None:
        super().__attrs_post_init__()
        self._rig: Rig | None = None

    def on_activate(self) -> None:
        own = self.resource
        program: str | list[str] | None = own.program or None
        name = own.rig
        if own.host:
            # ssh gives one line to the shell of its host.
            program = [self._ssh(), "-T", "-o", "BatchMode=yes", own.host, shlex.quote(own.program or "drivebench")]
            name = shlex.quote(name)
        self._rig = Rig(name, allow_motion=self.allow_motion, program=program, timeout=self.timeout)

    def on_deactivate(self) -> None:
        rig, self._rig = self._rig, None
        if rig is not None:
            rig.close()

    def _ssh(self) -> str:
        env = self.target.env
        return str(env.config.get_tool("ssh")) if env else "ssh"

    @property
    def rig(self) -> Rig:
        """The open rig, for all that has no method here."""
        return self._open()

    @Driver.check_active
    def _open(self) -> Rig:
        assert self._rig is not None
        return self._rig

    @Driver.check_active
    @step(args=["drive", "name"], result=True)
    def read(self, drive: int | str, name: str) -> Quantity | str | None:
        """Reads a cell, a register or a parameter."""
        return self._open().drive(drive)[name]

    @Driver.check_active
    @step(args=["drive", "name", "value"])
    def write(self, drive: int | str, name: str, value: str | Quantity) -> None:
        """Writes `"100rpm"`, and reads it back."""
        self._open().drive(drive)[name] = value

    @Driver.check_active
    @step(args=["drive"])
    def go(self, drive: int | str) -> None:
        """Releases a drive: its motor may turn."""
        self._open().drive(drive).go()

    @Driver.check_active
    @step()
    def stop(self) -> None:
        """Stops all drives."""
        self._open().stop()

    @Driver.check_active
    @step(args=["seconds"])
    def wait(self, seconds: float) -> None:
        """Lets time pass on the bus."""
        self._open().wait(seconds)

    @Driver.check_active
    @step(args=["scenario"], result=True)
    def run(self, scenario: str) -> Run:
        """Plays a scenario."""
        return self._open().run(scenario)

    @Driver.check_active
    @step(args=["path"])
    def capture(self, path: Any) -> Capture:
        """Captures what is exchanged from now on, into a file of the rig's computer."""
        return self._open().capture(path)
