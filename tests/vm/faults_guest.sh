# Runs inside the virtual machine, in /test, with busybox sh: a run over real SocketCAN while the bus
# loses frames (netem), reports bus-off, goes down and up, and is unplugged and plugged in again.
/bin/ip link add dev vcan0 type vcan && /bin/ip link set vcan0 up || exit 1
insmod /modules/sch_netem.ko || exit 1
/bin/tc qdisc add dev vcan0 root netem loss 1% || { echo "no netem"; exit 1; }

./plumbline-simrig --world white.toml --modbus tcp:127.0.0.1:1502 --can can:vcan0 --speed 4 --seed 7 \
  --ready-file /tmp/ready.toml &
simrig=$!
waited=0
until [ -f /tmp/ready.toml ]; do
  sleep 1
  waited=$((waited + 1))
  [ $waited -lt 30 ] || { echo "plumbline-simrig did not get ready"; exit 1; }
done

sed 's/soak_s = 30/soak_s = 4/' rig.toml >faults.toml
echo 'silence_timeout_ms = 1000' >keys
sed -i '/^can = /r keys' faults.toml
./plumbline run --config faults.toml --serial VM-1 --db /tmp/run.db --out /tmp/out --summary /tmp/exit.json &
run=$!
poses() { ./plumbline runs --db /tmp/run.db --json 2>/dev/null | sed -n 's/.*"poses": \([0-9]*\).*/\1/p'; }
wait_for() {
  waited=0
  until [ "$(poses || echo 0)" -ge "$1" ] 2>/dev/null; do
    sleep 1
    waited=$((waited + 1))
    [ $waited -lt 200 ] || { echo "no $1 poses after $waited s"; exit 1; }
  done
}
wait_for 4
./can_inject vcan0 20000040 0000000000000000 || { echo "cannot inject an error frame"; exit 1; }
/bin/ip link set vcan0 down
sleep 4
/bin/ip link set vcan0 up
wait_for 8
# The interface that comes back has another index: what was bound to the old one is bound to nothing.
/bin/ip link del dev vcan0
sleep 4
/bin/ip link add dev vcan0 type vcan && /bin/ip link set vcan0 up || exit 1
wait $run
status=$?
kill $simrig
wait $simrig 2>/dev/null
cat /tmp/exit.json
echo "plumbline run ended with $status"
[ $status -eq 0 ] || exit 1
./plumbline verify --db /tmp/run.db || exit 1
./plumbline export --db /tmp/run.db --run 1 --out /tmp/samples.csv || exit 1
grep -q '"recoveries": 0' /tmp/exit.json && { echo "nothing had to be recovered from"; exit 1; }
grep -a -q 'error frames' /tmp/run.db || { echo "the bus was not reported on"; exit 1; }
grep -a -q 'still plugged in' /tmp/run.db || { echo "the adapter was not missed"; exit 1; }
echo "real SocketCAN: losses, bus-off, a link that went down and an adapter that was unplugged were survived"
