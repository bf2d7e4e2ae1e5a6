"""Log a recording to Rerun: ``python rerun_log.py [SOURCE]`` writes slipbound.rrd; ``rerun slipbound.rrd`` shows it."""

from __future__ import annotations

import sys

import rerun as rr

import slipbound
import slipbound.rerun


def main() -> None:
    """Log every report with its frame."""
    source = sys.argv[1] if len(sys.argv) > 1 else "sim:ramp?object=scissors&ramp_s=0.4&grid=fast&seed=3"
    rr.init("slipbound")
    rr.save("slipbound.rrd", default_blueprint=slipbound.rerun.blueprint())
    with slipbound.watch(source) as watched:
        for report in watched:
            slipbound.rerun.log(report, watched.image())
    print("written: slipbound.rrd")


if __name__ == "__main__":
    main()
