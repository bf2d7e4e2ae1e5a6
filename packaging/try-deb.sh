#!/usr/bin/env bash
# Installs the package that packaging/build.sh deb made, uses what is in it, and removes it again. As root.
set -euo pipefail
cd "$(dirname "$0")/.."
dpkg -i target/packages/slipbound.deb
/usr/bin/slipbound --version
/usr/bin/slipbound watch 'sim:press?grid=fast' >/dev/null
for file in /usr/share/man/man1/slipbound-watch.1.gz /usr/share/bash-completion/completions/slipbound \
    /usr/lib/udev/rules.d/60-slipbound.rules; do
    test -s "$file"
done
dpkg -r slipbound
test ! -e /usr/bin/slipbound
echo "the package was installed, used and removed"
