"""Tests of the plugin for pytest."""

from __future__ import annotations

import xml.etree.ElementTree as xml

import pytest

pytest_plugins = "pytester"

THREE = """
    import pytest

    def test_stands(drivebench_drive):
        assert drivebench_drive["nist"] == 0

    @pytest.mark.drivebench_motion
    def test_turns(drivebench_rig, drivebench_drive):
        drivebench_drive["nsoll"] = "200rpm"
        drivebench_drive.go()
        drivebench_rig.wait(1)
        assert abs(drivebench_drive["nist"] - 200) < 5

    def test_scenario(drivebench_rig):
        assert drivebench_rig.run("9.7-parity-error").passed
"""


def test_three_tests(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(THREE)
    result = pytester.runpytest_subprocess("-W", "error", "--strict-markers")
    result.assert_outcomes(passed=3)


def test_motion_needs_the_mark(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("""
        def test_turns(drivebench_drive):
            drivebench_drive.go()
    """)
    result = pytester.runpytest_subprocess("-W", "error")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*its motor may turn*", "*drivebench: the last requests and answers*", '> *"do": "go"*', "< *error*"])


def test_evidence_is_in_the_report(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(THREE)
    words = ["--drivebench-evidence", "evidence", "--junit-xml", "junit.xml"]
    for _ in range(2):
        pytester.runpytest_subprocess("-W", "error", *words).assert_outcomes(passed=3)
    cases = list(xml.parse(pytester.path / "junit.xml").iter("testcase"))
    assert [case.get("name") for case in cases] == ["test_stands", "test_turns", "test_scenario"]
    for case in cases:
        properties = {own.get("name"): own.get("value") for own in case.iter("property")}
        assert (properties["drivebench_rig"], properties["drivebench_bus"]) == ("sim:3", "novobus")
        capture = properties["drivebench_capture"]
        # The second run leaves the captures of the first one alone.
        assert capture is not None and capture.endswith("-2.pcapng")
        with open(capture, "rb") as file:
            assert file.read(4) == b"\x0a\x0d\x0d\x0a"
    assert len(list((pytester.path / "evidence").iterdir())) == 6


def test_a_folder_that_cannot_be_made(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(THREE)
    (pytester.path / "evidence").write_text("a file")
    result = pytester.runpytest_subprocess("--drivebench-evidence", "evidence")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--drivebench-evidence evidence*"])


def test_a_rig_that_is_not_there(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(THREE)
    result = pytester.runpytest_subprocess("-W", "error", "--drivebench-rig", "no-such-rig")
    result.assert_outcomes(errors=3)
    result.stdout.fnmatch_lines(["*no-such-rig*"])


#: Runs each test twice on one item, as pytest-rerunfailures does, and reports the second run.
TWICE = """
    from _pytest.runner import runtestprotocol

    def pytest_runtest_protocol(item, nextitem):
        runtestprotocol(item, nextitem=nextitem, log=False)
        item._initrequest()
        runtestprotocol(item, nextitem=nextitem, log=True)
        return True
"""


def test_a_rerun_replaces_its_properties(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(TWICE)
    pytester.makepyfile("""
        def test_stands(request, drivebench_drive):
            request.node.user_properties.append(("own", "1"))
            assert drivebench_drive["nist"] == 0
    """)
    pytester.runpytest_subprocess("-W", "error", "--drivebench-evidence", "evidence", "--junit-xml", "junit.xml").assert_outcomes(passed=1)
    names = [(own.get("name"), own.get("value")) for own in xml.parse(pytester.path / "junit.xml").iter("property")]
    own = [name for name, _ in names if name != "own"]
    assert own == ["drivebench_rig", "drivebench_bus", "drivebench_capture"]
    captures = sorted(path.name for path in (pytester.path / "evidence").iterdir())
    assert len(captures) == 2 and str(dict(names)["drivebench_capture"]).endswith(captures[0])
    assert captures[0].endswith("-2.pcapng")


def test_a_rerun_without_a_rig_shows_no_earlier_one(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(TWICE)
    pytester.makepyfile("""
        import os

        def test_stands(drivebench_drive):
            os.environ["DRIVEBENCH"] = "no-such-program"
            assert drivebench_drive["nist"] == 0
    """)
    result = pytester.runpytest_subprocess("-W", "error", "--junit-xml", "junit.xml")
    result.assert_outcomes(errors=1)
    result.stdout.no_fnmatch_line("*the last requests and answers*")
    assert not list(xml.parse(pytester.path / "junit.xml").iter("property"))
