"""Serial servo drives, physical or simulated: a client of `drivebench shell --json`."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import threading
from collections import deque
from collections.abc import Sequence
from types import TracebackType
from typing import Any

__all__ = ["Capture", "Drive", "Error", "Quantity", "Rig", "Run"]

#: How long an answer is waited for by default, in seconds.
TIMEOUT = 30.0
#: How many lines of the conversation are kept.
KEPT_LINES = 200


class Error(Exception):
    """A request was not done. `exit_code` is the exit code that the command would have."""

    def __init__(self, what: str, exit_code: int) -> None:
        super().__init__(what)
        self.exit_code = exit_code


class Quantity(float):
    """A number with its unit, such as `rpm`; empty if it has none."""

    unit: str

    def __new__(cls, value: float, unit: str = "") -> Quantity:
        own = super().__new__(cls, value)
        own.unit = unit
        return own

    def __repr__(self) -> str:
        return f"{float(self)!r} {self.unit}".rstrip()


class Run:
    """What came of scenarios."""

    def __init__(self, result: dict[str, Any]) -> None:
        self.verdict: str = result["verdict"]
        self.exit_code: int = result["code"]
        self.counts: dict[str, int] = result["counts"]
        self.scenarios: list[dict[str, Any]] = result["scenarios"]

    @property
    def passed(self) -> bool:
        """Whether every scenario passed."""
        return self.exit_code == 0 and self.verdict == "passed"

    def __repr__(self) -> str:
        found = [s["finding"] for s in self.scenarios if s["finding"]]
        return f"<Run {self.verdict} {self.counts} {found}>"


class Capture:
    """What a rig exchanges until the block, the session or `end` ends it: a file in pcapng."""

    def __init__(self, rig: Rig, path: str | os.PathLike[str]) -> None:
        self._rig = rig
        #: The file. It is written at the end.
        self.path = os.path.abspath(path)
        #: How many packets were written; a packet is a byte of a ring, a telegram or a frame.
        self.packets: int | None = None
        #: How many bytes, telegrams or frames a full record has not kept.
        self.lost: int | None = None
        rig.request("capture", path=self.path)

    def end(self) -> Capture:
        """Writes the file."""
        result = self._rig.request("capture-end")
        self.packets, self.lost = result["packets"], result["lost"]
        return self

    def __enter__(self) -> Capture:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            if self.packets is None:
                self.end()
        except Error:
            if kind is None:
                raise


class Drive:
    """A drive of a rig. Its cells, registers or parameters are read and written by their names."""

    def __init__(self, rig: Rig, number: int | str) -> None:
        self._rig = rig
        self.number = number

    def __getitem__(self, name: str) -> Quantity | str | None:
        """A number with its unit, hexadecimal digits, or None for a value without a meaning."""
        values = self._rig.request("read", drive=self.number, cells=[name])["values"]
        if len(values) != 1:
            raise Error(f"{name}: one value expected, {len(values)} read", 2)
        value, unit = values[0]["value"], values[0]["unit"]
        return Quantity(value, unit) if isinstance(value, (int, float)) else value

    def __setitem__(self, name: str, value: str | Quantity) -> None:
        """Writes `"100rpm"`, or a number with its unit, and reads it back."""
        text = f"{float(value):f}{value.unit}" if isinstance(value, Quantity) else str(value)
        self._rig.request("write", drive=self.number, values=[f"{name}={text}"])

    def go(self) -> None:
        """Releases the drive: its motor may turn."""
        self._rig.request("go", drive=self.number)

    def stop(self) -> None:
        """Stops the drive."""
        self._rig.request("stop", drive=self.number)

    def block(self) -> None:
        """Blocks the drive: no torque."""
        self._rig.request("block", drive=self.number)

    def state(self) -> dict[str, Any]:
        """Mode, error and state, as `drivebench info --format json` has them."""
        data = self._rig.request("state", drive=self.number)["data"]
        return dict(data["drives"][0])


class Rig:
    """A rig in use. It is locked for others until the block ends, which takes the drives to their safe state."""

    def __init__(
        self,
        name: str = "sim:3",
        *,
        allow_motion: bool = False,
        program: str | Sequence[str] | None = None,
        timeout: float = TIMEOUT,
    ) -> None:
        """Opens `sim:3`, a rig's file or its name. An answer is waited for up to `timeout` seconds. `program` is `drivebench` by default, or `$DRIVEBENCH`; words in front of it, such as
        `["ssh", "lab", "drivebench"]`, start it elsewhere."""
        self.name = name
        self.timeout = timeout
        self.log: deque[str] = deque(maxlen=KEPT_LINES)
        self.events: deque[dict[str, Any]] = deque(maxlen=KEPT_LINES)
        self._number = 0
        self._lines: queue.Queue[dict[str, Any] | None] = queue.Queue()
        program = program or os.environ.get("DRIVEBENCH", "drivebench")
        words = [program] if isinstance(program, str) else list(program)
        words += ["shell", "--json", "--rig", name]
        if allow_motion:
            words.append("--move")
        try:
            self._process = subprocess.Popen(
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, encoding="utf-8"
            )
        except OSError as error:
            raise Error(f"failed to start {words[0]}: {error}; install drivebench, or name the program in DRIVEBENCH", 2) from None
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.end: dict[str, Any] | None = None
        ready = self._event("ready")
        self.bus: str = ready["bus"]
        self.drives: list[str] = ready["drives"]
        self.simulated: bool = ready["simulated"]

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for text in lines:
                self.log.append("< " + text.rstrip())
                try:
                    line = json.loads(text)
                except ValueError:
                    line = {"event": "end", "code": 3, "what": f"no JSON: {text.rstrip()}"}
                self._lines.put(line)
        self._lines.put(None)

    def _next(self, awaited: str, more: float = 0) -> dict[str, Any]:
        timeout = self.timeout + more
        try:
            line = self._lines.get(timeout=timeout)
        except queue.Empty:
            self._process.terminate()
            raise Error(f"{self.name}: no {awaited} after {timeout:g} s", 3) from None
        if line is None:
            raise Error(f"{self.name}: the session ended without {awaited}", 3)
        if line.get("event") == "end":
            self.end = line
            raise Error(f"{self.name}: {line['what'] or 'the session has ended'}", line["code"])
        if "event" in line:
            self.events.append(line)
        return line

    def _event(self, name: str) -> dict[str, Any]:
        try:
            while True:
                line = self._next(f"event `{name}`")
                if line.get("event") == name:
                    return line
        except Error:
            self._leave()
            raise

    def _close_input(self) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except BrokenPipeError:
            pass  # The program has ended already.

    def _leave(self) -> None:
        """Waits for the program's end."""
        self._close_input()
        try:
            self._process.wait(self.timeout)
        except subprocess.TimeoutExpired:
            self._process.terminate()
            self._process.wait(self.timeout)
        self._reader.join(self.timeout)

    def request(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Sends a request and returns its result; see `drivebench schema session`."""
        return self._request(0, do, arguments)

    def _request(self, lasts: float, do: str, arguments: dict[str, Any]) -> dict[str, Any]:
        """Sends a request that takes so many seconds by itself."""
        if self._process.stdin is None or self._process.stdin.closed:
            raise Error(f"{self.name}: the session has ended", 3)
        self._number += 1
        number = self._number
        text = json.dumps({"id": number, "do": do, **arguments})
        self.log.append("> " + text)
        try:
            self._process.stdin.write(text + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # The last line says why the session has ended.
        while True:
            line = self._next(f"answer to `{do}`", lasts)
            if line.get("id") == number:
                if "error" in line:
                    raise Error(line["error"]["what"], line["error"]["code"])
                return dict(line["result"])
            if "error" in line and line.get("id") is None:
                raise Error(line["error"]["what"], line["error"]["code"])

    @property
    def happened(self) -> list[str]:
        """What happened on the bus that no request asked for, in words; the last 200 events at most."""
        return [event["what"] for event in self.events if event["event"] == "bus"]

    def drive(self, number: int | str) -> Drive:
        """A drive by its number: `3`, or `"2:3"` in the second ring."""
        return Drive(self, number)

    def wait(self, seconds: float) -> None:
        """Lets time pass on the bus, at most 60 s. Simulated time passes at once."""
        self._request(seconds, "wait", {"ms": round(seconds * 1000)})

    def stop(self) -> None:
        """Stops all drives."""
        self.request("stop")

    def fault(self, line: str) -> None:
        """Injects a fault into simulated rings, as a scenario writes it: `98->97 byte 10: flip 0`; the byte is counted from now on."""
        self.request("fault", line=line)

    def capture(self, path: str | os.PathLike[str]) -> Capture:
        """Captures what is exchanged from now on; the file must not be there. `with rig.capture("turn.pcapng"): ...`"""
        return Capture(self, path)

    def recover(self) -> str:
        """Brings rings out of the error mode and counts their drives."""
        return str(self.request("recover")["found"])

    def command(self, *words: str) -> str:
        """Runs a command of `drivebench` on the rig, such as `rig.command("info", "all")`, and returns what it prints."""
        return str(self.request("command", words=list(words)).get("text", ""))

    def run(self, scenario: str) -> Run:
        """Plays a scenario: a text of several lines, a path, or the name of a built-in one."""
        key = "scenario" if "\n" in scenario else "path"
        return Run(self.request("run", **{key: scenario}))

    def close(self) -> None:
        """Ends the session; raises where the safe state is not confirmed."""
        self._close_input()
        try:
            while self.end is None:
                self._next("end")
        except Error as error:
            if self.end is None or error.exit_code != 0:
                raise
        finally:
            self._leave()

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self.close()
        except Error:
            if kind is None:
                raise
