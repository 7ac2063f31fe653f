#!/bin/sh
# What the last CTest run of a build folder skipped: test, reason, and the command that makes it run, a line each.
# usage: toolchain/skipped.sh [BUILD_FOLDER [CTEST_OUTPUT]]   default build/release
#   CTEST_OUTPUT   what ctest printed: names tests that were skipped without a reason, too
# Tests say so themselves: a line "SKIPPED: [WHAT: ]REASON; run with: COMMAND", and exit code 77.
set -eu
build=${1:-$(dirname "$0")/../build/release}
log=$build/Testing/Temporary/LastTest.log
if [ ! -f "$log" ]; then
  echo "skipped.sh: no $log: run ctest first" >&2
  exit 2
fi
awk '
  / Testing: / { test = $NF }
  /^SKIPPED: / {
    sub(/\r$/, "")
    line = test ": " substr($0, 10)
    if (!(line in seen)) print line
    seen[line] = told[test] = 1
  }
  /^[ \t]+[0-9]+ - .* \(Skipped\)$/ && !($3 in told) { print $3 ": gives no reason; see " ARGV[1] }
' "$log" ${2:+"$2"}
