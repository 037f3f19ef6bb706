#!/usr/bin/env bash
# A whole calibration over real SocketCAN: simrig → vcan0 → acquisition → certificate, in a virtual machine.
#   socketcan.sh BUILD_DIR
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
build=$1
worlds=$here/../../rig/sim/worlds
exec "$here/boot.sh" "$build/vm" "$here/socketcan_guest.sh" \
  "$build/plumbline" "$build/plumbline-simrig" "$here/rig.toml" "$worlds/white.toml"
