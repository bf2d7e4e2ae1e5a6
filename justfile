# The main job on the test recording.
watch:
    cargo run --release -- watch testdata/twist.avi --sensor testdata/painted.toml --overlay out

test:
    cargo test --workspace

# All that must pass before a change lands.
ci:
    .ci/run

bench:
    cargo bench -p slipbound --bench step

# The pixel kernels against OpenCV; tracking on real recordings against OpenCV.
parity:
    python3 bench/parity/parity.py
    python3 bench/real/check_tracking.py
