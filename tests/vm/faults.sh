#!/usr/bin/env bash
# A run over real SocketCAN with a bus that fails, in a virtual machine.
#   faults.sh BUILD_DIR
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
build=$1
worlds=$here/../../rig/sim/worlds
exec "$here/boot.sh" "$build/vm" "$here/faults_guest.sh" \
  "$build/plumbline" "$build/plumbline-simrig" "$build/can_inject" "$here/rig.toml" "$worlds/white.toml"
