#!/bin/sh
# Inside the kernel sandbox, cameras looping: plays a log out through the kernel's devices and flies on them with the
# unmodified program.
# usage: guest_flight.sh PROGRAM LOG OUT [serial|can] [trigger] [faults=FILE] [seconds=N] [protocol=NAME] [nomesh]
#                        [hangup] [flyer=PROGRAM] [realtime] [autopilot|onelink] [fly=OPTION...]
#                        [disk=none|readonly|full|gone]
#   PROGRAM  swiftlet
#   LOG      EuRoC folder with calibration
#   OUT      folder: vehicle.yaml, hil/, flight/, what each program said
#   hangup   the flight's terminal closes: SIGHUP after 3 s
#   flyer    flies in place of PROGRAM
#   realtime priorities and locked memory as on a vehicle
#   autopilot  an autopilot's port that nobody listens at
#   onelink  the IMU by MAVLink, and the autopilot told on the same port
#   fly      options of `swiftlet fly`
#   disk     of the flight, which records: no folder to be had; a read-only one; one of 40 MB; one that goes after 3 s
# Exit code: 0 when both programs ended well.
set -u
program=$1
log=$2
out=$3
shift 3
link=serial
trigger=no
faults=''
seconds=0
protocol=bridge
mesh=true
hangup=no
flyer=$program
realtime=false
autopilot=''
onelink=no
fly_options=''
disk=''
for option in "$@"; do
  case $option in
    serial | can) link=$option ;;
    trigger) trigger=yes ;;
    faults=*) faults=${option#faults=} ;;
    seconds=*) seconds=${option#seconds=} ;;
    nomesh) mesh=false ;;
    hangup) hangup=yes ;;
    fly=*) fly_options="$fly_options ${option#fly=}" ;;
    flyer=*) flyer=${option#flyer=} ;;
    realtime) realtime=true ;;
    autopilot) autopilot=udp:127.0.0.1:14550 ;;
    onelink) onelink=yes ;;
    disk=*) disk=${option#disk=} ;;
    protocol=*) protocol=${option#protocol=} ;;
    *)
      echo "guest_flight: what is $option?" >&2
      exit 2
      ;;
  esac
done
mkdir -p "$out"
imu=/run/imu
if [ "$link" = can ]; then
  imu=$SANDBOX_CAN
  protocol=dronecan
fi
if [ $onelink = yes ]; then
  protocol=mavlink
  autopilot=$imu
fi
cat >"$out/vehicle.yaml" <<END
vehicle:
  calibration: '$log'
imu_link:
  device: '$imu'
  protocol: $protocol
cameras:
  device0: '$SANDBOX_CAMERA0'
  device1: '$SANDBOX_CAMERA1'
  rate_hz: 20
hil:
  output0: '$SANDBOX_OUTPUT0'
  output1: '$SANDBOX_OUTPUT1'
realtime:
  enabled: $realtime
autopilot:
  device: '$autopilot'
mesh:
  enabled: $mesh
END
if [ $trigger = yes ]; then
  cat >>"$out/vehicle.yaml" <<END
trigger:
  chip: '$SANDBOX_GPIO'
  line: 3
END
  sed -i "s|^  output1:.*|&\n  trigger_pull: '$SANDBOX_GPIO_SYSFS/sim_gpio3/pull'|" "$out/vehicle.yaml"
fi

"$program" hil "$log" --settings "$out/vehicle.yaml" --out "$out/hil" --seconds "$seconds" --lead 3 \
  ${faults:+--faults "$faults"} >"$out/hil.txt" 2>&1 &
hil=$!
# A serial port is there when its name is.
for _ in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do
  if [ "$link" = can ] || [ -e "$imu" ]; then break; fi
  sleep 0.1
done
set -- --imu-rate --out "$out/flight"
if [ -n "$disk" ]; then
  place=/run/flight_disk
  mkdir -p $place
  case $disk in
    none) echo 'a file in the way' >$place/file && place=$place/file ;;
    readonly) mount -t tmpfs -o ro tmpfs $place || exit 125 ;;
    full | gone) mount -t tmpfs -o size=40M tmpfs $place || exit 125 ;;
    *) exit 2 ;;
  esac
  set -- --imu-rate --set flights.folder=$place/flights
  [ "$disk" = gone ] || set -- "$@" --record
fi
# shellcheck disable=SC2086 # options without blanks
"$flyer" fly $fly_options --settings "$out/vehicle.yaml" "$@" >"$out/fly.txt" 2>&1 &
fly=$!
if [ "$disk" = gone ]; then
  sleep 3
  umount -l $place || exit 125
fi
if [ $hangup = yes ]; then
  sleep 3
  kill -HUP $fly
fi
wait $hil
played=$?
kill -INT $fly
wait $fly
flown=$?
if [ "$disk" = full ]; then ls -l $place/flights/*/ $place/flights/*/recording >"$out/files.txt"; fi
# With faults the verdict may be that most of the flight was not good; no other error is accepted.
if [ -n "$faults" ] && [ $flown -eq 1 ] && [ "$(grep -c '^error: ' "$out/fly.txt")" -eq 1 ] &&
  grep -q '^error: the health was good for only ' "$out/fly.txt"; then
  flown=0
fi
echo "guest_flight: hil $played, fly $flown"
[ $played -eq 0 ] && [ $flown -eq 0 ]
