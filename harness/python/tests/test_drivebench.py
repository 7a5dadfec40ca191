"""Tests of the package, on simulated rigs."""

from __future__ import annotations

import os
import tempfile
import unittest

import drivebench


def number(value: drivebench.Quantity | str | None) -> drivebench.Quantity:
    assert isinstance(value, drivebench.Quantity), value
    return value


class OnRings(unittest.TestCase):
    def test_values_have_units(self) -> None:
        with drivebench.Rig("sim:3", allow_motion=True) as rig:
            drive = rig.drive(0)
            drive["nsoll"] = "100rpm"
            drive.go()
            rig.wait(1)
            speed = number(drive["nist"])
            self.assertEqual(speed.unit, "rpm")
            self.assertAlmostEqual(speed, 100, delta=5)
            self.assertEqual(drive.state()["mode"], "go")
            drive.stop()

    def test_motion_needs_permission(self) -> None:
        with drivebench.Rig("sim:3") as rig:
            with self.assertRaises(drivebench.Error) as caught:
                rig.drive(0).go()
            self.assertEqual(caught.exception.exit_code, 2)
            # The session goes on.
            self.assertEqual(number(rig.drive(0)["nist"]).unit, "rpm")

    def test_scenarios(self) -> None:
        with drivebench.Rig("sim:3") as rig:
            self.assertTrue(rig.run("9.7-parity-error").passed)
            rig.fault("2->1: flip 0")
            with self.assertRaises(drivebench.Error) as caught:
                rig.run("9.7-parity-error")
            self.assertIn("write them into the scenario", str(caught.exception))

    def test_a_fault_is_reported_with_its_place(self) -> None:
        with drivebench.Rig("sim:3") as rig:
            rig.fault("2->1: flip 0")
            rig.wait(0.1)
            rig.drive(0)["nist"]
            self.assertIn("the link from drive 2 to drive 1", rig.happened[0])

    def test_a_byte_is_counted_from_now_on(self) -> None:
        with drivebench.Rig("sim:3") as rig:
            rig.wait(0.1)
            rig.fault("2->1 byte 10: flip 0")
            rig.wait(0.1)
            rig.drive(0)["nist"]
            self.assertTrue(any("drive 1" in what for what in rig.happened), list(rig.log))

    def test_a_capture(self) -> None:
        with tempfile.TemporaryDirectory() as folder, drivebench.Rig("sim:3") as rig:
            path = os.path.join(folder, "ring.pcapng")
            with rig.capture(path) as capture:
                rig.drive(0)["nist"]
                with self.assertRaises(drivebench.Error) as caught:
                    rig.capture(os.path.join(folder, "other.pcapng"))
                self.assertIn("capture-end", str(caught.exception))
                self.assertTrue(os.path.exists(path))
            self.assertGreater(capture.packets or 0, 10)
            self.assertEqual(capture.lost, 0)
            self.assertGreater(os.path.getsize(path), 100)
            with self.assertRaises(drivebench.Error) as caught:
                rig.capture(path)
            self.assertIn("is there already", str(caught.exception))

    def test_the_end_of_the_session_writes_a_capture(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "ring.pcapng")
            with drivebench.Rig("sim:3") as rig:
                rig.capture(path)
                rig.drive(0)["nist"]
            self.assertGreater(os.path.getsize(path), 100)

    def test_a_program_that_says_nothing(self) -> None:
        with self.assertRaises(drivebench.Error) as caught:
            drivebench.Rig(program=["sh", "-c", "exec sleep 60"], timeout=0.1)
        self.assertIn("no event `ready` after 0.1 s", str(caught.exception))

    def test_a_program_that_is_not_there(self) -> None:
        with self.assertRaises(drivebench.Error) as caught:
            drivebench.Rig(program="/no/such/program")
        self.assertEqual(caught.exception.exit_code, 2)
        self.assertIn("/no/such/program", str(caught.exception))

    def test_a_program_that_is_none_of_ours(self) -> None:
        for program in ["true", ["sh", "-c", "echo hello"]]:
            with self.assertRaises(drivebench.Error) as caught:
                drivebench.Rig(program=program)
            self.assertEqual(caught.exception.exit_code, 3)

    def test_no_such_rig(self) -> None:
        with self.assertRaises(drivebench.Error) as caught:
            drivebench.Rig("no-such-rig")
        self.assertEqual(caught.exception.exit_code, 2)


class OnPorts(unittest.TestCase):
    def test_a_unitek_drive(self) -> None:
        with drivebench.Rig("sim:unitek:1") as rig:
            self.assertEqual((rig.bus, rig.drives), ("unitek", ["1"]))
            self.assertIsNotNone(rig.drive(1)["SPEED_ACTUAL"])

    def test_a_nordac_inverter(self) -> None:
        with drivebench.Rig("sim:nordac", allow_motion=True) as rig:
            rig.command("exchange", "8", "STW=047E", "then", "STW=047F", "HSW=50%")
            rig.wait(5)
            actual = number(rig.drive(8)["HIW"])
            # It turns on between requests.
            self.assertAlmostEqual(actual, 50, delta=1)


if __name__ == "__main__":
    unittest.main()
