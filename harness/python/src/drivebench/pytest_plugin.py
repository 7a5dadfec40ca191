"""Fixtures for pytest: `drivebench_rig` and `drivebench_drive`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from . import Drive, Rig

_RIG = pytest.StashKey[Rig]()
#: What the report of a test says of its rig.
_PROPERTIES = ("drivebench_rig", "drivebench_bus", "drivebench_capture")
#: The longest name of a file of evidence, without its ending.
_LONGEST = 120


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("drivebench")
    group.addoption("--drivebench-rig", default="sim:3", metavar="RIG", help="the rig of the tests: sim:N, a file or a name (default: sim:3)")
    group.addoption("--drivebench-program", default=None, metavar="PATH", help="the program drivebench (default: $DRIVEBENCH, or on the path)")
    group.addoption("--drivebench-evidence", default=None, metavar="FOLDER", help="keep a capture of each test in this folder, in pcapng")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "drivebench_motion: motors may turn in this test, as far as the rig's file permits it")
    folder = config.getoption("--drivebench-evidence")
    if folder is not None:
        try:
            (config.invocation_params.dir / folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise pytest.UsageError(f"--drivebench-evidence {folder}: {error}") from None


def _evidence(item: pytest.Item) -> Path | None:
    """A file for the capture of a test that is not there yet."""
    folder = item.config.getoption("--drivebench-evidence")
    if folder is None:
        return None
    folder = item.config.invocation_params.dir / folder
    name = re.sub(r"[^A-Za-z0-9_.-]+", "-", item.nodeid)[-_LONGEST:].strip("-.")
    path: Path = folder / f"{name}.pcapng"
    number = 1
    while path.exists():
        number += 1
        path = folder / f"{name}-{number}.pcapng"
    return path


@pytest.fixture
def drivebench_rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    """A rig for one test. Motors may turn only in a test with the marker `drivebench_motion`."""
    item = request.node
    motion = item.get_closest_marker("drivebench_motion") is not None
    name = request.config.getoption("--drivebench-rig")
    # A test that is run again (pytest-rerunfailures) keeps its item: what an earlier run has left there does not hold any more.
    item.user_properties[:] = [own for own in item.user_properties if own[0] not in _PROPERTIES]
    if _RIG in item.stash:
        del item.stash[_RIG]
    with Rig(name, allow_motion=motion, program=request.config.getoption("--drivebench-program")) as rig:
        item.stash[_RIG] = rig
        item.user_properties += [("drivebench_rig", name), ("drivebench_bus", rig.bus)]
        path = _evidence(item)
        if path is None:
            yield rig
        else:
            item.user_properties.append(("drivebench_capture", str(path)))
            with rig.capture(path):
                yield rig


@pytest.fixture
def drivebench_drive(drivebench_rig: Rig) -> Drive:
    """The first drive of the rig."""
    return drivebench_rig.drive(drivebench_rig.drives[0])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Any:
    """Adds the conversation to the report of a failed test."""
    report = yield
    rig = item.stash.get(_RIG, None)
    if rig is not None and report.failed:
        report.sections.append(("drivebench: the last requests and answers", "\n".join(rig.log)))
    return report
