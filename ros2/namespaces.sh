#!/usr/bin/env bash
# Runs a command in a network namespace that has a cable (veth, device finger0) to another one, slipbound-there, as between two machines. Both
# are gone afterwards. Needs root and iproute2.
#   ./namespaces.sh slipbound-ros2 measure --node-netns slipbound-there --link finger0 --down-s 2 --down-s 90
#   ./namespaces.sh cargo test --test network -- --ignored --nocapture
set -euo pipefail
here=slipbound-here there=slipbound-there
ip netns add "$here"
trap 'ip netns del "$here"; ip netns del "$there" 2>/dev/null || true' EXIT
ip netns add "$there"
ip link add finger0 netns "$here" type veth peer name finger0 netns "$there"
for end in "$here 10.77.0.1" "$there 10.77.0.2"; do
    read -r namespace address <<<"$end"
    ip -n "$namespace" link set lo up
    ip -n "$namespace" address add "$address/24" dev finger0
    ip -n "$namespace" link set finger0 up
done
ip netns exec "$here" "$@"
