#!/bin/sh
# Format and lint the project's own files.
# usage: toolchain/lint.sh [format | tidy] [FILE...]
#   format  clang-format: layout only, seconds
#   tidy    clang-tidy: naming and defects, minutes
#   (nothing) both; FILE... limits either to these files
set -eu
cd "$(dirname "$0")/.."

what=both
case ${1:-} in
  format | tidy)
    what=$1
    shift
    ;;
  -h | --help)
    sed -n '2,6s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
esac

rooms='estimator mesher mapping drivers firmware_host tests'
# shellcheck disable=SC2086 # a list of folders
files_of() { find $rooms -type f \( "$@" \) | sort; }

if [ "$what" != tidy ]; then
  if [ $# -gt 0 ]; then files=$*; else files=$(files_of -name '*.hpp' -o -name '*.cpp'); fi
  echo "lint: clang-format on $(echo "$files" | wc -w) files"
  # shellcheck disable=SC2086 # a list of file names without spaces
  clang-format --dry-run -Werror $files
fi

if [ "$what" != format ]; then
  # A configuration of its own: each file alone, with what it includes itself.
  cmake -S . -B build/lint -G Ninja -DCMAKE_BUILD_TYPE=Release -DSWIFTLET_JOINED_UNITS=OFF \
    -DSWIFTLET_PRECOMPILED_HEADERS=OFF >build/configure_lint.log || exit 2
  database=build/lint/compile_commands.json
  if [ $# -gt 0 ]; then files=$*; else files=$(files_of -name '*.cpp'); fi
  # Only what this configuration compiles can be parsed.
  known=''
  for file in $files; do
    if grep -q "\"file\": \"[^\"]*/$file\"" $database; then known="$known $file"; fi
  done
  echo "lint: clang-tidy on $(echo "$known" | wc -w) files"
  # GCC's own warning options stand in the compile commands; clang need not know them.
  echo "$known" | tr ' ' '\n' | sed '/^$/d' |
    xargs -P "$(nproc)" -n 1 clang-tidy -p build/lint --quiet --extra-arg=-Wno-unknown-warning-option \
      --extra-arg=-Wno-unused-command-line-argument
fi
echo "lint: clean"
