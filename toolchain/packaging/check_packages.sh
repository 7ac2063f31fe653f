#!/bin/sh
# Makes the Debian packages and tries them where nothing else is: a Debian 12 in a folder, as root.
#   the program alone: apt brings what it needs, a log is replayed to the same bytes as by the build, the service's
#     unit, rules, user and example are in order, its start line runs
#   the library: tests/install/consumer is built against find_package(swiftlet) and runs
#   the documentation; removal, which leaves settings and flights alone
# usage: toolchain/packaging/check_packages.sh [--keep]   --keep takes the folder of the last time, without installing
#   anew what was there (BUILD names the build folder, default build/release; one configured with
#   -DSWIFTLET_BUILD_LAB=OFF makes swiftlet-vehicle)
# Needs debootstrap, a network, and some minutes. Exit code 0 when all holds.
set -eu
cd "$(dirname "$0")/../.."
build=${BUILD:-build/release}
root=build/clean_debian
log=tests/data/euroc_mh01_4s
keep=no
case ${1:-} in
  '') ;;
  --keep) keep=yes ;;
  *)
    sed -n '2,10s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
esac
[ "$(id -u)" -eq 0 ] || {
  echo "check_packages: as root only: a Debian is made in $root" >&2
  exit 2
}

passed=0
failed=0
# Says what is looked at, then whether it holds; what the command printed only if not.
check() { # what, command...
  what=$1
  shift
  if "$@" >build/check_packages.log 2>&1; then
    passed=$((passed + 1))
    echo "ok      $what"
  else
    failed=$((failed + 1))
    echo "FAILED  $what"
    tail -40 build/check_packages.log | sed 's/^/        /'
  fi
}
inside() { chroot "$root" env LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }
apt() { inside apt-get -y -qq --no-install-recommends "$@"; }

# The system calls of a group (@...), one a line; groups hold groups.
calls_of() {
  systemd-analyze syscall-filter "$1" | sed -e 1d -e 's/^ *//' -e '/^#/d' -e '/^$/d' | while read -r call; do
    case $call in @*) calls_of "$call" ;; *) echo "$call" ;; esac
  done
}
# All system calls of a threaded run against those that the service's unit allows.
calls_allowed() {
  filters=$(sed -n 's/^SystemCallFilter=//p' toolchain/packaging/swiftlet.service)
  for group in $(echo "$filters" | grep -v '^~'); do calls_of "$group"; done | sort -u >build/calls_allowed
  for group in $(echo "$filters" | sed -n 's/^~//p'); do calls_of "$group"; done | sort -u >build/calls_denied
  strace -f -qq -o build/calls_trace "$build/bin/swiftlet" replay "$log" --until 1 --real-time --record \
    --loop-closure --out build/check_packages_run || return 1
  sed -n 's/^[0-9]* *\([a-z_0-9]*\)(.*/\1/p' build/calls_trace | sort -u >build/calls_used
  wc -l build/calls_*
  grep -qx futex build/calls_used || return 1
  # Used and not allowed, used and denied: none.
  [ -z "$(comm -23 build/calls_used build/calls_allowed)" ] && [ -z "$(comm -12 build/calls_used build/calls_denied)" ]
}

mounted=no
leave() {
  if [ $mounted = yes ]; then umount "$root/proc" || true; fi
}
trap leave EXIT

echo "== packages"
cmake --preset release -B "$build" >build/check_packages_configure.log
cmake --build "$build" --target swiftlet_installed
rm -rf "$build/packages"
(cd "$build" && cpack >cpack.log) || {
  cat "$build/cpack.log"
  exit 1
}
for deb in "$build"/packages/*.deb; do
  echo "$(basename "$deb"): $(($(stat -c %s "$deb") / 1024)) KiB"
  dpkg-deb -f "$deb" Depends | sed 's/^/        depends on /'
done
check "three packages" [ "$(find "$build/packages" -maxdepth 1 -name '*.deb' | wc -l)" -eq 3 ]
# swiftlet or, without the lab, swiftlet-vehicle.
program=$(cd "$build/packages" && find . -name 'swiftlet_*.deb' -o -name 'swiftlet-vehicle_*.deb')
program=${program#./}
name=${program%%_*}
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on none "$build"/packages/*.deb >build/lintian.log 2>&1 || true
  check "lintian has no errors (warnings are in build/lintian.log)" sh -c '! grep "^E:" build/lintian.log'
fi

echo "== a clean Debian 12 in $root"
if [ $keep = no ] || [ ! -x "$root/usr/bin/apt-get" ]; then
  rm -rf "$root"
  debootstrap --variant=minbase bookworm "$root" >build/check_packages_debootstrap.log || {
    tail -5 build/check_packages_debootstrap.log
    exit 1
  }
  # The host's libraries may have had security updates, which the packages may depend on.
  sed 's,/debian bookworm main,/debian-security bookworm-security main,' "$root/etc/apt/sources.list" \
    >"$root/etc/apt/sources.list.d/security.list"
fi
# CPUs are counted in /proc.
if mount -t proc proc "$root/proc" 2>/dev/null; then mounted=yes; fi
rm -rf "$root/opt"
mkdir -p "$root/opt/swiftlet"
cp "$build"/packages/*.deb "$root/opt/swiftlet"
cp -r "$log" "$root/opt/log"
cp -r tests/install/consumer "$root/opt/consumer"
apt update
if [ $keep = yes ]; then apt purge '*swiftlet*' >/dev/null 2>&1 || true; fi

echo "== the program alone"
before=$(inside dpkg-query -W | wc -l)
check "apt installs it with what it needs" apt install "/opt/swiftlet/$program"
echo "        $(($(inside dpkg-query -W | wc -l) - before)) packages came with it"
check "it says its version" inside swiftlet --version
check "it replays a log" inside swiftlet replay /opt/log --out /opt/run
rm -rf build/check_packages_run
check "the build's program replays the same log" "$build/bin/swiftlet" replay "$log" --out build/check_packages_run
check "both wrote the same bytes" cmp "$root/opt/run/odometry.tum" build/check_packages_run/odometry.tum
echo "        $(wc -l <"$root/opt/run/odometry.tum") poses"
check "the service's user is in the devices' groups" inside sh -c \
  'for group in video dialout gpio; do id -nG swiftlet | tr " " "\n" | grep -qx $group || exit 1; done'
check "the service's start line, with the example's settings, ends for want of devices alone (exit code 1)" inside sh -c '
  cp -r /usr/share/swiftlet/examples/vehicle/* /etc/swiftlet
  start=$(sed -n "s/^ExecStart=//p" /usr/lib/systemd/system/swiftlet.service | sed -e "s/%%/%/g" -e "s/[$][$]/\$/g")
  mkdir -p /var/lib/swiftlet && chown swiftlet: /var/lib/swiftlet && cd /var/lib/swiftlet || exit 9
  code=0
  setpriv --reuid swiftlet --regid swiftlet --init-groups \
    sh -c "eval \"\$1\"" sh "$start" >/opt/start.log 2>&1 || code=$?
  cat /opt/start.log
  [ $code -eq 1 ] && grep -q "no flight took place" /opt/start.log && ! grep -qi "exception\|settings:" /opt/start.log'

echo "== service, rules, manual page"
check "systemd, udev and man are installed beside it" apt install systemd udev man-db
check "systemd-analyze verify" inside sh -c \
  'said=$(systemd-analyze verify /usr/lib/systemd/system/swiftlet.service 2>&1); code=$?
   echo "$said"; [ $code -eq 0 ] && [ -z "$said" ]'
check "systemd-analyze security" inside systemd-analyze security --offline=yes --threshold=30 \
  /usr/lib/systemd/system/swiftlet.service
if command -v strace >/dev/null && command -v systemd-analyze >/dev/null; then
  check "the unit allows every system call of a threaded run" calls_allowed
fi
check "man swiftlet" inside sh -c 'man -w swiftlet && man swiftlet | grep -q "^SETTINGS"'
if [ $mounted = yes ] && mount --rbind /sys "$root/sys" 2>/dev/null; then
  # It reads all rules and complains of those that it does not understand.
  check "udev understands the rules" inside sh -c \
    'said=$(udevadm test /sys/devices/virtual/mem/null 2>&1); echo "$said" | grep 60-swiftlet
     echo "$said" | grep -q "Reading rules file: .*60-swiftlet.rules" &&
     ! echo "$said" | grep "60-swiftlet.rules:[0-9]"'
  umount -l "$root/sys"
fi

echo "== the library"
check "apt installs it with what find_package needs" apt install \
  $(cd "$root" && ls ./opt/swiftlet/libswiftlet-dev_*.deb | sed 's/^\.//')
check "a compiler and CMake, which are recommended" apt install cmake g++ make
check "a stranger's project is configured" inside cmake -S /opt/consumer -B /opt/consumer/build
check "and built" inside cmake --build /opt/consumer/build
check "and runs" inside /opt/consumer/build/consumer
sed 's/^/        /' build/check_packages.log

echo "== documentation, removal"
check "the documentation is installed" apt install $(cd "$root" && ls ./opt/swiftlet/swiftlet-doc_*.deb | sed 's/^\.//')
check "it has this page" inside test -s /usr/share/doc/swiftlet/docs/packages.md
check "each package has its copyright" inside test -s "/usr/share/doc/$name/copyright" \
  -a -s /usr/share/doc/libswiftlet-dev/copyright -a -s /usr/share/doc/swiftlet-doc/copyright
check "installing again changes nothing" apt install --reinstall "/opt/swiftlet/$program"
check "all are purged" apt purge "$name" libswiftlet-dev swiftlet-doc
check "nothing of them is left but what is the user's" inside sh -c \
  'left=$(find /usr /lib /etc /var/lib -name "*swiftlet*" ! -path "/var/lib/apt/*" ! -path "/var/cache/*" | sort | tr "\n" " ")
   echo "$left"; [ "$left" = "/etc/swiftlet /var/lib/swiftlet " ] && [ -f /etc/swiftlet/vehicle.yaml ]'

echo "$passed passed, $failed failed"
[ $failed -eq 0 ]
