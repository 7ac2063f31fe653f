#!/bin/sh
# Makes the figures under docs/figures: drawings, and plots and pictures of runs of the built program on recorded logs.
# usage: toolchain/figures.sh [--out FOLDER] [NAME...]   default: all of them, into docs/figures
#        toolchain/figures.sh --list                      names of all
#        toolchain/figures.sh --check                     makes all anew in the work folder and compares their bytes
#        toolchain/figures.sh --measure [draws | latency | loop_selection]
#                                                         measures toolchain/figures/measured/*.csv anew
# SWIFTLET       the program (default build/release/bin/swiftlet, seen from the project's root)
# SWIFTLET_DATA  folder of recorded logs (default ../shared/data)
# FIGURES_WORK   where runs are kept (default build/figures); a run that is there is not made again
# Same program and logs, same bytes; not so the screenshot view.jpg, which shows a moment of a run in real time.
# Most of the time goes into two rendered flights. Needs packages_optional.txt; screenshots chromium.
# Exit code 0 when all are made, or equal; 1 when one differs or failed; 2 wrong use.
set -eu
case ${1:-} in
  -h | --help)
    sed -n '2,14s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
esac
# Debian's Python has the packages, whatever comes first in the path.
PYTHONDONTWRITEBYTECODE=1 exec /usr/bin/python3 "$(dirname "$0")/figures" "$@"
