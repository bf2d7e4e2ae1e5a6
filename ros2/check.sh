#!/usr/bin/env bash
# All that must pass of the ROS 2 node: formatting, lints, tests, the commands of docs/ros2.md, CycloneDDS and FastDDS at the other end. Ends
# with a line that says so.
# Needs no ROS; a Python with a venv, and for FastDDS Debian's libfastrtps-dev, which it installs where it may.
set -euo pipefail
cd "$(dirname "$0")"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/../target}" CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=0
cargo fmt --check
cargo clippy --all-targets --locked -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --locked --quiet
cargo build --locked --bins --examples
cargo test --locked
if [ "$(id -u)" = 0 ] && command -v ip >/dev/null && ip netns add slipbound-try 2>/dev/null; then
    ip netns del slipbound-try
    ./namespaces.sh cargo test --locked --test network -- --ignored --nocapture
    # Beyond 50 s the ends give each other up: reports have to come back all the same.
    ./namespaces.sh "$CARGO_TARGET_DIR/debug/slipbound-ros2" measure --seconds 5 --node-netns slipbound-there --link finger0 --down-s 2 --down-s 75
else
    echo "left out: two network namespaces (not root, no iproute2, or not allowed)"
fi
fastdds="$CARGO_TARGET_DIR/ros2-fastdds"
mkdir -p "$fastdds"
if [ -e /usr/include/fastdds/dds/domain/DomainParticipant.hpp ] \
    || (apt-get update -qq && apt-get install -y -qq g++ libfastrtps-dev) >/dev/null 2>&1; then
    for program in fastdds_reader fastdds_writer fastdds_client; do
        g++ -std=c++17 -O1 -w -o "$fastdds/$program" "tests_interop/$program.cpp" -lfastrtps -lfastcdr
    done
else
    echo "left out: FastDDS (no libfastrtps-dev here)"
fi
python3 -m venv "$CARGO_TARGET_DIR/ros2-python"
"$CARGO_TARGET_DIR/ros2-python/bin/pip" install --quiet -r tests_interop/requirements.txt
"$CARGO_TARGET_DIR/ros2-python/bin/pytest" -q -rs -p no:cacheprovider tests_interop
echo "ros2: all passed"
