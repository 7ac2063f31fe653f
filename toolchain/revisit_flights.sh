#!/bin/sh
# Flights of 60 to 90 s that come back to where they were, for the tables of loop closure: one on the motion of each
# of the eleven EuRoC sequences, some through twin_rooms (two identical rooms that are not the same place), and some
# that share a world, for kept maps: shared_mh01, shared_mh02 and shared_mh03, and so on.
# usage: toolchain/revisit_flights.sh [--list | --tracks] OUT [NAME...]
#   OUT       folder to write: OUT/NAME is an EuRoC folder with truth, for swiftlet replay
#   NAME...   only these; default all
#   --list    print name, seconds and what is flown; write nothing
#   --tracks  feature tracks in place of images (seconds in all; for replay --tracks)
# SWIFTLET_DATA  folder of recorded logs, for euroc_imu_gt_all (default ../shared/data, seen from the project's root)
# SWIFTLET       the program (default build/release/bin/swiftlet, seen from there too)
# THREADS        that render (default: all cores)
# Fixed seeds: the same bytes every time. What is complete is kept: a flight is written as OUT/NAME.part and renamed
# at its end, so a run that was stopped goes on where it was. All of them take an hour (5 pairs a second on two cores)
# and 4 GB. Exit code 0 when all are there, 1 when one failed, 2 wrong use.
set -eu
start=$PWD
cd "$(dirname "$0")/.."

# name, seed, seconds, sequence and seconds left out at its start (chosen so that the flight revisits: a tenth to a
# half of it is within 1 m and 30 degrees of where it was more than 20 s before, V2_01 excepted, which hardly revisits)
flights='mh01_60 101 60 MH_01_easy 90
mh02_70 102 70 MH_02_easy 80
mh03_90 103 90 MH_03_medium 25
mh04_75 104 75 MH_04_difficult 20
mh05_75 105 75 MH_05_difficult 30
v101_75 106 75 V1_01_easy 65
v102_75 107 75 V1_02_medium 5
v103_75 108 75 V1_03_difficult 15
v201_90 109 90 V2_01_easy 15
v202_60 110 60 V2_02_medium 25
v203_75 111 75 V2_03_difficult 30
twin_60 201 60 twin_rooms 0
twin_90 202 90 twin_rooms 0
shared_mh01 301 60 MH_01_easy 90
shared_mh02 302 60 MH_02_easy 80
shared_mh03 303 60 MH_03_medium 25
shared_v101 306 60 V1_01_easy 65
shared_v102 307 60 V1_02_medium 5
shared_v201 309 60 V2_01_easy 15
shared_v202 310 60 V2_02_medium 25'

usage() {
  sed -n '2,17s/^# \{0,1\}//p' "$0"
}

kind=images
case ${1:-} in
  --list)
    printf '%s\n' "$flights" | while read -r name _ seconds what _; do printf '%-8s %2d s  %s\n' "$name" "$seconds" "$what"; done
    exit 0
    ;;
  --tracks)
    kind=tracks
    shift
    ;;
esac
case ${1:-} in
  '' | -*)
    usage
    exit 2
    ;;
esac
case $1 in
  /*) out=$1 ;;
  *) out=$start/$1 ;;
esac
shift

swiftlet=${SWIFTLET:-build/release/bin/swiftlet}
data=${SWIFTLET_DATA:-../shared/data}/euroc_imu_gt_all
threads=${THREADS:-$(nproc)}
[ -x "$swiftlet" ] || {
  echo "$swiftlet is missing: build it, or name the program with SWIFTLET" >&2
  exit 2
}

fly() { # name seed seconds sequence skip
  case $4 in
    twin_rooms) motion='--world twin_rooms' ;;
    MH_*) motion="--world hall --motion $data/$4/groundtruth.csv.xz --motion-skip $5" ;;
    *) motion="--world room --motion $data/$4/groundtruth.csv.xz --motion-skip $5" ;;
  esac
  case $1 in
    shared_*)
      motion="$motion --world-seed 7"
      for other in "$data/${4%%_*}"_*/groundtruth.csv.xz; do motion="$motion --world-for $other"; done
      ;;
  esac
  case $kind in
    tracks) what=--tracks ;;
    *) what="--depth-every 0 --threads $threads" ;;
  esac
  rm -rf "$out/$1.part"
  # shellcheck disable=SC2086 # options, none with spaces
  "$swiftlet" simulate $motion $what --duration "$3" --seed "$2" --out "$out/$1.part" && mv "$out/$1.part" "$out/$1"
}

for name in "$@"; do
  printf '%s\n' "$flights" | grep -q "^$name " || {
    echo "no flight is named $name; --list names them" >&2
    exit 2
  }
done

mkdir -p "$out"
failed=0
# Not at the end of a pipe: `failed` must reach the exit code.
while read -r name seed seconds sequence skip; do
  case " $* " in
    '  ' | *" $name "*) ;;
    *) continue ;;
  esac
  if [ -d "$out/$name" ]; then
    echo "== $name is there"
    continue
  fi
  if [ "$sequence" != twin_rooms ] && [ ! -f "$data/$sequence/groundtruth.csv.xz" ]; then
    echo "== $name: $data/$sequence is missing (SWIFTLET_DATA)" >&2
    failed=1
    continue
  fi
  echo "== $name: $seconds s, $sequence"
  fly "$name" "$seed" "$seconds" "$sequence" "$skip" </dev/null || failed=1
done <<EOF
$flights
EOF
exit $failed
