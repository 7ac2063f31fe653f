#!/bin/sh
# Every fault of the timeline alone, then random combinations, each a flight of its own in the kernel sandbox; the
# checks of `swiftlet evaluate --hil` over each, as a table. By hand: some 30 to 70 s of a core a flight.
# usage: fault_campaign.sh PROGRAM LOG OUT [alone|COUNT] [SEED] [PART/PARTS]
#   LOG    EuRoC folder with calibration, 11 s and more
#   COUNT  combinations (50); `alone`: only the faults alone; SEED (1): the same faults for the same seed
#   PART   of several that share the work (1/1); flights already in OUT are not flown again
# Exit code: 0 when all flights pass all checks.
set -u
program=$1
log=$2
out=$3
count=${4:-50}
seed=${5:-1}
part=${6:-1/1}
here=$(dirname "$(realpath "$0")")
sandbox=$here/../../toolchain/kernel_sandbox/run.sh
seconds=10
mkdir -p "$out"
failed=0
number=0

# NAME LINK FAULTS...: lines of the timeline.
fly() {
  name=$1
  link=$2
  shift 2
  number=$((number + 1))
  [ $((number % ${part#*/})) -eq $((${part%/*} % ${part#*/})) ] || return
  printf '%s\n' "$@" >"$out/$name.csv"
  if [ ! -e "$out/$name/done" ]; then
    rm -rf "${out:?}/$name"
    mkdir "$out/$name"
    # shellcheck disable=SC2086 # the link's options are words
    SWIFTLET_SANDBOX_SHARE=$out SWIFTLET_SANDBOX_TIME=simulated SWIFTLET_SANDBOX_CAMERAS=loop \
      SWIFTLET_SANDBOX_MEMORY=1200M SWIFTLET_SANDBOX_TIMEOUT=400 \
      "$sandbox" sh "$here/guest_flight.sh" "$program" "$log" "$out/$name" $link nomesh \
      faults="$out/$name.csv" seconds=$seconds >"$out/$name.txt" 2>&1
    code=$?
    if [ $code -eq 77 ]; then
      cat "$out/$name.txt"
      exit 77
    fi
    [ $code -eq 124 ] || touch "$out/$name/done"
  fi
  if "$program" evaluate "$out/$name/flight" --hil "$out/$name/hil" --junit "$out/$name.xml" \
    >"$out/$name.checks" 2>&1; then
    verdict=passed
  else
    verdict=FAILED
    failed=$((failed + 1))
  fi
  printf '%-22s %-16s %s  %s\n' "$name" "$link" $verdict "$(echo "$@")"
  grep -E '^  (failed|worst)|^error' "$out/$name.checks"
}

# 31 bits, of a linear congruential generator: the same in every shell.
state=$seed
draw() {
  state=$(((state * 1103515245 + 12345) % 2147483648))
  drawn=$((state / 65536 % $1))
}

for fault in unplug stall garbage drop; do fly "imu_$fault" 'serial trigger' "4,imu,$fault,2.2"; done
for fault in unplug stall drop; do fly "can_$fault" can "4,imu,$fault,2.2"; done
for step in 0.25 -0.25 7200 -1000; do fly "imu_clock_step_$step" serial "4,imu,clock_step,0,$step"; done
fly can_clock_step can "4,imu,clock_step,0,0.25"
for fault in unplug stall drop dark freeze; do
  fly "camera0_$fault" 'serial trigger' "4,camera0,$fault,2.2"
  fly "camera1_$fault" 'can trigger' "4,camera1,$fault,2.2"
  fly "cameras_$fault" serial "4,camera0,$fault,2.2" "4,camera1,$fault,2.2"
done
for fault in drop glitch; do fly "trigger_$fault" 'serial trigger' "4,trigger,$fault,2.2"; done
fly trigger_none 'serial trigger' '4,trigger,drop,2.2,1'
fly cameras_long serial "2,camera0,dark,4.6" "2,camera1,dark,4.6"
fly imu_long serial "2,imu,stall,4.6"
fly all_unplug serial "3,imu,unplug,2.2" "3,camera0,unplug,2.2" "3,camera1,unplug,2.2"

[ "$count" = alone ] && count=0
i=0
while [ $i -lt "$count" ]; do
  i=$((i + 1))
  draw 4
  case $drawn in
    0) link='serial trigger' ;;
    1) link='can trigger' ;;
    2) link=serial ;;
    *) link=can ;;
  esac
  draw 3
  faults=$((drawn + 2))
  set --
  while [ $faults -gt 0 ]; do
    faults=$((faults - 1))
    case $link in
      *trigger) draw 17 ;;
      *) draw 15 ;;
    esac
    case $drawn in
      0) fault=imu,unplug ;;
      1) fault=imu,stall ;;
      2) fault=imu,garbage ;;
      3) fault=imu,drop ;;
      4) fault=imu,clock_step ;;
      5) fault=camera0,unplug ;;
      6) fault=camera0,stall ;;
      7) fault=camera0,drop ;;
      8) fault=camera0,dark ;;
      9) fault=camera0,freeze ;;
      10) fault=camera1,unplug ;;
      11) fault=camera1,stall ;;
      12) fault=camera1,drop ;;
      13) fault=camera1,dark ;;
      14) fault=camera1,freeze ;;
      15) fault=trigger,drop ;;
      *) fault=trigger,glitch ;;
    esac
    draw 20
    begin=$((25 + drawn)) # tenths of a second
    draw 24
    length=$((3 + drawn))
    set -- "$@" "$((begin / 10)).$((begin % 10)),$fault,$((length / 10)).$((length % 10))"
  done
  fly "random_$seed.$i" "$link" "$@"
done
echo "fault_campaign: $failed failed"
[ $failed -eq 0 ]
