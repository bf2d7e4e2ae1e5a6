"""A node that stands for your gripper: it holds harder when a slip begins."""

from __future__ import annotations

import json
import os

from dora import Node

START_N = 10.0
MOST_N = 40.0


def main() -> None:
    """Hold until nobody reports any more; the force is kept when the reports end."""
    force_n, slipped, count = START_N, False, 0
    log = open(os.environ.get("REPORTS", os.devnull), "w")
    node = Node()
    with log:
        for event in node:
            if event["type"] == "STOP":
                break
            if event["type"] != "INPUT":
                continue
            line = event["value"][0].as_py()
            log.write(line + "\n")
            slips = json.loads(line)["state"] in ("incipient", "gross")
            count += 1
            if slips and not slipped:
                force_n = min(1.2 * force_n, MOST_N)
                print(f"report {count}: slip, hold with {force_n:.1f} N", flush=True)
            slipped = slips
    print(f"{count} reports, still holding with {force_n:.1f} N", flush=True)


if __name__ == "__main__":
    main()
