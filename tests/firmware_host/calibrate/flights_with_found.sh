#!/bin/bash
# Flights of random rigs with the calibration that was found, beside the same with the true one.
# usage: flights_with_found.sh PROGRAM CAMPAIGN RESULTS FIRST LAST FOLDER [--corners]
#   CAMPAIGN  imu_camera_campaign: calibrates the rigs FIRST to LAST that FOLDER does not have, from rendered images
#             or, with --corners, from simulated corners
#   RESULTS   its CSV; FLIGHTS, beside it, gets a line a rig: seed, position error [m] with the found and the true one
# Resumable. Exit code 0: with what was found the error is at most 1.1 times as large, as geometric mean over the rigs:
# one flight is a matter of chance.
set -eu
program=$1 campaign=$2 results=$3 first=$4 last=$5 folder=$6 corners=${7:-}
flights=${results%.csv}_flights.csv
mkdir -p "$folder"
# shellcheck disable=SC2086 # nothing, or one word
"$campaign" "$results" "$first" "$last" "$folder" $corners
touch "$flights"

error_of() { # log, calibration
  "$program" replay "$1" --calibration "$2" --out "$folder/run" >"$folder/run.txt" 2>&1 || return 1
  python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["accuracy"]["odometry"]["all"]["se3"]["ate_m"]["rmse"])' \
    "$folder/run/summary.json"
}

for seed in $(seq "$first" "$last"); do
  if grep -q "^$seed," "$flights"; then continue; fi
  rig=random_pinhole
  if [ $((seed % 2)) -eq 1 ]; then rig=random_fisheye; fi
  "$program" simulate --rig $rig --rig-seed "$seed" --seed "$seed" --duration 20 --depth-every 0 --out "$folder/flight" \
    >"$folder/flight.txt"
  found=$(error_of "$folder/flight" "$folder/rig_$seed/found")
  true=$(error_of "$folder/flight" "$folder/rig_$seed/true")
  echo "$seed,$found,$true" >>"$flights"
  rm -rf "$folder/flight" "$folder/run"
done
awk -F, -v first="$first" -v last="$last" '
  $1 >= first && $1 <= last { ratio = $2 / $3; print $1 ": " $2 " m, true calibration " $3 " m, " ratio; sum += log(ratio); n++
    if (ratio > most) most = ratio }
  END { mean = exp(sum / n); print n " rigs: " mean " times on average, at most " most; exit mean <= 1.1 ? 0 : 1 }' "$flights"
