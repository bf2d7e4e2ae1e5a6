"""Watch a recording, print when slip begins, and keep a picture of it: ``python watch_recording.py [SOURCE [SENSOR]]``."""

from __future__ import annotations

import sys

import slipbound


def main() -> None:
    """Print one line for every slip."""
    source = sys.argv[1] if len(sys.argv) > 1 else "sim:ramp?object=scissors&ramp_s=0.4&grid=fast&seed=3"
    sensor = sys.argv[2] if len(sys.argv) > 2 else None
    with slipbound.watch(source, sensor) as watched:
        slipped = False
        for report in watched:
            if report.slips and not slipped:
                margin = "unknown" if report.margin is None else f"{report.margin.value:.2f}"
                print(f"frame {report.seq}: {report.state}, margin {margin}")
                image = watched.image()
                if image is not None:
                    print("overlay:", slipbound.overlay(image, report).shape)
            slipped = report.slips


if __name__ == "__main__":
    main()
