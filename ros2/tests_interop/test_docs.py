"""The commands of docs/ros2.md that need neither a ROS installation nor a second network: run as a reader would, in their order."""

import os
import re
import signal
import subprocess

from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from ros_types import Types
from test_interop import BINARY, LONGEST_WAIT_S, RELIABLE, ROOT, take

DOMAIN_ID = 97
ENDLESS = ("simulate", "node", "emulate")
"""Commands that run until they are stopped: each is the last of its block, which has a terminal of its own."""


def blocks():
    """The blocks that call the program, each with the command that it ends with."""
    page = (ROOT / "docs" / "ros2.md").read_text()
    for block in re.findall(r"^```sh\n(.*?)^```", page, re.M | re.S):
        commands = re.findall(r"^slipbound-ros2 (\w+)", block, re.M)
        if commands:
            yield block, commands[-1]


def test_the_commands_of_the_page_do_what_it_says(tmp_path):
    env = {**os.environ, "PATH": f"{BINARY.parent}:{os.environ['PATH']}", "ROS_DOMAIN_ID": str(DOMAIN_ID)}
    participant, types = DomainParticipant(DOMAIN_ID), Types()

    def reports(name, kind):
        topic = Topic(participant, f"rt/slipbound/{name}/report", types(f"slipbound_msgs/{kind}"), qos=RELIABLE)
        return DataReader(participant, topic, qos=RELIABLE)

    left, hand = reports("left", "SlipReport"), reports("hand", "HandReport")
    running = {}

    def stop(command):
        process = running.pop(command)
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(LONGEST_WAIT_S) in (0, -signal.SIGINT), command
        left.take(1000), hand.take(1000)

    ran = []
    try:
        for block, last in blocks():
            folder = tmp_path if "cd try" in block else tmp_path / "try"
            command = ["bash", "-e", "-c", block]
            ran.append(last)
            if last in ENDLESS:
                process = subprocess.Popen(command, cwd=folder, env=env, stdout=subprocess.PIPE, text=True, start_new_session=True)
                running[last] = process
                assert "Ctrl-C ends it" in process.stdout.readline()
                if last == "node":
                    assert take(left, LONGEST_WAIT_S).finger == "left", "the node reports"
                    stop("node")
            else:
                done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
                assert done.returncode == 0, done.stdout + done.stderr
                assert take(left, 0) is not None and take(hand, 0) is not None, "it reports as the node does"
    finally:
        for command in list(running):
            stop(command)
    assert ran == ["simulate", "node", "emulate", "run"]
