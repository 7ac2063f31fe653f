#!/bin/bash
# Follows a guide whose commands want cameras and an IMU, in the kernel sandbox with looping cameras. The devices have
# the names that the guide gives them; before each of its blocks `swiftlet hil` plays a log to them anew: the short one,
# or, of the guide that begins with a bare rig, what this rig would see at rest, in front of the board and in flight.
# usage: with_devices.sh PAGE ROOT PROGRAM
set -eu
script=$(realpath "$0")
page=$(realpath "$1")
root=$(realpath "$2")
program=$(realpath "$3")
log=$root/tests/data/euroc_mh01_4s

if [ "${SWIFTLET_SANDBOX:-}" != 1 ]; then
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
  cd "$folder"
  export SWIFTLET_SANDBOX_CAMERAS=loop SWIFTLET_SANDBOX_MEMORY=1500M
  if [ "$(basename "$page")" = bare_rig_to_flight.md ]; then
    "$program" calibrate target --out bench_board.pdf
    "$program" simulate --board bench_board.yaml --duration 60 --calibrated --out bench_session
    "$program" simulate --rest-at-start 34 --duration 36 --depth-every 0 --out bench_rest
    "$program" simulate --rest-at-start 3 --duration 24 --depth-every 0 --out bench_flight
  fi
  "$root/toolchain/kernel_sandbox/run.sh" "$script" "$page" "$root" "$program"
  exit
fi

named() { # key: what the guide's vehicle.yaml calls a device
  sed -n "/^# vehicle.yaml/,/^\`\`\`/s/^ *$1: *\([^ ]*\).*/\1/p" "$page" | head -n 1
}

if [ "${4:-}" = play ]; then # from follow_guide.py
  if [ -e "$TMPDIR/bench_flight" ]; then
    case $GUIDE_COMMANDS in
      *imu-noise*) log=$TMPDIR/bench_rest ;;
      *'record '*--calibrate*) log=$TMPDIR/bench_session ;;
      *) log=$TMPDIR/bench_flight ;;
    esac
  elif [ ! -e rig ]; then
    ln -s "$log" rig
  fi
  if [ -e bench.pid ]; then kill -INT "$(cat bench.pid)" 2>/dev/null || true; fi
  imu=$(named device)
  mkdir -p "$(dirname "$imu")"
  cat >bench.yaml <<END
vehicle:
  calibration: '$log'
imu_link:
  device: '$imu'
  protocol: $(named protocol)
hil:
  output0: '$SANDBOX_OUTPUT0'
  output1: '$SANDBOX_OUTPUT1'
END
  line=$(named line)
  if [ -n "$line" ]; then
    cat >>bench.yaml <<END
  trigger_pull: '$SANDBOX_GPIO_SYSFS/sim_gpio$line/pull'
trigger:
  chip: '$(named chip)'
  line: $line
END
  fi
  "$program" hil "$log" --settings bench.yaml --out bench --lead 0 --patience 60 >bench.txt 2>&1 &
  echo $! >bench.pid
  for _ in {1..50}; do
    if [ -e "$imu" ]; then exit; fi
    sleep 0.1
  done
  cat bench.txt >&2
  exit 1
fi

for pair in "device0 $SANDBOX_CAMERA0" "device1 $SANDBOX_CAMERA1"; do
  name=$(named "${pair% *}")
  if [ ! -e "$name" ]; then
    mkdir -p "$(dirname "$name")"
    ln -s "${pair#* }" "$name"
  fi
done
export TMPDIR=$PWD
"$root/tests/guides/follow_guide.py" "$page" "$root" "$program" --before "'$script' '$page' '$root' '$program' play" \
  --short '--seconds 90' '--seconds 3' --short '--seconds 30' '--seconds 3' --short '--seconds 7200' '--seconds 30' \
  --interrupt-after "$([ -e bench_flight ] && echo 22 || echo 5)"
