#!/bin/bash
# A campaign on one log and two simulated flights, run in one go; then the same, run another way, gives the same table.
# usage: campaign_engines.sh PROGRAM LOG FOLDER HOW
#   HOW  resumed   killed after the first run, then gone on with
#        parallel  by GNU parallel
#        slurm     as an array of jobs under a Slurm of one node, which this starts (as root)
set -eu
here=$(cd "$(dirname "$0")" && pwd)
program=$(realpath "$1") log=$(realpath "$2") folder=$3 how=$4
rm -rf "$folder"
mkdir -p "$folder"
cd "$folder"
folder=$(pwd)
cat >logs.yaml <<EOF
repeats: 2
logs:
  - $log
  - name: room
    simulate: [--duration, 20, --tracks]
    seeds: [1, 2]
EOF
skip() { # what is missing
  echo "SKIPPED: $1. To run it: $2"
  exit 77
}
campaign() { "$program" campaign logs.yaml "$@"; }
same_tables() {
  for file in table.csv table.json table.md runs.csv; do cmp "whole/$file" "other/$file"; done
  test "$(wc -l <other/runs.csv)" -eq 7
}
rows() { find other/rows -name '*.json' 2>/dev/null | wc -l; }

case $how in
  parallel) command -v parallel >/dev/null || skip "GNU parallel is not installed" "toolchain/install.sh test" ;;
  slurm)
    command -v slurmctld >/dev/null && command -v munged >/dev/null ||
      skip "Slurm is not installed" "toolchain/install.sh test optional"
    [ "$(id -u)" -eq 0 ] || skip "Slurm's daemons are started as root" "sudo"
    ;;
esac
campaign --out whole --jobs 2
test ! -e whole/logs/room_1

case $how in
  resumed)
    setsid "$program" campaign logs.yaml --out other --jobs 2 >killed.txt 2>&1 &
    group=$!
    for _ in $(seq 600); do
      if [ "$(rows)" -gt 0 ]; then break; fi
      sleep 0.1
    done
    kill -KILL $group
    wait $group || true
    # What it ran ends with it.
    for _ in $(seq 150); do
      if ! pgrep -f "$folder/other" >left.txt; then break; fi
      sleep 0.1
    done
    if pgrep -af "$folder/other"; then
      echo "these outlived the campaign"
      exit 1
    fi
    had=$(rows)
    test "$had" -gt 0 -a "$had" -lt 6
    ! campaign --out other --table >partial.txt || exit 1
    grep -q 'not run' partial.txt
    campaign --out other --jobs 2
    ;;
  parallel)
    campaign --list | parallel -j 2 "$program" campaign logs.yaml --out other --job {}
    campaign --out other --table
    ;;
  slurm)
    . "$here/slurm_of_one_node.sh" "$folder/slurm"
    sbatch --wait --array=1-3 --output=job_%a.txt --wrap "'$program' campaign logs.yaml --out other --job \$SLURM_ARRAY_TASK_ID"
    cat job_*.txt
    campaign --out other --table
    ;;
esac
same_tables
