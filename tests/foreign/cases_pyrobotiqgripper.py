"""Modbus RTU of the Robotiq 2F-85 by the published driver pyRobotiqGripper, as its documentation shows its use."""

from __future__ import annotations

import time

import cases
import pyrobotiqgripper
from cases import See
from emulator import Emulator
from pyrobotiqgripper import RobotiqGripper

MOVING, STOPPED_CLOSING, THERE = 0, 2, 3


class Closing:
    """Its gripper, with the `close` of everything here: there `close` closes the jaws."""

    def __init__(self, emulator: Emulator) -> None:
        self.gripper = RobotiqGripper(com_port=emulator.address)

    def close(self) -> None:
        self.gripper.disconnect()


case = cases.of("pyRobotiqGripper", "robotiq-rtu", Closing)


def started(client: Closing) -> RobotiqGripper:
    gripper = client.gripper
    gripper.reset()
    gripper.activate()
    return gripper


@case("status")
def status(see: See, client: Closing, _: Emulator) -> None:
    got = client.gripper.status()
    see("ACT, GTO, FLT", [int(got[name]) for name in ("gACT", "gGTO", "gFLT")], [1, 0, 0])


@case("activate")
def activate(see: See, client: Closing, _: Emulator) -> None:
    client.gripper.reset()
    see("after reset", client.gripper.isActivated(), False)
    client.gripper.activate()
    see("after activate", client.gripper.isActivated(), True)


@case("start()", "--width", "0")
def start(see: See, client: Closing, _: Emulator) -> None:
    client.gripper.reset()
    client.gripper.activate(start=False)
    see("before", int(client.gripper.status()["gGTO"]), 0)
    client.gripper.start()
    see("after", int(client.gripper.status()["gGTO"]), 1)


@case("move(), read afterwards by function 4", "--width", "0")
def move_plain(see: See, client: Closing, _: Emulator) -> None:
    gripper = started(client)
    for position in (150, 20):
        gripper.move(position, readStatus=False)
        see("object", int(gripper.objectDetection()), THERE)
        see("position", gripper.position(), position, within=2)


@case("go to, read position and object status", "--width", "0")
def move(see: See, client: Closing, _: Emulator) -> None:
    gripper = started(client)
    for position in (150, 20):
        gripper.move(position)
        see("object", int(gripper.objectDetection()), THERE)
        see("position", gripper.position(), position, within=2)


@case("move(start=True)", "--width", "0")
def move_start(see: See, client: Closing, _: Emulator) -> None:
    client.gripper.reset()
    client.gripper.activate(start=False)
    client.gripper.move(90, start=True)
    see("position", client.gripper.position(), 90, within=2)


@case("go to, onto a part: object status and current")
def close_onto(see: See, client: Closing, _: Emulator) -> None:
    gripper = started(client)
    gripper.close(force=128)
    see("object", int(gripper.objectDetection()), STOPPED_CLOSING)
    time.sleep(0.5)
    see.over("current, 10 mA", float(gripper.status()["gCU"]), 0.0)
    gripper.open()
    see("opened", int(gripper.objectDetection()), THERE)


@case("open(), close()", "--width", "0")
def open_close(see: See, client: Closing, _: Emulator) -> None:
    gripper = started(client)
    gripper.close()
    see.over("closed", gripper.position(), 220)
    gripper.open()
    see.over("open: 255 less the position", 255 - gripper.position(), 240)


@case("GTO 0 stops", "--width", "0")
def stop(see: See, client: Closing, _: Emulator) -> None:
    gripper = started(client)
    gripper.move(255, wait=False, readStatus=False)
    time.sleep(0.4)
    gripper.stop()
    time.sleep(0.1)
    stopped_at = gripper.position()
    see.over("left to go", 225 - stopped_at, 0)
    time.sleep(0.2)
    see("it stands", gripper.position(), stopped_at, within=1)


@case("calibrate_mm(), move_mm()", "--width", "0")
def millimetres(see: See, client: Closing, _: Emulator) -> None:
    gripper = started(client)
    gripper.calibrate_mm(closemm=0.0, openmm=85.0)
    gripper.move_mm(40.0)
    see("opening, mm", gripper.position_mm(), 40.0, within=1.0)


@case("a gripper told to move before it is activated")
def not_active(see: See, client: Closing, _: Emulator) -> None:
    client.gripper.reset()
    told = ""
    try:
        client.gripper.move(100)
    except pyrobotiqgripper.GripperNotActivatedError as error:
        told = type(error).__name__
    see("refused by the library, from STA", told, "GripperNotActivatedError")
