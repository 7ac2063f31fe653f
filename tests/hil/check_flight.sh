#!/bin/sh
# Flights on a hardware-in-the-loop replay in the kernel sandbox, by simulated time.
# usage: check_flight.sh PROGRAM accuracy|faults|alone|disk|trap SECONDS [LINK...]
#   accuracy  the odometry's ATE is within the larger of 20 % and 3 mm of a plain replay's
#   faults    a timeline of several faults, flown twice: every check passes, and both flights list the same events
#   alone     each fault of each device in a flight of its own (fault_campaign.sh)
#   disk      a disk that is not there, read-only, full, or goes in flight costs files: the flight ends in order,
#             says so and has its poses
#   trap      flyer=PROGRAM is trapped_program: no thread of the flight did what it must not, with faults and without
#   LINK      of guest_flight.sh: serial, can, trigger, protocol=NAME, hangup, flyer=PROGRAM, autopilot, onelink
# Needs euroc_mh01_20s in the folder SWIFTLET_DATA, or in ../shared/data beside the project. Exit code 77: skipped.
set -u
program=$1
what=$2
seconds=$3
shift 3
here=$(dirname "$(realpath "$0")")
root=$here/../..
log=${SWIFTLET_DATA:-$root/../shared/data}/euroc_mh01_20s
if [ ! -d "$log" ]; then
  echo "SKIPPED: no $log; run with: SWIFTLET_DATA=FOLDER toolchain/test.sh --all"
  exit 77
fi
log=$(realpath "$log")
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# NAME OPTION... The limit is against a flight that hangs: one takes 20 to 160 s, as system calls cost on the machine.
fly() {
  name=$1
  shift
  SWIFTLET_SANDBOX_SHARE=$out SWIFTLET_SANDBOX_TIME=simulated SWIFTLET_SANDBOX_CAMERAS=loop \
    SWIFTLET_SANDBOX_MEMORY=1500M SWIFTLET_SANDBOX_TIMEOUT=500 "$root/toolchain/kernel_sandbox/run.sh" \
    sh "$here/guest_flight.sh" "$program" "$log" "$out/$name" seconds="$seconds" "$@"
  code=$?
  [ $code -eq 77 ] && exit 77
  [ $code -eq 0 ] && return
  cat "$out/$name/hil.txt" "$out/$name/fly.txt"
  exit 1
}

# RUN TRUTH OPTION...: the odometry's ATE in m.
ate() {
  "$program" evaluate "$1" --truth "$2" --json | sed -n '/"odometry.tum"/,$p' |
    sed -n 's/.*"rmse": \([0-9.e-]*\),.*/\1/p' | head -n 1
}

# NAME: what events.log says of devices, a device after the other, without figures.
events() {
  grep -E ' remark (IMU|camera|trigger) ?[01]? ?\(' "$out/$1/flight/events.log" |
    sed -e 's/^[0-9.]* remark //' -e 's/): \([a-z ]*\).*/): \1/' | sort -s -t '(' -k 1,1
}

case $what in
  accuracy)
    fly flight nomesh "$@"
    case " $* " in
      *' hangup '*) grep 'terminal closed (SIGHUP)' "$out/flight/flight/events.log" || exit 1 ;;
    esac
    case " $* " in
      *' onelink '*)
        # All but the last second's of 40 poses a second, and nothing that found no room.
        summary=$out/flight/flight/summary.json
        sent=$(sed -n 's/.*"sent_for_autopilot": \([0-9]*\).*/\1/p' "$summary")
        echo "check_flight: $sent messages sent for the autopilot on the IMU's link"
        [ "${sent:-0}" -ge $(((seconds - 1) * 40)) ] || exit 1
        [ "$(grep -c '"writes_refused": 0' "$summary")" -eq 2 ] || exit 1
        ;;
    esac
    # The supervisor gives sensors 10 s for their first message.
    if grep 'since the start' "$out/flight/flight/events.log"; then exit 1; fi
    "$program" evaluate "$out/flight/flight" --hil "$out/flight/hil" || exit 1
    "$program" replay "$log" --out "$out/plain" --set mesh.enabled=false >"$out/plain.txt" 2>&1 || {
      cat "$out/plain.txt"
      exit 1
    }
    # The plain poses of what was played.
    awk -v seconds="$seconds" 'NR == 1 { first = $1 } $1 - first <= seconds' "$out/plain/odometry.tum" \
      >"$out/plain.tum"
    "$program" evaluate "$out/plain.tum" --truth "$log" --json >"$out/plain.json" || exit 1
    plain=$(sed -n 's/.*"rmse": \([0-9.e-]*\),.*/\1/p' "$out/plain.json" | head -n 1)
    flown=$(ate "$out/flight/flight" "$out/flight/hil/truth.tum")
    echo "check_flight: ATE $flown m in flight, $plain m in a plain replay"
    awk -v flown="$flown" -v plain="$plain" 'BEGIN {
      most = plain * 0.2 > 0.003 ? plain * 0.2 : 0.003
      exit !(flown > 0 && plain > 0 && flown - plain <= most && plain - flown <= most)
    }'
    ;;
  faults)
    printf '%s\n' '2.0,imu,unplug,0.8' '2.5,camera1,stall,1.5' '3.0,imu,clock_step,0,-0.25' \
      '3.2,camera0,dark,0.7' '4.0,imu,drop,0.4,0.3' >"$out/faults.csv"
    for name in first second; do fly $name nomesh "$@" faults="$out/faults.csv"; done
    "$program" evaluate "$out/first/flight" --hil "$out/first/hil" --junit "$out/first.xml" || exit 1
    grep -q '<testcase classname="hil" name="reported with a remedy within 3 s of its end: ' "$out/first.xml" || exit 1
    cmp "$out/first/hil/faults.csv" "$out/second/hil/faults.csv" || exit 1
    events first >"$out/first.txt"
    events second >"$out/second.txt"
    cat "$out/first.txt"
    [ -s "$out/first.txt" ] && diff "$out/first.txt" "$out/second.txt"
    ;;
  trap)
    printf '%s\n' '2.0,imu,unplug,0.8' '3.5,camera0,stall,1.5' '4.0,imu,clock_step,0,-0.25' \
      '4.6,camera1,unplug,0.8' >"$out/faults.csv"
    fly flight realtime "$@"
    sed -n '/^thread  /,$p' "$out/flight/fly.txt"
    # A stream that stalls for a second is restarted.
    SWIFTLET_TRAP_REOPENS='camera0 camera1'
    export SWIFTLET_TRAP_REOPENS
    fly faults realtime "$@" faults="$out/faults.csv"
    sed -n '/^thread  /,$p' "$out/faults/fly.txt"
    events faults
    grep -q '^imu  .*[0-9]' "$out/faults/fly.txt"
    ;;
  alone)
    "$here/fault_campaign.sh" "$program" "$log" "$out" alone
    ;;
  disk)
    for disk in none readonly full gone; do
      fly $disk "$@" disk=$disk
      said=$out/$disk/fly.txt
      echo "check_flight: disk $disk: $(grep -c '(the run continues without it)' "$said") losses, the first:"
      grep -m 1 '(the run continues without it)' "$said" || { cat "$said"; exit 1; }
      grep -q 'warning: files of this flight are missing or incomplete' "$said" || { cat "$said"; exit 1; }
      poses=$(sed -n 's/.* keyframes, \([0-9]*\) poses.*/\1/p' "$said")
      [ "${poses:-0}" -ge $((seconds * 15)) ] || { cat "$said"; exit 1; }
    done
    ;;
  *)
    echo "check_flight: what is $what?" >&2
    exit 2
    ;;
esac
