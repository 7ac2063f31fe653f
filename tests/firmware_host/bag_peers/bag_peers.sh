#!/bin/sh
# A log's and a run's bags beside other readers and writers (bag_peers.mjs), a run's MCAP file as Foxglove reads it
# (foxglove_run.mjs).
# usage: bag_peers.sh SWIFTLET FETCHED_FOLDER LOG LAYOUT
set -eu
missing=
[ -d "$2/node_modules/@mcap" ] || missing='npm could not fetch the other readers'
for tool in sqlite3 lz4; do
  command -v $tool >/dev/null 2>&1 || missing="there is no $tool"
done
if [ -n "$missing" ]; then
  echo "SKIPPED: $missing; run with: toolchain/install.sh test, then toolchain/test.sh"
  exit 77
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$1" simulate --tracks --duration 5 --seed 7 --out "$work/flight" >"$work/log"
"$1" replay "$work/flight" --imu-rate --mesh-sequence --out "$work/run" >>"$work/log"
node "$2/bag_peers.mjs" "$1" "$3" "$work/bags" "$work/run"
"$1" replay "$3" --map --mesh-sequence --out "$work/mapped" >>"$work/log"
node "$2/foxglove_run.mjs" "$1" "$4" "$3" "$work/mapped" "$work/bags"
