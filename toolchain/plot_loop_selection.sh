#!/bin/sh
# Draws the time per new loop of loop selection against the loops held, beside one search over all of them.
# usage: toolchain/plot_loop_selection.sh GROWTH.csv OUT.svg
#   GROWTH.csv  what benchmark_loop_selection prints
# Needs gnuplot (packages_optional.txt). Exit code 0 when drawn, 2 wrong use.
set -eu
if [ $# -ne 2 ] || [ ! -r "$1" ]; then
  sed -n '2,5s/^# \{0,1\}//p' "$0"
  exit 2
fi
if ! command -v gnuplot >/dev/null 2>&1; then
  echo "plot: no gnuplot; toolchain/install.sh optional" >&2
  exit 2
fi
gnuplot -e "growth='$1'; out='$2'" - <<'GNUPLOT'
set terminal svg size 720,440 font "sans,13" background "white"
set output out
set datafile separator ","
set logscale xy
set xlabel "loops held"
set ylabel "time [us]"
set xrange [8:2500]
set format y "10^{%L}"
set key top left
set grid
plot growth using 1:2 skip 1 with linespoints lw 2 pt 7 title "new loop, mean since the point before", \
     growth using 1:3 skip 1 with linespoints lw 2 pt 5 title "new loop, worst", \
     growth using 1:($4*1000) skip 1 with linespoints lw 2 pt 9 title "one search over all"
GNUPLOT
