#!/bin/sh
# Makes the Debian packages as Debian does and tries them where nothing else is: Debian 12 in folders, as root.
#   source package from the files that git knows; packages for amd64, and for arm64 by a cross build, each in a Debian
#     of its own with the build's packages alone and without a network; lintian
#   the tools in a clean Debian: apt brings what they need, doctor runs, a log is replayed to the same bytes as by the
#     build, the service's unit, rules, user and example are in order, its start line runs; upgrade, removal, purge
#   the library: tests/install/consumer is built against find_package(swiftlet) and runs
#   arm64 in a clean Debian under qemu-user: doctor, and the same replay
# usage: toolchain/packaging/check_packages.sh [--keep]   --keep takes the Debians to build in and the packages of the
#   last time, if they are there (BUILD names the folder of the build to compare with, default build/release)
# Needs debhelper, debootstrap, lintian, npm, qemu-user-static, a network, 10 GB and half an hour. Exit code 0 when all
# holds.
set -eu
cd "$(dirname "$0")/../.."
build=${BUILD:-build/release}
work=build/packages
log=tests/data/euroc_mh01_4s
keep=no
case ${1:-} in
  '') ;;
  --keep) keep=yes ;;
  *)
    sed -n '2,13s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
esac
[ "$(id -u)" -eq 0 ] || {
  echo "check_packages: as root only: Debians are made in $work" >&2
  exit 2
}
mkdir -p $work
work=$(cd $work && pwd)
said=$work/said

passed=0
failed=0
# Says what is looked at, then whether it holds; what the command printed only if not.
check() { # what, command...
  what=$1
  shift
  if "$@" >"$said" 2>&1; then
    passed=$((passed + 1))
    echo "ok      $what"
  else
    failed=$((failed + 1))
    echo "FAILED  $what"
    tail -40 "$said" | sed 's/^/        /'
  fi
}
need() { # the same; without it there is nothing more to check
  failures=$failed
  check "$@"
  [ "$failed" -eq "$failures" ] || exit 1
}

# Commands in the Debian $root, with its own processes and mounts.
inside() { # command...
  # shellcheck disable=SC2016 # for the other shell
  unshare --mount --pid --fork ${offline:+--net} sh -c 'mount -t proc proc "$0/proc" && mount --rbind /sys "$0/sys" &&
    exec chroot "$0" env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
      DEBIAN_FRONTEND=noninteractive SYSTEMD_OFFLINE=1 "$@"' "$root" "$@"
}
apt() { inside apt-get -y -qq --no-install-recommends "$@"; }
offline=''

# A Debian 12 with its updates.
debian() { # folder, architecture
  root=$1
  if [ $keep = yes ] && [ -e "$root/made" ]; then return; fi
  rm -rf "$root"
  debootstrap --variant=minbase --arch="$2" bookworm "$root"
  sed -n 's,/debian bookworm main,/debian bookworm-updates main,p' "$root/etc/apt/sources.list" \
    >"$root/etc/apt/sources.list.d/updates.list"
  sed 's,/debian bookworm main,/debian-security bookworm-security main,' "$root/etc/apt/sources.list" \
    >"$root/etc/apt/sources.list.d/security.list"
  apt update && apt upgrade && touch "$root/made"
}
copy() { # folder, of which
  root=$work/$1
  rm -rf "$root"
  cp -a "$work/$2" "$root"
}

# Packages of an architecture, out of the source package, in a Debian with what the build needs.
build_packages() { # architecture, options of build-dep, of dpkg-buildpackage, a compiler's package
  packages=$work/$1
  root=$work/build_$1
  if [ $keep = yes ] && [ -n "$(find "$packages" -name '*.changes' 2>/dev/null)" ]; then return; fi
  if [ $keep = no ] || [ ! -d "$root" ]; then copy "build_$1" debian_amd64; fi
  rm -rf "$root/src" "$packages"
  mkdir -p "$root/src" "$packages"
  cp "$work"/source/*.dsc "$work"/source/*.tar.xz "$root/src"
  inside dpkg --add-architecture "$1" && apt update || return 1
  inside sh -c 'cd /src && apt-get -y -qq --no-install-recommends install dpkg-dev $1 &&
    dpkg-source -x *.dsc tree && cd tree && apt-get -y -qq --no-install-recommends $0 build-dep .' "$2" "$4" || return 1
  offline=yes
  inside sh -c 'cd /src/tree && dpkg-buildpackage -us -uc $0' "$3" || return 1
  offline=''
  cp "$root"/src/*.deb "$root"/src/*.changes "$root"/src/*.buildinfo "$packages"
}

# The system calls of a group (@...), one a line; groups hold groups.
calls_of() {
  systemd-analyze syscall-filter "$1" | sed -e 1d -e 's/^ *//' -e '/^#/d' -e '/^$/d' | while read -r call; do
    case $call in @*) calls_of "$call" ;; *) echo "$call" ;; esac
  done
}
# All system calls of a threaded run against those that the service's unit allows.
calls_allowed() {
  filters=$(sed -n 's/^SystemCallFilter=//p' toolchain/packaging/swiftlet.service)
  for group in $(echo "$filters" | grep -v '^~'); do calls_of "$group"; done | sort -u >"$work/calls_allowed"
  for group in $(echo "$filters" | sed -n 's/^~//p'); do calls_of "$group"; done | sort -u >"$work/calls_denied"
  strace -f -qq -o "$work/calls_trace" "$build/bin/swiftlet" replay "$log" --until 1 --real-time --record \
    --loop-closure --out "$work/run_traced" || return 1
  sed -n 's/^[0-9]* *\([a-z_0-9]*\)(.*/\1/p' "$work/calls_trace" | sort -u >"$work/calls_used"
  wc -l "$work"/calls_*
  grep -qx futex "$work/calls_used" || return 1
  # Used and not allowed, used and denied: none.
  [ -z "$(comm -23 "$work/calls_used" "$work/calls_allowed")" ] &&
    [ -z "$(comm -12 "$work/calls_used" "$work/calls_denied")" ]
}

# debian/tests/replay in $root, with what it says on the way.
tried() { # what
  mkdir -p "$root/opt/tests/data" "$root/opt/debian"
  cp -r $log "$root/opt/tests/data"
  cp -r debian/tests "$root/opt/debian"
  rm -rf "$root/opt/run"
  check "$1" inside sh -c 'cd /opt && AUTOPKGTEST_TMP=/opt debian/tests/replay'
  sed -n -e '/^connected/,/checks them at work/s/^/        /p' -e '/ATE rmse/s/^/        /p' "$said"
}
deb() { (cd "$root" && ls "opt/packages/$1"_*.deb | sed 's,^,/,'); }
packages_into() { # architecture
  mkdir -p "$root/opt/packages"
  cp "$work/$1"/*.deb "$root/opt/packages"
  apt update
}
# What a replay said of its error [m].
error_said() { sed -n 's/.*odometry all *ATE rmse \([0-9.]*\) m.*/\1/p' "$said"; }

echo "== source package"
if [ $keep = no ] || [ ! -d "$work/source" ]; then
  rm -rf "$work/source"
  mkdir -p "$work/source/swiftlet"
  git ls-files -z | tar -c --null -T - | tar -x -C "$work/source/swiftlet"
  need "dpkg-buildpackage makes it" sh -c "cd '$work/source/swiftlet' && dpkg-buildpackage -S -d -us -uc"
fi
linted() { lintian --allow-root --fail-on error,warning --show-overrides "$@"; }
check "lintian has no errors and no warnings" linted "$work"/source/*.dsc

echo "== packages for amd64, built without a network"
need "a Debian 12" debian "$work/debian_amd64" amd64
need "dpkg-buildpackage makes them" build_packages amd64 '' -b g++
ls "$work"/amd64/*.deb
for name in swiftlet swiftlet-vehicle libswiftlet-dev swiftlet-doc; do
  file=$(ls "$work/amd64/${name}"_*.deb)
  echo "$(basename "$file"): $(($(stat -c %s "$file") / 1024)) KiB"
  dpkg-deb -f "$file" Depends | sed 's/^/        depends on /'
done
check "lintian has no errors and no warnings" linted "$work"/amd64/*.changes

echo "== the tools in a clean Debian"
copy clean debian_amd64
packages_into amd64
before=$(inside dpkg-query -W | wc -l)
check "apt installs them with what they need" apt install "$(deb swiftlet)"
echo "        $(($(inside dpkg-query -W | wc -l) - before)) packages came with them"
tried "doctor runs, and a log is replayed"
rm -rf "$work/run_built"
check "the build's program replays the same log" "$build/bin/swiftlet" replay $log --out "$work/run_built"
error_built=$(error_said)
check "both wrote the same bytes" cmp "$root/opt/run/odometry.tum" "$work/run_built/odometry.tum"
echo "        $(wc -l <"$root/opt/run/odometry.tum") poses"
check "the live view's page is there" inside test -s /usr/share/swiftlet/report_page.html
cp /usr/bin/qemu-x86_64-static "$root/opt"
check "an older processor is refused with a message" inside sh -c \
  'said=$(/opt/qemu-x86_64-static -cpu Nehalem /usr/bin/swiftlet --version 2>&1); echo "$said"
   echo "$said" | grep -q "CPU ISA level is lower than required"'
check "the service's user is in the devices' groups" inside sh -c \
  'for group in video dialout gpio; do id -nG swiftlet | tr " " "\n" | grep -qx $group || exit 1; done'
check "the service's start line, with the example's settings, ends for want of devices alone (exit code 1)" inside sh -c '
  cp -r /usr/share/swiftlet/examples/vehicle/* /etc/swiftlet
  start=$(sed -n "s/^ExecStart=//p" /lib/systemd/system/swiftlet.service | sed -e "s/%%/%/g" -e "s/[$][$]/\$/g")
  mkdir -p /var/lib/swiftlet && chown swiftlet: /var/lib/swiftlet && cd /var/lib/swiftlet || exit 9
  code=0
  setpriv --reuid swiftlet --regid swiftlet --init-groups \
    sh -c "eval \"\$1\"" sh "$start" >/opt/start.log 2>&1 || code=$?
  cat /opt/start.log
  [ $code -eq 1 ] && grep -q "no flight took place" /opt/start.log && ! grep -qi "exception\|settings:" /opt/start.log'

echo "== service, rules, manual page"
check "systemd, udev and man are installed beside it" apt install systemd udev man-db
check "systemd-analyze verify" inside sh -c \
  'said=$(systemd-analyze verify /lib/systemd/system/swiftlet.service 2>&1); code=$?
   echo "$said"; [ $code -eq 0 ] && [ -z "$said" ]'
check "systemd-analyze security" inside systemd-analyze security --offline=yes --threshold=30 \
  /lib/systemd/system/swiftlet.service
if command -v strace >/dev/null && command -v systemd-analyze >/dev/null; then
  check "the unit allows every system call of a threaded run" calls_allowed
fi
check "man swiftlet" inside sh -c 'man -w swiftlet && man swiftlet | grep -q "^SETTINGS"'
# It reads all rules and complains of those that it does not understand.
check "udev understands the rules" inside sh -c \
  'said=$(udevadm test /sys/devices/virtual/mem/null 2>&1); echo "$said" | grep 60-swiftlet
   echo "$said" | grep -q "Reading rules file: .*60-swiftlet.rules" &&
   ! echo "$said" | grep "60-swiftlet.rules:[0-9]"'

echo "== upgrade and removal"
# What systemd would be asked, on a machine where it runs.
cat >"$root/usr/bin/deb-systemd-invoke" <<'END'
#!/bin/sh
echo "$@" >>/opt/asked
END
chmod +x "$root/usr/bin/deb-systemd-invoke"
mkdir -p "$root/run/systemd/system"
older() { # the same package with an older version
  inside sh -c 'cd /opt && rm -rf older && dpkg-deb -R "$0" older && sed -i "s/^Version: .*/Version: 0.0.1/" older/DEBIAN/control &&
    dpkg-deb -b older older.deb' "$(deb swiftlet)" && apt install --allow-downgrades /opt/older.deb
}
check "an older version" older
check "the user enables the service, settles the vehicle, and flies" inside sh -c \
  'systemctl enable swiftlet && echo "# mine" >>/etc/swiftlet/vehicle.yaml && mkdir -p /var/lib/swiftlet/flights/1 &&
   cp /opt/run/odometry.tum /var/lib/swiftlet/flights/1 && chown -R swiftlet: /var/lib/swiftlet && rm -f /opt/asked'
kept_files() { (cd "$root" && find etc/swiftlet var/lib/swiftlet -type f -exec stat -c '%u:%g %a' {} + -exec sha256sum {} +); }
kept_files >"$work/files_before"
unchanged() { kept_files >"$work/files_after" && diff "$work/files_before" "$work/files_after"; }
check "it is upgraded" apt install "$(deb swiftlet)"
check "settings and flights are unchanged" unchanged
check "the service is still enabled" inside systemctl is-enabled swiftlet
# shellcheck disable=SC2016 # for the other shell
check "a flight is not stopped: systemd is asked to read the unit anew, and nothing else" inside sh -c \
  'cat /opt/asked && [ "$(sort -u /opt/asked)" = daemon-reload ]'
check "the vehicle's package takes its place" apt install "$(deb swiftlet-vehicle)"
check "the service was stopped and disabled" inside sh -c \
  'grep -qx "stop swiftlet.service" /opt/asked && ! systemctl is-enabled swiftlet'
check "settings and flights are unchanged" unchanged
echo "        $(inside swiftlet --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p' | tr '\n' ' ')"
tried "doctor and replay of the vehicle's program"
check "it writes the same bytes" cmp "$root/opt/run/odometry.tum" "$work/run_built/odometry.tum"
check "removed" apt remove swiftlet-vehicle
check "settings and flights are unchanged" unchanged
check "the tools again" apt install "$(deb swiftlet)"
check "installing again changes nothing" apt install --reinstall "$(deb swiftlet)"

echo "== the library"
check "apt installs it with what find_package needs" apt install "$(deb libswiftlet-dev)"
check "a compiler and CMake, which are recommended" apt install cmake g++ make
cp -r tests/install/consumer "$root/opt/consumer"
check "a stranger's project is configured" inside cmake -S /opt/consumer -B /opt/consumer/build
check "and built" inside cmake --build /opt/consumer/build
check "and runs" inside /opt/consumer/build/consumer
sed 's/^/        /' "$said"

echo "== documentation, purge"
check "the documentation is installed" apt install "$(deb swiftlet-doc)"
check "it has this page" inside test -s /usr/share/doc/swiftlet/docs/packages.md
check "all are purged" apt purge swiftlet swiftlet-vehicle libswiftlet-dev swiftlet-doc
check "settings and flights are unchanged" unchanged
check "nothing of them is left but what is the user's" inside sh -c \
  'left=$(find /usr /lib /etc /var/lib -name "*swiftlet*" ! -path "/var/lib/apt/*" ! -path "/var/cache/*" | sort | tr "\n" " ")
   echo "$left"; [ "$left" = "/etc/swiftlet /var/lib/swiftlet " ] && [ -f /etc/swiftlet/vehicle.yaml ]'

echo "== arm64: cross build without a network, then a clean Debian under qemu-user"
need "dpkg-buildpackage makes them" build_packages arm64 '-aarm64 -Pcross,nocheck' '-B -aarm64 -Pcross,nocheck' \
  crossbuild-essential-arm64
ls "$work"/arm64/*.deb
dpkg-deb -f "$(ls "$work"/arm64/swiftlet_*.deb)" Depends | sed 's/^/        depends on /'
check "lintian has no errors and no warnings" linted "$work"/arm64/*.changes
formats=/proc/sys/fs/binfmt_misc
if [ ! -e $formats/register ]; then mount -t binfmt_misc binfmt_misc $formats; fi
if [ ! -e $formats/qemu-aarch64 ]; then
  cat /usr/lib/binfmt.d/qemu-aarch64.conf >$formats/register
  trap 'echo -1 >$formats/qemu-aarch64' EXIT
fi
need "a Debian 12 of arm64" debian "$work/debian_arm64" arm64
copy clean_arm64 debian_arm64
packages_into arm64
check "apt installs the tools with what they need" apt install "$(deb swiftlet)"
tried "doctor runs, and a log is replayed"
error_arm=$(error_said)
same=other
if cmp -s "$root/opt/run/odometry.tum" "$work/run_built/odometry.tum"; then same='the same'; fi
echo "        odometry.tum has $same bytes as on $(uname -m); ATE $error_arm m, there $error_built m"
# What the accuracy table allows.
check "the errors differ by at most 0.3 mm" awk -v a="$error_arm" -v b="$error_built" \
  'BEGIN { d = a - b; exit !(a > 0 && b > 0 && d <= 0.0003 && d >= -0.0003) }'
check "the vehicle's package takes their place" apt install "$(deb swiftlet-vehicle)"
cp "$root/opt/run/odometry.tum" "$work/odometry_arm64.tum"
tried "doctor and replay of the vehicle's program"
check "it writes the same bytes" cmp "$root/opt/run/odometry.tum" "$work/odometry_arm64.tum"

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
