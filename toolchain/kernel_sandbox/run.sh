#!/bin/bash
# Runs a program of this machine inside a small kernel of its own (user-mode Linux: an ordinary process, no
# privileges) that has cameras, a CAN bus, a GPIO chip and pseudo-terminals. docs/kernel_sandbox.md has the details.
# usage: toolchain/kernel_sandbox/run.sh COMMAND [ARG...]
#   COMMAND reads nothing, its output passes through, its exit code comes back.
#   SWIFTLET_SANDBOX_KERNEL   kernel; else ../shared/hil/linux, else build/kernel_sandbox/linux
#   SWIFTLET_SANDBOX_SHARE    the one folder COMMAND may write to (the current one)
#   SWIFTLET_SANDBOX_TIMEOUT  seconds of this machine's time (120)
#   SWIFTLET_SANDBOX_MEMORY   memory as the kernel takes it (512M)
#   SWIFTLET_SANDBOX_TIME     real | simulated (computing takes no time) | travel (only waiting takes none)
#   SWIFTLET_SANDBOX_CAMERAS  pattern | loop (capture nodes show what is written to the output nodes)
#   SWIFTLET_SANDBOX_PLANES   one | several (cameras of the multi-planar kind)
#   SWIFTLET_SANDBOX_SIZE, SWIFTLET_SANDBOX_RATE   of loop mode: 752x480, 20
#   SWIFTLET_SANDBOX_INSTANTS frame instants of the two cameras, us after whole periods: 0,0; or off
#   SWIFTLET_SANDBOX_LOG      file for the kernel's log
# Exit codes of its own: 77 no kernel here (a skipped test), 124 out of time, 125 the sandbox failed, 2 wrong use.
set -u
caller_environment=$(export -p)
export LC_ALL=C

here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd)
root=$(readlink -f "$here/../..")

skip() { # reason, what to do
  echo "SKIPPED: $1; run with: $2" >&2
  exit 77
}

fail() { # exit code, words
  echo "sandbox: $2" >&2
  exit "$1"
}

find_kernel() {
  local place
  if [ -n "${SWIFTLET_SANDBOX_KERNEL:-}" ]; then
    [ -x "$SWIFTLET_SANDBOX_KERNEL" ] && readlink -f "$SWIFTLET_SANDBOX_KERNEL"
    return
  fi
  for place in "$root/../shared/hil/linux" "$root/build/kernel_sandbox/linux"; do
    if [ -x "$place" ]; then
      readlink -f "$place"
      return
    fi
  done
  return 1
}

# Sets memory_folder: where the kernel keeps its memory file, which must be executable and have room.
choose_memory_folder() {
  local needed available
  memory_folder=$temporary
  needed=$(numfmt --from=iec "$memory") || fail 2 "SWIFTLET_SANDBOX_MEMORY: $memory is not a size such as 512M"
  available=$(df --output=avail -B1 /dev/shm 2>/dev/null | tail -n 1)
  if [ -w /dev/shm ] && [ "${available:-0}" -gt "$needed" ] && ! findmnt -no OPTIONS /dev/shm | grep -qw noexec; then
    memory_folder=/dev/shm
  fi
}

# The kernel begins a session of its own. Whoever is left of it when it ended, or must end, goes.
end_session() {
  local stat rest fields
  for stat in /proc/[0-9]*/stat; do
    { read -r rest <"$stat"; } 2>/dev/null || continue
    # After the name in brackets: state, parent, group, session.
    read -ra fields <<<"${rest##*) }"
    if [ "${fields[3]:-0}" = "$kernel_pid" ]; then kill -KILL "$(basename "$(dirname "$stat")")" 2>/dev/null; fi
  done
}

clean_up() {
  trap - EXIT INT TERM HUP
  if [ -n "$timer_pid" ]; then kill "$timer_pid" 2>/dev/null; fi
  if [ -n "$kernel_pid" ]; then
    kill -KILL "$kernel_pid" 2>/dev/null
    end_session
  fi
  rm -rf "$job"
}

[ $# -gt 0 ] || { sed -n '2,18s/^# \{0,1\}//p' "$0" >&2 && exit 2; }
if [ "$(uname -m)" != x86_64 ]; then skip "the sandbox's kernel runs on x86-64 only" "an x86-64 computer"; fi
kernel=$(find_kernel) || skip "no kernel for the sandbox (docs/kernel_sandbox.md)" \
  "toolchain/kernel_sandbox/build_kernel.sh, or its file in SWIFTLET_SANDBOX_KERNEL, then toolchain/test.sh --all"

share=$(readlink -e "${SWIFTLET_SANDBOX_SHARE:-$PWD}") || fail 2 "SWIFTLET_SANDBOX_SHARE is not a folder"
case $share in
  / | *,*) fail 2 "the folder to write to must not be / nor have a comma in its name: $share" ;;
esac
memory=${SWIFTLET_SANDBOX_MEMORY:-512M}
limit=${SWIFTLET_SANDBOX_TIMEOUT:-120}
cameras=${SWIFTLET_SANDBOX_CAMERAS:-pattern}
instants=${SWIFTLET_SANDBOX_INSTANTS:-0,0}
temporary=$(readlink -f "${TMPDIR:-/tmp}")
# The guest has a /dev, /run, /proc and /sys of its own; blanks would cut the kernel's command line.
case $temporary/ in
  /dev/* | /run/* | /proc/* | /sys/* | *\ *) temporary=/tmp ;;
esac
choose_memory_folder

case $cameras in
  pattern) inputs=(vivid.num_inputs=2,2 vivid.input_types=0xc,0xc) ;; # 0 a webcam, 1 HDMI
  loop) inputs=(vivid.num_inputs=1,1 vivid.input_types=0x3,0x3) ;;    # 0 HDMI
  *) fail 2 "SWIFTLET_SANDBOX_CAMERAS: $cameras is neither pattern nor loop" ;;
esac
case ${SWIFTLET_SANDBOX_PLANES:-one} in
  one) planes=1,1 ;;
  several) planes=2,2 ;;
  *) fail 2 "SWIFTLET_SANDBOX_PLANES: $SWIFTLET_SANDBOX_PLANES is neither one nor several" ;;
esac
case ${SWIFTLET_SANDBOX_TIME:-real} in
  real) clock=() ;;
  simulated) clock=(time-travel=inf-cpu) ;;
  travel) clock=(time-travel) ;;
  *) fail 2 "SWIFTLET_SANDBOX_TIME: $SWIFTLET_SANDBOX_TIME is none of real, simulated, travel" ;;
esac
# The kernel of build_kernel.sh knows on and off only.
aligned=1
if [ "$instants" = off ]; then
  instants=-1,-1
  aligned=0
fi

kernel_pid=
timer_pid=
job=$(mktemp -d "$temporary/swiftlet_sandbox.XXXXXX") || fail 125 "no folder for temporary files"
trap clean_up EXIT
trap 'clean_up; exit 130' INT
trap 'clean_up; exit 143' TERM HUP
ln -s "$here/guest.sh" "$job/guest"
printf '%s\n' "$caller_environment" >"$job/environment"
printf '%s\0' "$@" >"$job/command"
printf '%s\0' "$PWD" "$share" "$cameras" "${SWIFTLET_SANDBOX_SIZE:-752x480}" "${SWIFTLET_SANDBOX_RATE:-20}" \
  >"$job/settings"

# The kernel changes the modes of the files it writes to: pipes of its own, never the caller's terminal.
exec {out}> >(exec cat)
out_pid=$!
exec {err}> >(exec cat >&2 {out}>&-)
err_pid=$!
(
  exec 4>&"$out" 5>&"$err" {out}>&- {err}>&- </dev/null >"$job/log" 2>&1
  cd /
  # A restartable sequence that the C library registers would outlive the address space it lies in.
  export TMPDIR=$memory_folder GLIBC_TUNABLES=glibc.pthread.rseq=0
  exec setpriv --pdeathsig KILL "$kernel" \
    "mem=$memory" "uml_dir=$job/" umid=kernel \
    root=/dev/root rootfstype=hostfs rootflags=/ ro "init=$job/guest" panic=-1 oops=panic loglevel=6 \
    con=null con0=null,fd:1 console=tty0 ssl=null ssl1=null,fd:4 ssl2=null,fd:5 \
    vivid.n_devs=2 vivid.node_types=0x101,0x101 vivid.num_outputs=1,1 vivid.output_types=1,1 \
    "vivid.multiplanar=$planes" \
    vivid.vid_cap_nr=0,1 vivid.vid_out_nr=10,11 "vivid.start_offset_us=$instants" vivid.align_frames=$aligned \
    "${inputs[@]}" ${clock[@]+"${clock[@]}"}
) &
kernel_pid=$!
exec {out}>&- {err}>&-
sleep "$limit" &
timer_pid=$!

# A kernel that a signal ends makes the shell say so, in the middle of the command's own standard error.
wait -n -p ended "$kernel_pid" "$timer_pid" 2>/dev/null
if [ "$ended" = "$timer_pid" ]; then
  timer_pid=
  kill -KILL "$kernel_pid" 2>/dev/null
fi
wait "$kernel_pid" 2>/dev/null
end_session
kernel_pid=
wait "$out_pid" "$err_pid"
if [ -n "${SWIFTLET_SANDBOX_LOG:-}" ]; then cp "$job/log" "$SWIFTLET_SANDBOX_LOG"; fi
sed -n 's/^.*sandbox: \(warning: .*\)$/sandbox: \1/p' "$job/log" | tr -d '\r' >&2

if [ -z "$timer_pid" ]; then fail 124 "killed after $limit s (SWIFTLET_SANDBOX_TIMEOUT)"; fi
if [ ! -s "$job/code" ]; then
  tail -n 30 "$job/log" | tr -d '\r' >&2
  fail 125 "the kernel ended before the command did; the end of its log stands above"
fi
exit "$(cat "$job/code")"
