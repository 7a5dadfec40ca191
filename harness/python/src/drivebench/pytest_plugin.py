"""Fixtures for pytest: `drivebench_rig` and `drivebench_drive`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from . import Drive, Rig

_RIG = pytest.StashKey[Rig]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("drivebench")
    group.addoption("--drivebench-rig", default="sim:3", metavar="RIG", help="the rig of the tests: sim:N, a file or a name (default: sim:3)")
    group.addoption("--drivebench-program", default=None, metavar="PATH", help="the program drivebench (default: $DRIVEBENCH, or on the path)")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "drivebench_motion: motors may turn in this test, as far as the rig's file permits it")


@pytest.fixture
def drivebench_rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    """A rig for one test. Motors may turn only in a test with the marker `drivebench_motion`."""
    motion = request.node.get_closest_marker("drivebench_motion") is not None
    name = request.config.getoption("--drivebench-rig")
    with Rig(name, allow_motion=motion, program=request.config.getoption("--drivebench-program")) as rig:
        request.node.stash[_RIG] = rig
        yield rig


@pytest.fixture
def drivebench_drive(drivebench_rig: Rig) -> Drive:
    """The first drive of the rig."""
    number = drivebench_rig.drives[0]
    return drivebench_rig.drive(number)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Any:
    """Adds the conversation to the report of a failed test."""
    report = yield
    rig = item.stash.get(_RIG, None)
    if rig is not None and report.failed:
        report.sections.append(("drivebench: the last requests and answers", "\n".join(rig.log)))
    return report
