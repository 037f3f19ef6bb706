#!/usr/bin/env bash
# Boots Debian's kernel in qemu (no KVM needed) with an initramfs that holds given programs, runs a
# script inside and prints what it printed. Used by the tests that need real SocketCAN.
#
#   boot.sh WORKDIR SCRIPT [FILE[:PATH_IN_GUEST] …]
#
# SCRIPT runs as /test/script with /bin/sh (busybox), the FILEs lie in /test (or at their path) and
# programs among them find their shared libraries. Exit status: that of SCRIPT; 77 when qemu, busybox
# or the kernel package cannot be had, with the reason in a loud line.
set -euo pipefail

work=$1
script=$2
shift 2
timeout_s=${PLUMBLINE_VM_TIMEOUT_S:-480}

skip() {
  echo "SKIPPED (virtual machine): $*"
  exit 77
}

for tool in qemu-system-x86_64 busybox cpio depmod ip; do
  command -v "$tool" >/dev/null || PATH=$PATH:/sbin:/usr/sbin command -v "$tool" >/dev/null ||
    skip "$tool is not installed; scripts/setup installs it"
done

# The kernel is unpacked, not installed: nothing on this machine changes.
mkdir -p "$work"
kernel_dir=$work/kernel
fetch_kernel() {
  local package
  package=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/^ *Depends: \(linux-image-[0-9].*\)/\1/p' | head -1)
  [ -n "$package" ] || skip "the package index knows no linux-image-amd64; run apt-get update"
  rm -rf "$work/download" && mkdir -p "$work/download"
  (cd "$work/download" && apt-get download "$package" >download.log 2>&1) ||
    skip "cannot download $package: $(tail -1 "$work/download/download.log")"
  rm -rf "$kernel_dir.new"
  dpkg-deb -x "$work"/download/*.deb "$kernel_dir.new"
  rm -rf "$kernel_dir" "$work/download"
  mv "$kernel_dir.new" "$kernel_dir"
}
exec 8>"$work/lock"
flock 8
[ -d "$kernel_dir/boot" ] || fetch_kernel
flock -u 8
vmlinuz=$(echo "$kernel_dir"/boot/vmlinuz-*)
modules=$(echo "$kernel_dir"/lib/modules/*/kernel)

root=$(mktemp -d "$work/root.XXXXXX")
trap 'rm -rf "$root" "$root.cpio.gz" "$root.console"' EXIT
mkdir -p "$root"/{bin,sbin,proc,sys,dev,tmp,test,modules,lib64,run}
cp "$(command -v busybox)" "$root/bin/busybox"
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan \
  drivers/net/can/vxcan net/sched/sch_netem; do
  cp "$modules/$module.ko" "$root/modules/"
done

# A program and every shared library it needs, at the paths where the loader looks for them.
add_program() {
  install -D -m 755 "$1" "$root/$2"
  ldd "$1" 2>/dev/null | grep -o '/[^ )]*' | while read -r library; do
    [ -e "$root/$library" ] || install -D "$library" "$root/$library"
  done
}
add_program "$(PATH=$PATH:/sbin:/usr/sbin command -v ip)" bin/ip
tc=$(PATH=$PATH:/sbin:/usr/sbin command -v tc || true)
[ -z "$tc" ] || add_program "$tc" bin/tc
for item in "$@"; do
  file=${item%%:*}
  target=test/$(basename "$file")
  [ "$item" = "$file" ] || target=${item#*:}
  if [ -x "$file" ]; then add_program "$file" "$target"; else install -D -m 644 "$file" "$root/$target"; fi
done
# A run with --out writes a certificate, which needs its fonts.
for font in /usr/share/fonts/truetype/{liberation2/LiberationSans-{Regular,Bold,Italic},dejavu/DejaVuSans{,-Bold}}.ttf; do
  install -D -m 644 "$font" "$root/$font"
done
install -m 755 "$script" "$root/test/script"

cat >"$root/init" <<'INIT'
#!/bin/busybox sh
/bin/busybox --install -s /sbin
export PATH=/bin:/sbin
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t devtmpfs dev /dev 2>/dev/null
mkdir -p /dev/pts && mount -t devpts devpts /dev/pts; mkdir -p /dev/shm
mount -t tmpfs tmpfs /tmp
/bin/ip link set lo up
for module in can can-raw can-dev; do insmod /modules/$module.ko; done
insmod /modules/vcan.ko echo=1
cd /test
echo; echo "VM-BEGIN"
/bin/busybox sh /test/script
status=$?; echo; echo "VM-EXIT $status"
poweroff -f
INIT
chmod +x "$root/init"
(cd "$root" && find . -print0 | cpio --null --quiet -o -H newc | gzip -1) >"$root.cpio.gz"

timeout "$timeout_s" qemu-system-x86_64 -M q35 -cpu max -m 1024 -smp 2 -nographic -no-reboot -nodefaults \
  -serial stdio -kernel "$vmlinuz" -initrd "$root.cpio.gz" \
  -append "console=ttyS0 quiet panic=-1" </dev/null 2>&1 | tr -d '\r' >"$root.console" || true
if ! grep -q '^VM-BEGIN' "$root.console"; then
  tail -20 "$root.console"
  echo "the guest did not boot within $timeout_s s"
  exit 1
fi
sed -n '/^VM-BEGIN/,$p' "$root.console"
status=$(sed -n 's/^VM-EXIT \([0-9]*\).*/\1/p' "$root.console" | tail -1)
exit "${status:-1}"
