#!/usr/bin/env bash
# All that must pass of the ROS 2 node: formatting, lints, tests, CycloneDDS and FastDDS at the other end. Ends with a line that says so.
# Needs no ROS; a Python with a venv, and for FastDDS Debian's libfastrtps-dev, which it installs where it may.
set -euo pipefail
cd "$(dirname "$0")"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/../target}" CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=0
cargo fmt --check
cargo clippy --all-targets --locked -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --locked --quiet
cargo build --locked --bins --examples
cargo test --locked
fastdds="$CARGO_TARGET_DIR/ros2-fastdds"
mkdir -p "$fastdds"
if [ -e /usr/include/fastdds/dds/domain/DomainParticipant.hpp ] \
    || (apt-get update -qq && apt-get install -y -qq g++ libfastrtps-dev) >/dev/null 2>&1; then
    g++ -std=c++17 -O1 -w -o "$fastdds/fastdds_reader" tests_interop/fastdds_reader.cpp -lfastrtps -lfastcdr
else
    echo "left out: FastDDS (no libfastrtps-dev here)"
fi
python3 -m venv "$CARGO_TARGET_DIR/ros2-python"
"$CARGO_TARGET_DIR/ros2-python/bin/pip" install --quiet -r tests_interop/requirements.txt
"$CARGO_TARGET_DIR/ros2-python/bin/pytest" -q -rs -p no:cacheprovider tests_interop
echo "ros2: all passed"
