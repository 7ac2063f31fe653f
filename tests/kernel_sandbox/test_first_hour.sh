#!/bin/bash
# A user's first hour with devices, in the kernel sandbox with looping cameras: doctor with all of them, record, replay
# of what was recorded, doctor and record with one camera that is not there. The devices are played by hil.
# usage: test_first_hour.sh PROGRAM LOG    PROGRAM: swiftlet; LOG: an EuRoC folder of some seconds
set -u
program=$(realpath "$1")
log=$(realpath "$2")
script=$(realpath "$0")
sandbox=$(dirname "$script")/../../toolchain/kernel_sandbox/run.sh

if [ "${SWIFTLET_SANDBOX:-}" != 1 ]; then
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
  cd "$folder" || exit 1
  export SWIFTLET_SANDBOX_CAMERAS=loop SWIFTLET_SANDBOX_MEMORY=1500M
  "$sandbox" "$script" "$program" "$log"
  exit
fi

. "$(dirname "$0")/checks.sh"

play() { # seconds of the log; plays to whom opens the IMU, until the log's end
  "$program" hil "$log" --settings vehicle.yaml --out "hil_$1" --seconds "$1" --lead 0 --patience 60 >hil.txt 2>&1 &
  player=$!
  for _ in {1..100}; do
    [ -e /run/imu ] && return
    sleep 0.1
  done
}

cat >vehicle.yaml <<END
vehicle:
  calibration: '$log'
imu_link:
  device: /run/imu
cameras:
  device0: '$SANDBOX_CAMERA0'
  device1: '$SANDBOX_CAMERA1'
  rate_hz: 20
hil:
  output0: '$SANDBOX_OUTPUT0'
  output1: '$SANDBOX_OUTPUT1'
realtime:
  enabled: false
END
sed 's|device1: .*|device1: /dev/video7|' vehicle.yaml >one_camera.yaml

"$program" doctor >nothing.txt 2>&1
check "doctor without settings: not ready" test $? = 1
check "doctor lists the cameras with their formats" grep -q "$SANDBOX_CAMERA0 vivid.*GREY" nothing.txt
check "doctor names the formats that work" grep -qE "$SANDBOX_CAMERA0 vivid.*YUYV, .*NV12.*GREY.*; not: .*RGBP" nothing.txt
check "doctor lists the CAN interface" grep -q "$SANDBOX_CAN: up" nothing.txt
check "doctor lists the GPIO chip" grep -q "$SANDBOX_GPIO" nothing.txt

play 4
"$program" doctor --settings vehicle.yaml --seconds 2 >ready.txt 2>&1
check "doctor with all devices: ready" test $? = 0
check "doctor says to fly" grep -q 'swiftlet fly' ready.txt
for line in "IMU rate *good" "camera 0 rate *good" "camera 1 rate *good" "camera 0 frames *good" "stereo pairs *good"; do
  check "doctor: $line" grep -qE "$line" ready.txt
done
wait $player

play 4
"$program" record --settings vehicle.yaml --seconds 3 --out recorded >record.txt 2>&1
check "record" test $? = 0
wait $player
check "the recording has images" test "$(find recorded/mav0/cam1/data -name '*.png' | wc -l)" -ge 40
"$program" replay recorded --out replayed >replay.txt 2>&1
check "replay of the recording" test $? = 0
check "replay gives poses" test "$(wc -l <replayed/odometry.tum)" -ge 30
"$program" record --settings vehicle.yaml --seconds 1 --out recorded >again.txt 2>&1
check "nothing is recorded without its devices" test $? = 1
check "the IMU that is gone is named" grep -q 'IMU (/run/imu, bridge): not there' again.txt

play 2
"$program" doctor --settings one_camera.yaml --seconds 1 >one.txt 2>&1
check "doctor with one camera missing: not ready" test $? = 1
check "doctor says which and what to do" grep -q 'camera 1 (/dev/video7): not there.*connect it, or correct its name' one.txt
check "doctor says what next" grep -q 'fix what is poor' one.txt
kill -INT $player
wait $player

if [ $failed -gt 0 ]; then tail -n 60 ready.txt record.txt replay.txt one.txt hil.txt; fi
[ $failed -eq 0 ]
