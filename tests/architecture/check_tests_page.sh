#!/bin/sh
# Each test of a build folder stands in docs/tests.md: in which set it is, what it guards, what it costs.
# usage: check_tests_page.sh BUILD_FOLDER PAGE
set -eu
missing=$(cd "$1" && ctest -N | sed -n 's/^ *Test *#[0-9]*: //p' | while read -r name; do
  grep -q "\`$name\`" "$2" || echo "$name"
done)
if [ -n "$missing" ]; then
  printf '%s: not in %s: add it to the row of its set\n' "$missing" "$2" >&2
  exit 1
fi
