"""Tests of the package, on simulated rigs."""

from __future__ import annotations

import unittest

import drivebench


class OnRings(unittest.TestCase):
    def test_values_have_units(self) -> None:
        with drivebench.Rig("sim:3", allow_motion=True) as rig:
            drive = rig.drive(0)
            drive["nsoll"] = "100rpm"
            drive.go()
            rig.wait(1)
            speed = drive["nist"]
            assert isinstance(speed, drivebench.Quantity)
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
            self.assertEqual(rig.drive(0)["nist"].unit, "rpm")

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
            self.assertTrue(any(event["event"] == "bus" for event in rig.events), list(rig.log))

    def test_a_byte_is_counted_from_now_on(self) -> None:
        with drivebench.Rig("sim:3") as rig:
            rig.wait(0.1)
            rig.fault("2->1 byte 10: flip 0")
            rig.wait(0.1)
            rig.drive(0)["nist"]
            self.assertTrue(any("drive 1" in event.get("what", "") for event in rig.events), list(rig.log))

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
            actual = rig.drive(8)["HIW"]
            assert isinstance(actual, drivebench.Quantity)
            # It turns on between requests.
            self.assertAlmostEqual(actual, 50, delta=1)


if __name__ == "__main__":
    unittest.main()
