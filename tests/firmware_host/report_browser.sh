#!/bin/sh
# Opens reports of a short log in headless Chromium: one run, and two beside each other.
# usage: report_browser.sh SWIFTLET PAGE_FOLDER LOG
set -eu
swiftlet=$1
page=$2
log=$3
. "$(dirname "$0")/find_browser.sh"
find_browser "$page"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$swiftlet" replay "$log" --set smoother.horizon=full --out "$work/stereo" >"$work/replay.log"
"$swiftlet" replay "$log" --mono --imu-rate --out "$work/mono" >>"$work/replay.log"
"$swiftlet" report "$work/stereo" --out "$work/one.html"
"$swiftlet" report "$work/stereo" "$work/mono" --out "$work/two.html"
"$swiftlet" report "$work/stereo" --no-images --out "$work/bare.html"
grep -q '"playback":' "$work/one.html"
if grep -q '"playback":' "$work/bare.html"; then
  echo "--no-images leaves images in"
  exit 1
fi
# What is missing is said on the page, and the rest of it works.
rm "$work/mono/summary.json"
"$swiftlet" report "$work/mono" --out "$work/damaged.html" 2>"$work/notes"
grep -q "summary.json: is missing" "$work/notes"
printf x | dd of="$work/stereo/keyframes.swk" bs=1 seek=5000 conv=notrunc 2>/dev/null
"$swiftlet" report "$work/stereo" --out "$work/keyframes.html" 2>"$work/notes"
grep -q "keyframes.swk: damaged at byte" "$work/notes"
grep -q '"file":"keyframes.swk"' "$work/keyframes.html"
# A log that cannot be reached takes its truth and images along, and nothing else.
ln -s loop "$work/loop"
sed -i "s|\"log\": \".*\"|\"log\": \"$work/loop\"|" "$work/stereo/summary.json"
"$swiftlet" report "$work/stereo" --out "$work/unreachable.html" 2>"$work/notes"
grep -q "truth: .*$work/loop" "$work/notes"
# One browser for all: its start is what takes long.
node "$page/check_page.mjs" "$browser" "$work/one.html" "$work/two.html" "$work/damaged.html"
