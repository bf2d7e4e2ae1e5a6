"""The command line: ``python -m slipbound``, which is the program ``slipbound``."""

from __future__ import annotations

import signal
import sys

from . import _slipbound as _native


def main() -> None:
    """Run the command of the arguments and exit with the program's exit code."""
    # Python would only note Ctrl-C and go on; commands that must end in order handle it themselves.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.stdout.flush()
    sys.exit(_native.run(["slipbound", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
