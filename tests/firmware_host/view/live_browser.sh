#!/bin/sh
# Opens the live view of a slowed-down replay in headless Chromium, which interrupts it when it has seen enough.
# usage: live_browser.sh SWIFTLET PAGE_FOLDER LOG [SCREENSHOT.png]
set -eu
swiftlet=$1
page=$2
log=$3
screenshot=${4:-}
. "$(dirname "$0")/../find_browser.sh"
find_browser "$page"

work=$(mktemp -d)
replay=
trap '[ -z "$replay" ] || kill "$replay" 2>/dev/null || true; rm -rf "$work"' EXIT
: >"$work/replay.log" # read before the replay's shell may have opened it
# Long enough for a browser on a busy machine, were it not interrupted.
"$swiftlet" replay "$log" --real-time --speed 0.04 --map --view 127.0.0.1:0 --out "$work/run" >"$work/replay.log" 2>&1 &
replay=$!
url=
for _ in $(seq 100); do
  url=$(sed -n 's/^live view: //p' "$work/replay.log")
  [ -z "$url" ] || break
  sleep 0.1
done
[ -n "$url" ] || { cat "$work/replay.log"; exit 1; }
if ! node "$page/check_live.mjs" "$browser" "$url" "$replay" $screenshot; then
  cat "$work/replay.log"
  exit 1
fi
wait "$replay" || true # interrupted
replay=
grep -q '"view": {' "$work/run/summary.json" || { echo "summary.json says nothing of the view"; exit 1; }
