#!/bin/sh
# Builds the program for this computer and for 64-bit Arm, replays the same seconds of a log with both (Arm's under
# qemu-user) and compares the poses: exit code 0 when they are the same images' and nowhere further apart than 1 mm.
# usage: toolchain/aarch64/compare.sh [LOG [SECONDS]]
#   default: 5 s of $SWIFTLET_DATA/euroc_mh01_20s, or of the 4 s in tests/data where that is not there
# Needs packages g++-aarch64-linux-gnu and qemu-user-static, and toolchain/aarch64/make_root.sh.
set -eu
cd "$(dirname "$0")/../.."
log=${1:-${SWIFTLET_DATA:-../shared/data}/euroc_mh01_20s}
[ -n "${1:-}" ] || [ -d "$log" ] || log=tests/data/euroc_mh01_4s
seconds=${2:-5}
here=$(uname -m)
out=build/compare_aarch64

[ -f build/release/CMakeCache.txt ] || cmake --preset release >/dev/null
[ -f build/aarch64/CMakeCache.txt ] || cmake --preset aarch64 >/dev/null
cmake --build build/release --target swiftlet
cmake --build build/aarch64 --target swiftlet
mkdir -p $out
run() { # name, command...
  name=$1
  shift
  begin=$(date +%s)
  "$@" replay "$log" --until "$seconds" --out "$out/$name" >"$out/$name.txt" 2>&1 || {
    tail -5 "$out/$name.txt"
    return 1
  }
  echo "$name: $(wc -l <"$out/$name/odometry.tum") poses in $(($(date +%s) - begin)) s"
}
run "$here" build/release/bin/swiftlet
run aarch64 qemu-aarch64-static -L "$(sed -n 's/^SWIFTLET_ARM64_ROOT:PATH=//p' build/aarch64/CMakeCache.txt)" \
  build/aarch64/bin/swiftlet

# stamp tx ty tz qx qy qz qw
paste -d ' ' "$out/$here/odometry.tum" "$out/aarch64/odometry.tum" | awk -v lines="$(wc -l <"$out/$here/odometry.tum")" '
  NF != 16 || $1 != $9 { print "line " NR ": not the same images"; bad = 1; exit 1 }
  {
    d = sqrt(($2 - $10)^2 + ($3 - $11)^2 + ($4 - $12)^2)
    if (d > most) { most = d; at = $1 }
    # The sine of half the angle between: what the product of one with the other turned round has beside 1.
    x = -$8 * $13 + $5 * $16 - $6 * $15 + $7 * $14
    y = -$8 * $14 + $6 * $16 - $7 * $13 + $5 * $15
    z = -$8 * $15 + $7 * $16 - $5 * $14 + $6 * $13
    s = sqrt(x^2 + y^2 + z^2)
    if (s > turn) turn = s
    if (NR > 1) way += sqrt(($2 - px)^2 + ($3 - py)^2 + ($4 - pz)^2)
    px = $2; py = $3; pz = $4
  }
  END {
    if (bad || NR == 0) { print "no comparison"; exit 1 }
    printf "%d poses on a way of %.2f m: at most %.6f mm apart (at %s), %.6f mrad\n", NR, way, 1000 * most, at, 2000 * turn
    exit most > 0.001
  }'
