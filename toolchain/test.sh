#!/bin/sh
# The tests, on a fresh Debian 12 too: the demo (12 minutes), then what guards correctness (20 to 25 on two processors).
# usage: toolchain/test.sh [--all | --minutes N]
#   --all        also the long and the sandbox's campaigns, the guides, sanitizers over all rooms, fuzzers: three hours
#   --minutes N  also sanitizers and fuzzers, each only if it is likely to end within N minutes of the start; what is
#                left out is listed at the end
# Sets are CTest labels; docs/building.md says which test is in which.
# The release build has ROS 2's topics (SWIFTLET_WITH_DDS, off by default) where Cyclone DDS is installed, and
# pipelines as cameras (SWIFTLET_WITH_GSTREAMER) where GStreamer is.
# SWIFTLET_DATA names the folder of recorded logs (default ../shared/data); without logs the tests
# that need them say so and skip. Ends with a table of steps and a count of tests; exit code 0 when
# all passed, 1 otherwise.
set -u
cd "$(dirname "$0")/.." || exit 2

all_sets=no
minutes=0
case ${1:-} in
  '') ;;
  --all) all_sets=yes ;;
  --minutes) minutes=${2:?how many} ;;
  *)
    sed -n '2,13s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
esac

fuzz_seconds=15              # each fuzzer
beyond='long|campaign|guide' # labels of what only --all runs
# What reads bytes of others.
parsers='drivers_bag drivers_calibration drivers_can drivers_image_decoder drivers_mavlink drivers_serial'
# What shares memory between threads, the threads of devices, autopilot and viewers, and the whole executor on a second
# of a log.
threads='added_node autopilot core distance follower late_labels live realtime supervisor threaded view'
usual_tests=1300             # s, builds and tests where the sanitizers take the minutes given below
tests_took=0
jobs=$(nproc)
began=$(date +%s)
left_out=''
steps='' # lines "seconds result step"
failed_steps=0
passed=0
failed=0
mkdir -p build

step() { # name, command...
  name=$1
  shift
  printf '\n==== %s\n' "$name"
  begin=$(date +%s)
  if "$@"; then result=ok; else
    result=FAILED
    failed_steps=$((failed_steps + 1))
  fi
  steps="$steps$(printf '%6d s  %-6s  %s' $(($(date +%s) - begin)) $result "$name")
"
  [ $result = ok ]
}

configure() { # preset, options...
  preset=$1
  shift
  cmake --preset "$preset" "$@" >"build/configure_$preset.log" 2>&1 || {
    cat "build/configure_$preset.log"
    return 1
  }
  grep -E '^-- (ROS|swiftlet|Optional)' "build/configure_$preset.log" || true
}

build() { # preset, build options...
  preset=$1
  shift
  cmake --build "build/$preset" "$@"
}

run_ctest() { # preset, ctest options...; adds to the counts
  preset=$1
  shift
  log=build/ctest_$preset.log
  # Tests take halves of processors (swiftlet_share in tests/CMakeLists.txt): two of those that mostly wait share one.
  halves=$((jobs > 1 ? 2 * jobs : 4))
  echo '{"version": {"major": 1, "minor": 0}, "local": [{"half_processors": [{"id": "all", "slots": '$halves'}]}]}' \
    >build/processors.json
  ctest --test-dir "build/$preset" --output-on-failure -j $halves --resource-spec-file "$PWD/build/processors.json" \
    "$@" 2>&1 | tee "$log"
  line=$(grep -E 'tests passed, [0-9]+ tests failed out of [0-9]+' "$log" | tail -1)
  bad=$(echo "$line" | sed -E 's/.* ([0-9]+) tests failed.*/\1/')
  all=$(echo "$line" | sed -E 's/.*out of ([0-9]+).*/\1/')
  if [ -z "$line" ]; then
    failed=$((failed + 1))
    return 1
  fi
  skips=$(grep -cE '^[[:space:]]*[0-9]+ - .* \(Skipped\)$' "$log")
  passed=$((passed + all - bad - skips))
  failed=$((failed + bad))
  [ "$bad" -eq 0 ]
}

counted() { # command...: one more test
  if "$@"; then passed=$((passed + 1)); else
    failed=$((failed + 1))
    return 1
  fi
}

accuracy() { # one more test; none on a machine without logs, which the table says itself
  build/release/tests/logs/accuracy_table --skip-without-logs
  code=$?
  [ $code -eq 77 ] || counted test $code -eq 0
}

in_time() { # name of what begins now, the minutes that it takes on two processors
  took=$(($(date +%s) - began))
  # A slow machine shows in what has been done until now.
  if [ $tests_took -eq 0 ]; then tests_took=$took; fi
  needs=$((60 * $2))
  if [ $tests_took -gt $usual_tests ]; then needs=$((needs * tests_took / usual_tests)); fi
  if [ $all_sets = yes ] || [ $((took + needs)) -lt $((60 * minutes)) ]; then return 0; fi
  if [ "$minutes" -gt 0 ]; then left_out="$left_out$1; "; fi
  return 1
}

cases() { # Catch2's own counts in ctest's log of the release build
  log=build/release/Testing/Temporary/LastTest.log
  [ -f $log ] || return 0
  sed -nE -e 's/.*All tests passed \(([0-9]+) assertions? in ([0-9]+) test cases?\).*/\1 \2/p' \
    -e 's/^test cases: +([0-9]+) .*/0 \1/p' -e 's/^assertions: +([0-9]+) .*/\1 0/p' $log |
    awk '{a += $1; c += $2} END {printf "release: %d test cases, %d assertions\n", c, a}'
}

# shellcheck disable=SC2086,SC2046 # lists of tests
sanitized() { # preset, the minutes that it takes, name, tests
  in_time "$3" "$2" || return 0
  step "configure $1" configure "$1" -DSWIFTLET_BUILD_TESTS=ON &&
    step "build $1" build "$1" --target $(echo $4 | sed 's/\([^ ]*\)/test_\1/g') &&
    step "$3" run_ctest "$1" -R "^($(echo $4 | tr ' ' '|'))\$" -LE "^($beyond)\$"
}

close() {
  printf '\n==== steps\n%s' "$steps"
  cases
  if [ -f build/ctest_release.log ]; then
    skipped=$(toolchain/skipped.sh build/release build/ctest_release.log)
    if [ -n "$skipped" ]; then printf 'SKIPPED, which counts as nothing:\n%s\n' "$skipped"; fi
  fi
  if [ -n "$left_out" ]; then echo "NOT RUN, out of time (toolchain/test.sh --all runs them): $left_out"; fi
  all=$((passed + failed))
  percent=0
  if [ $all -gt 0 ]; then percent=$((100 * passed / all)); fi
  if [ $failed_steps -gt 0 ]; then echo "$failed_steps steps failed"; fi
  echo "$percent% tests passed, $failed tests failed out of $all"
  [ $failed_steps -eq 0 ] && [ $failed -eq 0 ]
  exit
}

step "packages" toolchain/install.sh test optional || close
step "demo: simulate, replay, evaluate" counted toolchain/demo.sh
# The demo has built what a user gets by default; this adds a few files to it and links the program again.
dds=OFF
if dpkg-query -W -f='${db:Status-Abbrev}' cyclonedds-dev cyclonedds-tools 2>/dev/null | grep -q '^ii.ii'; then dds=ON; fi
# A build tree of before the packages keeps its default.
gstreamer=OFF
if pkg-config --exists gstreamer-app-1.0 gstreamer-video-1.0 2>/dev/null; then gstreamer=ON; fi
step "configure release" configure release -DSWIFTLET_BUILD_TESTS=ON -DSWIFTLET_WITH_DDS=$dds \
  -DSWIFTLET_WITH_GSTREAMER=$gstreamer || close
step "build release with tests" build release || close
step "layout of the sources" counted toolchain/lint.sh format
# The accuracy table is run by itself, so that it is printed when it passes too.
step "tests" run_ctest release -E '^accuracy_table$' -LE "^($beyond)\$"
step "accuracy of all logs found" accuracy

if [ $all_sets = yes ]; then
  step "programs run by hand" build release --target by_hand
  step "long statistics, the sandbox's campaign, guides" run_ctest release -L "^($beyond)\$"
fi
# Short lists first: what is left of half an hour is enough for them.
if [ $all_sets = no ]; then
  sanitized tsan 3 "carriers and distance field under the thread sanitizer" 'core distance'
  sanitized asan 5 "parsers under address and undefined sanitizers" "$parsers"
fi
sanitized tsan 15 "threads under the thread sanitizer" "$threads"
in_time "all rooms under address and undefined sanitizers, fuzzers" 30 &&
  step "configure with sanitizers" configure asan -DSWIFTLET_BUILD_TESTS=ON &&
  step "build with sanitizers" build asan && {
    step "all rooms under address and undefined sanitizers" run_ctest asan -LE "^($beyond)\$"
    step "fuzzers" counted toolchain/fuzz.sh $fuzz_seconds
  }
close
