#!/usr/bin/env bash
# The clock of the computer is put back, or on, while `record` and `hold` work on a simulated hand: nothing may change. Needs Debian's faketime, which gives
# these programs another CLOCK_REALTIME and leaves that of the computer alone. Ends with an error where something is not as it should be.
#   bench/live/clock_step.sh [path of the program slipbound] [steps in seconds, as in '-3600 +3600 -86400']
set -euo pipefail
program="$(realpath "${1:-target/release/slipbound}")"
library="$(find /usr/lib -name libfaketime.so.1 2>/dev/null | head -1)"
[ -n "$library" ] || { echo "left out: no faketime here (apt-get install faketime)"; exit 0; }
work="$(mktemp -d)"
trap 'kill -INT "${hand:-}" 2>/dev/null || true; rm -rf "$work"' EXIT
cd "$work"
stepped() { LD_PRELOAD="$library" DONT_FAKE_MONOTONIC=1 FAKETIME_NO_CACHE=1 FAKETIME_TIMESTAMP_FILE="$work/clock" "$@"; }
# Puts the clock by so much after so many seconds.
step_after() { (sleep "$1"; printf -- '%s' "$2" > next; mv next clock) & }

for step in ${2:--3600 +3600 -86400}; do
    rm -f hand.txt run.mcap
    "$program" emulate hand --task lift -o hand > hand.txt 2>&1 & hand=$!
    until grep -qs '^wrist' hand.txt; do sleep 0.1; done
    place() { sed -n "s/^$1: //p" hand.txt; }
    printf '+0' > clock
    step_after 3 "$step"
    stepped "$program" record "$(place left)" "$(place right)" -o run.mcap --for-s 6 > record.txt 2>&1 || { cat record.txt; exit 1; }
    wait $!
    printf '+0' > clock
    step_after 6 "$step"
    stepped "$program" hold "$(place left)" "$(place right)" --hand hand/hand.toml --gripper "$(place gripper)" --rest live:20 --for-s 8 \
        -o "held$step" > hold.txt 2>&1 || { cat hold.txt; exit 1; }
    wait $!
    kill -INT "$hand" && wait "$hand" || true
    grep -E ' 0 torn, 0 lost.*, 0 times lost' record.txt >/dev/null || { cat record.txt; exit 1; }
    grep -q 'held to the end of the time' hold.txt || { cat hold.txt; exit 1; }
    # From before the step on: two cameras that begin one frame apart on a busy computer say so.
    ! awk '$1 >= 5' hold.txt | cat record.txt - | grep -E 'no frame for|apart by their stamps|silent' || exit 1
    printf 'clock put by %s s: %s; hold: %s, slid %s\n' "$step" "$(tail -1 record.txt)" "$(grep -o 'held to the end.*' hold.txt)" \
        "$(sed -n 's/.*slid \([0-9.]* mm\).*/\1/p' hand.txt)"
done
