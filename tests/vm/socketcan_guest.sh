# Runs inside the virtual machine, in /test, with busybox sh. /bin/ip is the real one.
/bin/ip link add dev vcan0 type vcan && /bin/ip link set vcan0 up || exit 1

./plumbline-simrig --world white.toml --modbus tcp:127.0.0.1:1502 --can can:vcan0 --speed 4 --seed 7 \
  --ready-file /tmp/ready.toml &
simrig=$!
waited=0
until [ -f /tmp/ready.toml ]; do
  sleep 1
  waited=$((waited + 1))
  [ $waited -lt 30 ] || { echo "plumbline-simrig did not get ready"; exit 1; }
done
cat /tmp/ready.toml

./plumbline run --config rig.toml --serial VM-1 --db /tmp/run.db --out /tmp/out
status=$?
kill $simrig
wait $simrig 2>/dev/null

echo "plumbline run ended with $status"
[ $status -eq 0 ] || exit 1
for file in result.json certificate.html certificate.pdf certificate.xml evaluation.json; do
  [ -s /tmp/out/$file ] || { echo "$file is missing"; exit 1; }
done
grep -q '"poses": 36' /tmp/out/result.json || { echo "result.json does not hold 36 poses"; exit 1; }

# Real error handling of the interface: a bus that is not there is one clear line and exit code 3.
sed 's/vcan0/vcan9/' rig.toml >absent.toml
./plumbline run --config absent.toml --serial VM-1 --db /tmp/absent.db --out /tmp/absent 2>/tmp/message
[ $? -eq 3 ] || { echo "an absent interface must end with exit code 3"; exit 1; }
cat /tmp/message
grep -q 'vcan9' /tmp/message || { echo "the message must name the interface"; exit 1; }
echo "real SocketCAN: simrig, vcan, acquisition and certificate work"
