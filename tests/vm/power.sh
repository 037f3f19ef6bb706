#!/usr/bin/env bash
# Cuts the power of a virtual machine while it commits poses to a database on ext4.
#   power.sh BUILD_DIR CUTS [LANES]
# After each cut the file system's journal is replayed, every pose checked that was acknowledged before
# the cuts so far, and committing goes on until the power is cut at a random moment. The machine is
# saved once, before it has seen the disk's content, and starts from there. LANES machines beside each other.
set -euo pipefail
build=$(realpath "$1")
cuts=$2
lanes=${3:-1}
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
# Nothing of the disk is remembered: it is another one when the machine goes on.
blockdev --flushbufs /dev/vda; echo 3 >/proc/sys/vm/drop_caches
until [ "$word" = acknowledged ]; do
  echo POWER-READY
  read -t 1 word acknowledged
done
echo POWER-ON
mount -t ext4 /dev/vda /data || { echo "POWER-FAULT no file system"; poweroff -f; }
power_writer /data/run.db "$acknowledged"
poweroff -f
INIT
chmod +x "$root/init"
(cd "$root" && find . -print0 | cpio --null --quiet -o -H newc | gzip -1) >"$root.cpio.gz"

# machine IMAGE MORE…: the same for saving and for going on.
machine() {
  local image=$1
  shift
  exec qemu-system-x86_64 -M q35 -m 256 -nographic -no-reboot -nodefaults -serial stdio \
    -kernel "$vmlinuz" -initrd "$root.cpio.gz" -append "console=ttyS0 quiet panic=-1" \
    -drive file="$image",format=raw,if=virtio,cache=writeback "$@"
}

# wait_for PATTERN FILE PID: until the pattern stands there, the process has ended, or patience has.
wait_for() {
  waited=0
  until grep -aq "$1" "$2" || ! kill -0 "$3" 2>/dev/null; do
    sleep 0.05
    waited=$((waited + 1))
    [ $waited -lt $((2 * patience)) ] || break
  done
}

truncate -s 256M "$root.img"
mkfs.ext4 -q -F "$root.img"
mkfifo "$root.monitor.in" "$root.monitor.out"
(machine "$root.img" -chardev pipe,id=monitor,path="$root.monitor" -mon monitor) \
  </dev/null >"$root.console" 2>&1 &
saved=$!
wait_for 'POWER-READY' "$root.console" $saved
printf 'migrate "exec:cat >%s"\nquit\n' "$root.state" >"$root.monitor.in"
wait $saved || true
if ! grep -aq 'POWER-READY' "$root.console" || [ ! -s "$root.state" ]; then
  tail -5 "$root.console"
  echo "battery-power: the virtual machine did not start"
  exit 1
fi

# lane NUMBER CUTS: a disk of its own, cut so many times. Its last line: cuts, poses, faults.
lane() {
  local lane=$1 cuts=$2 image=$root.$1.img console=$root.$1.console keys=$root.$1.keys
  local acknowledged=-1 lost=0 done_cuts=0 slow=0 early after last process told waited
  RANDOM=$((${SEED:-1} + lane))
  cp --sparse=always "$root.img" "$image"
  mkfifo "$keys"
  for ((cut = 1; cut <= cuts; ++cut)); do
    : >"$console"
    (machine "$image" -incoming "exec:cat $root.state") <>"$keys" >"$console" 2>&1 &
    process=$!
    wait_for 'POWER-READY' "$console" $process
    # Said again: a line that came while the shell was about to stop listening is lost.
    while kill -0 $process 2>/dev/null && ! grep -aq 'POWER-ON' "$console"; do
      echo "acknowledged $acknowledged"
      sleep 3
    done >"$keys" &
    told=$!
    # Every fifth cut comes while the guest mounts and checks.
    early=$((cut % 5 == 0))
    if [ $early -eq 1 ]; then
      wait_for 'POWER-ON\|POWER-FAULT' "$console" $process
      after=0
    else
      wait_for 'POWER-ACK\|POWER-FAULT' "$console" $process
      after=$((RANDOM % 2))
    fi
    sleep "$after.$(printf %03d $((RANDOM % 1000)))"
    kill -9 $process $told 2>/dev/null || true
    wait $process $told 2>/dev/null || true
    if grep -a 'POWER-FAULT' "$console"; then
      lost=$((lost + 1))
    elif ! grep -aq 'POWER-ON' "$console" || { [ $early -eq 0 ] && ! grep -aq 'POWER-CHECKED' "$console"; }; then
      if [ $waited -ge $((2 * patience)) ] && [ $slow -lt 10 ]; then # a busy machine; says nothing
        slow=$((slow + 1))
        cut=$((cut - 1))
        continue
      fi
      tail -5 "$console"
      lost=$((lost + 1))
    fi
    # A line that was cut off itself does not count as acknowledged.
    last=$(tr -d '\r' <"$console" | sed '$d' | grep -a '^POWER-ACK [0-9]*$' | tail -1 | cut -d' ' -f2 || true)
    [ -z "$last" ] || acknowledged=$last
    done_cuts=$cut
    [ $((cut % 10)) -ne 0 ] || echo "battery-power: machine $lane: $cut cuts, $((acknowledged + 1)) poses acknowledged, $lost faults"
  done
  echo "$done_cuts $((acknowledged + 1)) $lost" >"$root.$lane.result"
}

for ((number = 1; number <= lanes; ++number)); do
  lane $number $((cuts / lanes + (number <= cuts % lanes))) &
done
wait
read -r total poses faults < <(cat "$root".*.result | awk '{c += $1; p += $2; f += $3} END {print c, p, f}')
echo "battery-power: $total power cuts, $poses poses acknowledged, $faults faults"
[ "$faults" -eq 0 ] && [ "$total" -eq "$cuts" ]
