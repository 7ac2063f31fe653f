#!/bin/sh
# From a fresh Debian 12 to a first flight: installs the packages that are needed, builds, simulates
# a flight, replays it and prints the summary.
# usage: toolchain/demo.sh [SECONDS]   length of the flight, default 15
# Writes build/release and build/demo only.
set -eu
cd "$(dirname "$0")/.."
seconds=${1:-15}

say() { printf '\n== %s\n' "$*"; }

say "packages"
toolchain/install.sh

say "build"
# A first build leaves the tests out (they need more packages); an existing one stays as it is.
if [ -f build/release/CMakeCache.txt ]; then
  cmake --preset release >build/configure.log || { cat build/configure.log; exit 1; }
else
  mkdir -p build
  cmake --preset release -DSWIFTLET_BUILD_TESTS=OFF >build/configure.log || { cat build/configure.log; exit 1; }
fi
cmake --build build/release --target swiftlet
swiftlet=build/release/bin/swiftlet

rm -rf build/demo
mkdir -p build/demo
say "a flight of $seconds s through a generated world"
$swiftlet simulate --out build/demo/flight --duration "$seconds"

say "replay of that flight"
$swiftlet replay build/demo/flight --out build/demo/run

say "errors against the simulated truth"
$swiftlet evaluate build/demo/run

printf '\nThe run is in build/demo/run: odometry.tum, states.csv, summary.json, events.log.\n'
