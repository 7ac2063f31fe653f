#!/bin/sh
# Opens `swiftlet view` of a short run in headless Chromium: with its images, and where its log is gone.
# usage: playback_browser.sh SWIFTLET PAGE_FOLDER LOG [SCREENSHOT.png]
set -eu
swiftlet=$1
page=$2
log=$3
screenshot=${4:-}
. "$(dirname "$0")/../find_browser.sh"
find_browser "$page"

work=$(mktemp -d)
viewer=
trap '[ -z "$viewer" ] || kill "$viewer" 2>/dev/null || true; rm -rf "$work"' EXIT

# serve NAME ARGUMENTS...: sets url
serve() {
  name=$1
  shift
  : >"$work/$name.log" # read before the viewer's shell may have opened it
  "$swiftlet" view "$@" >"$work/$name.log" 2>&1 &
  viewer=$!
  url=
  for _ in $(seq 100); do
    url=$(sed -n 's/^view of .*: \(http.*\)$/\1/p' "$work/$name.log")
    [ -z "$url" ] || return 0
    sleep 0.1
  done
  cat "$work/$name.log"
  return 1
}

# SIGTERM ends it in order.
finish() {
  kill "$viewer"
  wait "$viewer"
  viewer=
}

cp -r "$log" "$work/log"
"$swiftlet" replay "$work/log" --set smoother.horizon=full --mesh-sequence --out "$work/run" >"$work/replay.log"
serve images "$work/run" 127.0.0.1:0
# There is nothing to follow: the pages of an earlier live view hold no answering threads.
node -e 'fetch(process.argv[1]).then((answer) => process.exit(answer.status === 503 ? 0 : 1))' "${url}stream"
node "$page/check_playback.mjs" "$browser" "$url" images $screenshot
finish
mv "$work/log" "$work/elsewhere"
serve none "$work/run" 127.0.0.1:0
grep -q "images: .*not there any more" "$work/none.log"
node "$page/check_playback.mjs" "$browser" "$url" none
finish
serve named "$work/run" 127.0.0.1:0 --log "$work/elsewhere"
node "$page/check_playback.mjs" "$browser" "$url" images
finish
