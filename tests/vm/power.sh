#!/usr/bin/env bash
# Cuts the power of a virtual machine while it commits poses to a database on ext4.
#   power.sh BUILD_DIR CUTS
# Each boot replays the file system's journal, checks every pose that was acknowledged before the cuts
# so far, and goes on committing until its power is cut at a random moment.
set -euo pipefail
build=$(realpath "$1")
cuts=$2
patience=${PATIENCE_S:-600}0 # tenths of a second for a boot
work=$build/vm
skip() {
  echo "SKIPPED (virtual machine): $*"
  exit 77
}
export PATH=$PATH:/sbin:/usr/sbin
for tool in qemu-system-x86_64 busybox cpio modprobe depmod mkfs.ext4; do
  command -v "$tool" >/dev/null || skip "$tool is not installed; scripts/setup installs it"
done
kernel_dir=$work/kernel
if [ ! -d "$kernel_dir/boot" ]; then # as tests/vm/boot.sh does it
  "$(dirname "$0")/boot.sh" "$work" /dev/null >/dev/null 2>&1 || true
  [ -d "$kernel_dir/boot" ] || skip "no kernel to be had"
fi
vmlinuz=$(echo "$kernel_dir"/boot/vmlinuz-*)
version=$(basename "$(echo "$kernel_dir"/lib/modules/*)")
[ -f "$kernel_dir/lib/modules/$version/modules.dep" ] || depmod -b "$kernel_dir" "$version"

root=$(mktemp -d "$work/power.XXXXXX")
trap 'rm -rf "$root" "$root".*' EXIT
mkdir -p "$root"/{bin,sbin,proc,sys,dev,tmp,data,lib64,modules}
cp "$(command -v busybox)" "$root/bin/busybox"
order=0
for module in virtio_pci virtio_blk ext4; do
  while read -r _ path _; do
    case $path in *.ko) ;; *) continue ;; esac
    name=$(basename "$path")
    ls "$root/modules"/*-"$name" >/dev/null 2>&1 && continue
    order=$((order + 1))
    cp "$path" "$root/modules/$(printf %03d $order)-$name"
  done < <(modprobe -d "$kernel_dir" -S "$version" --show-depends "$module" 2>/dev/null)
done
# ext4 asks for its checksum by name.
crc=$(find "$kernel_dir/lib/modules/$version" -name 'crc32c_generic.ko' | head -1)
[ -z "$crc" ] || cp "$crc" "$root/modules/000-crc32c_generic.ko"
install -m 755 "$build/power_writer" "$root/bin/power_writer"
ldd "$build/power_writer" | grep -o '/[^ )]*' | while read -r library; do
  [ -e "$root/$library" ] || install -D "$library" "$root/$library"
done
cat >"$root/init" <<'INIT'
#!/bin/busybox sh
/bin/busybox --install -s /sbin
export PATH=/bin:/sbin
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t devtmpfs dev /dev 2>/dev/null
for module in /modules/*.ko; do insmod "$module" 2>/dev/null; done
mount -t ext4 /dev/vda /data || { echo "POWER-FAULT no file system"; poweroff -f; }
acknowledged=$(sed 's/.*acknowledged=\([-0-9]*\).*/\1/' /proc/cmdline)
power_writer /data/run.db "$acknowledged"
poweroff -f
INIT
chmod +x "$root/init"
(cd "$root" && find . -print0 | cpio --null --quiet -o -H newc | gzip -1) >"$root.cpio.gz"
truncate -s 256M "$root.img"
mkfs.ext4 -q -F "$root.img"

acknowledged=-1
lost=0
done_cuts=0
slow=0
RANDOM=${SEED:-1}
for ((cut = 1; cut <= cuts; ++cut)); do
  : >"$root.console"
  qemu-system-x86_64 -M q35 -m 256 -nographic -no-reboot -nodefaults -serial stdio \
    -kernel "$vmlinuz" -initrd "$root.cpio.gz" \
    -drive file="$root.img",format=raw,if=virtio,cache=writeback \
    -append "console=ttyS0 quiet panic=-1 acknowledged=$acknowledged" </dev/null >"$root.console" 2>&1 &
  machine=$!
  # Every fifth cut comes while the guest starts, mounts and checks.
  early=$((cut % 5 == 0))
  if [ $early -eq 1 ]; then
    waited_for='Booting\|POWER-FAULT'
    after=$((RANDOM % 12))
  else
    waited_for='POWER-ACK\|POWER-FAULT'
    after=$((RANDOM % 3))
  fi
  waited=0
  until grep -aq "$waited_for" "$root.console" || ! kill -0 $machine 2>/dev/null; do
    sleep 0.1
    waited=$((waited + 1))
    [ $waited -lt "$patience" ] || break
  done
  sleep "$after.$(printf %03d $((RANDOM % 1000)))"
  kill -9 $machine 2>/dev/null || true
  wait $machine 2>/dev/null || true
  if grep -a 'POWER-FAULT' "$root.console"; then
    lost=$((lost + 1))
  elif [ $early -eq 0 ] && ! grep -aq 'POWER-CHECKED' "$root.console"; then
    if [ $waited -ge "$patience" ] && [ $slow -lt 10 ]; then # a busy machine; says nothing
      slow=$((slow + 1))
      cut=$((cut - 1))
      continue
    fi
    tail -5 "$root.console"
    lost=$((lost + 1))
  fi
  # A line that was cut off itself does not count as acknowledged.
  last=$(tr -d '\r' <"$root.console" | grep -a '^POWER-ACK [0-9]*$' | tail -1 | cut -d' ' -f2 || true)
  tail -c1 "$root.console" | grep -q . && last=$(tr -d '\r' <"$root.console" | grep -a '^POWER-ACK [0-9]*$' | tail -2 | head -1 | cut -d' ' -f2 || true)
  [ -z "$last" ] || acknowledged=$last
  done_cuts=$cut
  [ $((cut % 10)) -ne 0 ] || echo "battery-power: $cut cuts, $((acknowledged + 1)) poses acknowledged, $lost faults"
done
echo "battery-power: $done_cuts power cuts, $((acknowledged + 1)) poses acknowledged, $lost faults"
[ "$lost" -eq 0 ]
