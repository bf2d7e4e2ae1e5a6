#!/usr/bin/env bash
# Makes the wheels that are shipped, into target/packages: packaging/wheels.sh [x86_64 | aarch64] ...
# Linked by zig (PyPI's ziglang) against glibc 2.28, so that they run where that or a newer one is: no cross compiler, no container. Each is for
# every CPython from 3.10 on. PROFILE=ci builds wheels to be thrown away. Needs Rust with rustup, and Python with a venv.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$PWD/target/packages
tools=$PWD/target/wheel-tools
target=${CARGO_TARGET_DIR:-$PWD/target}
python3 -m venv "$tools"
"$tools/bin/pip" install --quiet 'maturin>=1.9,<2' ziglang
export PATH="$tools/bin:$PATH"
for machine in "${@:-x86_64}"; do
    case $machine in
    x86_64 | aarch64) ;;
    *)
        echo "expected x86_64 or aarch64, got $machine" >&2
        exit 2
        ;;
    esac
    said=$(rustup target add "$machine-unknown-linux-gnu" 2>&1) || {
        echo "expected Rust's standard library for $machine-unknown-linux-gnu, got from \`rustup target add\`: $said" >&2
        exit 1
    }
    (cd python && maturin build --quiet --profile "${PROFILE:-release}" --locked --zig --target "$machine-unknown-linux-gnu" \
        --compatibility manylinux_2_28 --target-dir "$target" --out "$out")
    ls -l "$out"/slipbound-*-manylinux_2_28_"$machine".whl
done
