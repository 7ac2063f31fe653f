#!/bin/bash
# The first process inside the sandbox: mounts, devices, then the command. Started by run.sh, which leaves the
# command, its environment and the settings in this script's folder.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C
job=$(dirname "$0")
mapfile -d '' -t command <"$job/command"
mapfile -d '' -t settings <"$job/settings"
folder=${settings[0]}
share=${settings[1]}
cameras=${settings[2]}
size=${settings[3]}
rate=${settings[4]}
gpio_lines=16

warn() { echo "sandbox: warning: $*" >/dev/kmsg; }

mounts() {
  mount -t proc none /proc
  mount -t sysfs none /sys
  mountpoint -q /dev || mount -t devtmpfs none /dev
  mkdir -p /dev/pts /dev/shm
  mount -t devpts -o ptmxmode=666 none /dev/pts
  mount -t tmpfs -o mode=1777 none /dev/shm
  mount -t tmpfs -o mode=755 none /run
  mount -t configfs none /sys/kernel/config
  ln -sfn /proc/self/fd /dev/fd
  ln -sfn /proc/self/fd/0 /dev/stdin
  ln -sfn /proc/self/fd/1 /dev/stdout
  ln -sfn /proc/self/fd/2 /dev/stderr
  mkdir -p /run/job /run/tmp/upper /run/tmp/work
  mount -t hostfs none /run/job -o "$job"
  # Temporary files stay in memory; what lies there already can be read.
  mount -t overlay none /tmp -o lowerdir=/tmp,upperdir=/run/tmp/upper,workdir=/run/tmp/work ||
    warn "no writable /tmp"
  chmod 1777 /tmp
  mkdir -p "$share"
  mount -t hostfs none "$share" -o "$share" || warn "$share cannot be written to"
}

network() {
  ip link set lo up
  # MTU 72 lets CAN FD frames through besides classic ones.
  ip link add vcan0 type vcan && ip link set vcan0 mtu 72 up || warn "no CAN bus (is iproute2 installed?)"
}

gpio_chip() {
  local chip=/sys/kernel/config/gpio-sim/sandbox
  mkdir -p "$chip/bank0" && echo $gpio_lines >"$chip/bank0/num_lines" && echo sandbox >"$chip/bank0/label" &&
    echo 1 >"$chip/live" || {
    warn "no GPIO chip"
    return
  }
  gpio=/dev/$(cat "$chip/bank0/chip_name")
  gpio_sysfs=/sys/devices/platform/$(cat "$chip/dev_name")/$(basename "$gpio")
}

# Capture and output nodes get one signal timing, one size and one format, so that no byte is changed between.
loop_cameras() {
  local width=${size%x*} height=${size#*x} line_total number timing
  # The driver keeps a rate exactly when a line has a multiple of 100 pixels.
  line_total=$(((width + 400) / 100 * 100))
  timing=clear,width=$width,height=$height,interlaced=0,polarities=0,hfp=80,hs=120,hbp=$((line_total - width - 200))
  timing+=,vfp=5,vs=5,vbp=10,pixelclock=$((line_total * (height + 20) * rate))
  for number in 0 1; do
    v4l2-ctl -d /dev/video1$number --set-output=0 --set-dv-bt-timings="$timing" &&
      v4l2-ctl -d /dev/video1$number --set-fmt-video-out="width=$width,height=$height,pixelformat=GREY" &&
      v4l2-ctl -d /dev/video$number --set-input=0 --set-dv-bt-timings="$timing" &&
      v4l2-ctl -d /dev/video$number --set-fmt-video="width=$width,height=$height,pixelformat=GREY" &&
      v4l2-ctl -d /dev/video$number -c loop_video=1,osd_text_mode=2 || return
  done
}

mounts
network
gpio_chip
if [ "$cameras" = loop ]; then
  loop_cameras >/run/loop.log 2>&1 || warn "the cameras do not loop: $(tail -n 1 /run/loop.log)"
fi

# The command writes to pipes, not to terminals; two copiers carry its output out.
stty -F /dev/ttyS1 raw -echo
stty -F /dev/ttyS2 raw -echo
exec 6> >(exec cat >/dev/ttyS1)
out_pid=$!
exec 7> >(exec cat >/dev/ttyS2 6>&-)
err_pid=$!
(
  . /run/job/environment
  export SWIFTLET_SANDBOX=1 TMPDIR=/tmp SANDBOX_CAMERA0=/dev/video0 SANDBOX_CAMERA1=/dev/video1 \
    SANDBOX_OUTPUT0=/dev/video10 SANDBOX_OUTPUT1=/dev/video11 SANDBOX_CAN=vcan0 \
    SANDBOX_GPIO="${gpio:-}" SANDBOX_GPIO_SYSFS="${gpio_sysfs:-}" \
    HIL_GUEST=1 HIL_GPIO_DEV="${gpio:-}" HIL_GPIO_SYSFS="${gpio_sysfs:-}"
  cd "$folder" || exit 126
  # A child of the session's leader: a serial port that the command opens must not become its terminal.
  exec setsid "$BASH" -c '"$@"; exit $?' sandbox "${command[@]}"
) </dev/null >&6 2>&7 6>&- 7>&-
code=$?

# What the command left running would hold the pipes open.
for process in /proc/[0-9]*; do
  process=${process#/proc/}
  case $process in
    1 | "$out_pid" | "$err_pid") ;;
    *) kill -KILL "$process" 2>/dev/null ;;
  esac
done
exec 6>&- 7>&-
wait "$out_pid" "$err_pid"
echo "$code" >/run/job/code
cd / || exit
umount "$share"
umount /run/job
echo o >/proc/sysrq-trigger
while :; do sleep 1; done
