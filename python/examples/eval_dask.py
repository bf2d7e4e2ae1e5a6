"""A sweep of ``slipbound eval`` on many machines: shards on a dask.distributed cluster, joined to the table of one process.

``python eval_dask.py [PROTOCOL [TRIALS [SCHEDULER]]]``; without the address of a scheduler a cluster of two processes is made
here. The workers need a folder in common.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from distributed import Client, LocalCluster

SHARDS_COUNT = 4


def command(*arguments: str) -> str:
    """Run ``slipbound eval`` and return what it prints; a failure is an exception with its text."""
    done = subprocess.run(
        [sys.executable, "-m", "slipbound", "eval", *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return done.stdout


def shard(protocol: str, trials: str, number: int, folder: str) -> str:
    """Judge one shard; its folder."""
    to = f"{folder}/shard-{number}"
    of = f"{number}/{SHARDS_COUNT}"
    command(protocol, "--trials", trials, "--shard", of, "--jobs", "1", "--pictures", "0", "-o", to)
    return to


def main() -> None:
    """Print the table of all shards."""
    protocol = sys.argv[1] if len(sys.argv) > 1 else "table1"
    trials = sys.argv[2] if len(sys.argv) > 2 else "8"
    with tempfile.TemporaryDirectory(dir=".") as temporary:
        folder = str(Path(temporary).resolve())
        made: Any = LocalCluster
        connect: Any = Client
        cluster = sys.argv[3] if len(sys.argv) > 3 else made(n_workers=2, threads_per_worker=1)
        with connect(cluster) as client:
            numbers = range(1, SHARDS_COUNT + 1)
            folders = client.gather([client.submit(shard, protocol, trials, n, folder) for n in numbers])
        print(command("merge", *folders, "--pictures", "0", "-o", f"{folder}/all"))
        if not isinstance(cluster, str):
            cluster.close()


if __name__ == "__main__":
    main()
