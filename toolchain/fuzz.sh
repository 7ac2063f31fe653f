#!/bin/sh
# Runs libFuzzer targets of build/asan from their kept corpus, as many at once as there are processors.
# usage: toolchain/fuzz.sh SECONDS [NAME...]   SECONDS each; NAMEs as tests/fuzz/fuzz_targets.cpp has them, default all
# What is found stays in build/asan/fuzzed. Ends with a line each; exit code 0 when nothing was found.
set -u
cd "$(dirname "$0")/.." || exit 2
if [ "${1:-}" = --one ]; then # seconds, program
  name=$(basename "$3")
  kept=tests/fuzz/corpus/${name#fuzz_}
  [ -d "$kept" ] || kept=''
  mkdir -p "build/asan/fuzzed/$name"
  # shellcheck disable=SC2086 # $kept may be empty
  "$3" -max_total_time="$2" -timeout=10 -rss_limit_mb=2048 -verbosity=0 -print_final_stats=1 \
    -artifact_prefix=build/asan/fuzzed/ "build/asan/fuzzed/$name" $kept >"build/asan/fuzzed/$name.log" 2>&1
  code=$?
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "build/asan/fuzzed/$name.log")
  if [ $code -eq 0 ]; then echo "$name: nothing found in ${runs:-?} runs, $2 s"; else
    cat "build/asan/fuzzed/$name.log"
    echo "$name: FOUND something, exit code $code"
  fi
  exit $((code != 0))
fi
seconds=${1:-}
case $seconds in
  '' | *[!0-9]*)
    sed -n '2,4s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
esac
shift
[ $# -gt 0 ] || set -- '*'
programs=$(for name in "$@"; do
  find build/asan/tests/fuzz -type f -perm -u+x -name "fuzz_$name" ! -name '*.*' ! -name fuzz_corpus
done | sort -u)
[ -n "$programs" ] || {
  echo 'no fuzzers: cmake --preset asan && cmake --build build/asan --target fuzzers'
  exit 1
}
mkdir -p build/asan/fuzzed
echo "$programs" | xargs -P "$(nproc)" -n 1 toolchain/fuzz.sh --one "$seconds"
