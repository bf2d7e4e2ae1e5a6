#!/usr/bin/env bash
# V4L2 without a camera: the kernel's own test driver `vivid` in a virtual machine. Frames, formats, controls, time stamps, and
# a camera that is taken away and comes back. Exits 0 and says so where the machine cannot be had (QEMU, busybox, cpio and a
# Debian kernel, all by apt); 1 where something is not as it should be.
#   bench/live/vivid.sh [path of the program slipbound]
set -euo pipefail
cd "$(dirname "$0")/../.."
program="${1:-target/release/slipbound}"
skip() { printf 'V4L2 against vivid: skipped, %s\n' "$*"; exit 0; }
[ "$(uname -m)" = x86_64 ] || skip "this is no x86_64"
[ -x "$program" ] || skip "there is no program $program"

missing=""
command -v qemu-system-x86_64 >/dev/null || missing="$missing qemu-system-x86"
[ -x /bin/busybox ] && ! ldd /bin/busybox >/dev/null 2>&1 || missing="$missing busybox-static"
command -v cpio >/dev/null || missing="$missing cpio"
if [ -n "$missing" ]; then
    # shellcheck disable=SC2086
    (apt-get update -qq && apt-get install -y -qq --no-install-recommends $missing) >/dev/null 2>&1 || skip "no$missing"
fi

work="${VIVID_CACHE:-target/vivid}"
mkdir -p "$work"
work="$(cd "$work" && pwd)"
if ! ls "$work"/kernel/boot/vmlinuz-* >/dev/null 2>&1; then
    package="$(apt-cache depends linux-image-amd64 2>/dev/null | awk '/Depends: linux-image-/ {print $2; exit}')"
    [ -n "$package" ] || skip "no kernel package"
    (cd "$work" && apt-get download -qq "$package") >/dev/null 2>&1 || skip "the kernel package cannot be had"
    dpkg -x "$work"/linux-image-*.deb "$work/kernel"
fi
kernel="$(ls "$work"/kernel/boot/vmlinuz-* | head -1)"
version="${kernel##*/vmlinuz-}"
modules="$work/kernel/lib/modules/$version"

root="$work/root"
rm -rf "$root"
mkdir -p "$root"/{bin,proc,sys,dev,tmp,lib/modules}
cp /bin/busybox "$root/bin/"
cp "$program" "$root/bin/slipbound"
ldd "$program" | grep -o '/[^ ]*' | while read -r library; do
    mkdir -p "$root$(dirname "$library")"
    cp -L "$library" "$root$library"
done
# The driver and all that it needs, in the order in which they are loaded.
/bin/busybox depmod -b "$work/kernel" "$version"
list="$(awk -F: '/\/vivid\.ko:/ {print $2, $1}' "$modules/modules.dep")"
[ -n "$list" ] || skip "this kernel has no vivid"
for module in $(for one in ${list% *}; do printf '%s\n' "$one"; done | tac) ${list##* }; do
    cp "$modules/$module" "$root/lib/modules/"
    basename "$module" >> "$root/lib/modules/order"
done

cat > "$root/init" <<'INIT'
#!/bin/busybox sh
busybox mount -t proc proc /proc
busybox mount -t sysfs sys /sys
busybox mount -t devtmpfs dev /dev
export PATH=/bin
for module in $(busybox cat /lib/modules/order); do
    options=""
    [ "$module" = vivid.ko ] && options="n_devs=1 node_types=0x1"
    busybox insmod "/lib/modules/$module" $options || echo "CHECK $module failed"
done
busybox sleep 2
say() { echo "CHECK $*"; }
slipbound devices
slipbound record 'v4l2:vivid?format=yuyv&size=640x360&rate_hz=25&gain=50' -o /tmp/a.mcap --for-s 4; say "record $?"
slipbound record 'v4l2:vivid?format=grey&size=320x180' -o /tmp/b.mcap --for-s 2; say "grey $?"
slipbound record 'v4l2:vivid?size=641x1' -o /tmp/c.mcap --for-s 1; say "size $?"
slipbound record 'v4l2:vivid?gain=99999' -o /tmp/c.mcap --for-s 1; say "gain $?"
slipbound record 'v4l2:0' -o /tmp/c.mcap --for-s 1; say "number $?"
slipbound record 'v4l2:vivid?format=yuyv&size=320x180&rate_hz=25' -o /tmp/d.mcap --for-s 16 &
busybox sleep 4
echo vivid.0 > /sys/bus/platform/drivers/vivid/unbind; say "unbound"
busybox sleep 3
echo vivid.0 > /sys/bus/platform/drivers/vivid/bind; say "bound"
wait $!; say "returned $?"
busybox ls -l /tmp
busybox poweroff -f
INIT
chmod +x "$root/init"
(cd "$root" && find . | cpio -o -H newc --quiet | gzip -1) > "$work/root.gz"

# Without KVM: within a virtual machine it is often there and does not work.
log="$work/log.txt"
timeout 400 qemu-system-x86_64 -machine accel=tcg -cpu max -smp 2 -m 768 -nographic -no-reboot -kernel "$kernel" \
    -initrd "$work/root.gz" -append "console=ttyS0 quiet panic=-1" </dev/null >"$log" 2>&1 || true

failed=0
expect() { grep -aqE "$1" "$log" || { printf 'V4L2 against vivid: expected %s\n' "$1"; failed=1; }; }
expect "'v4l2:vivid'|v4l2:vivid"
expect 'format YUYV, size_px 640x360, rate_hz 2[45]'
expect 'gain locked at 50'
expect 'finger: [0-9]+ frames at [0-9.]+ Hz'
expect 'CHECK record 0'
expect 'format GREY, size_px 320x180'
expect 'CHECK grey 0'
expect 'expected a size that the camera has'
expect 'CHECK size 2'
expect 'gain=0 to '
expect 'CHECK gain 2'
expect 'numbers change'
expect 'CHECK number 2'
expect '1 times lost and back'
expect 'CHECK returned 0'
# Of a line that is written again and again, what stands in the end.
grep -aE 'finger:|CHECK|v4l2:' "$log" | sed 's/.*\x1b\[1A//' || true
[ "$failed" = 0 ] || { tail -60 "$log"; exit 1; }
echo "V4L2 against vivid: all as it should be"
