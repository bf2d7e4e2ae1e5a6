#!/usr/bin/env bash
# How fast a finger is judged: beside one copy of the frame, OpenCV, peers; instructions a frame; growth; many fingers. Installs what
# it needs, prints ratios from one run and writes bench/speed.json and bench/speed.md. An idle machine, please: 7 minutes.
#   bench/speed.sh [--frames 200000]     everything (20,000 frames for the tail without it)
#   bench/speed.sh --check               instructions a frame against bench/speed.json only; fails 3 % above it, or beyond 8 MiB
#   bench/speed.sh --growth              the growth with pixels and markers only: its table and its plots
set -euo pipefail
cd "$(dirname "$0")/.."
command -v valgrind >/dev/null || (apt-get update -qq && apt-get install -y -qq valgrind) >/dev/null
program=$(cargo bench --quiet --locked -p slipbound --bench speed --no-run --message-format=json-render-diagnostics |
    python3 -c 'import json, sys; print([m["executable"] for m in map(json.loads, sys.stdin) if m.get("executable")][-1])')
python=python3
if [ "${1:-}" != --check ] && ! python3 -c 'import cv2, numpy' 2>/dev/null; then
    python3 -m venv target/speed-python
    target/speed-python/bin/pip install --quiet -r bench/parity/requirements.txt
    python=target/speed-python/bin/python
fi
exec "$python" bench/speed.py "$program" "$@"
