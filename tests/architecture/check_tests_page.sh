#!/bin/sh
# Each test of a build folder stands in docs/tests.md: in which set it is, what it guards, what it costs.
# usage: check_tests_page.sh BUILD_FOLDER PAGE
set -eu
# From CTest's files: `ctest -N`, run by a test, would empty the log of the run that it is part of.
missing=$(find "$1" -name CTestTestfile.cmake -exec sed -nE 's/^add_test\((\[=\[)?([A-Za-z0-9_]+).*/\2/p' {} + | while read -r name; do
  grep -q "\`$name\`" "$2" || echo "$name"
done)
if [ -n "$missing" ]; then
  printf '%s: not in %s: add it to the row of its set\n' "$missing" "$2" >&2
  exit 1
fi
