#!/bin/sh
# Looks at what is installed in a folder, and so becomes Debian packages: files in their places, the service's unit
# file, the manual page, the example of a vehicle's settings; and whether debian/control agrees with toolchain/.
# usage: check_installed.sh INSTALLED_FOLDER SCRATCH_FOLDER
set -eu
root=$1
scratch=$2
failed=0
fail() {
  echo "FAILED: $*"
  failed=1
}

skipped=0
skip() { # reason, command; the rest goes on
  echo "SKIPPED: $1; run with: $2"
  skipped=77
}

packaging=$(cd "$(dirname "$0")/../.." && pwd)

# Names of a field of debian/control, and of a list of packages.
field() { # field
  sed -n "/^$1:/,/^[A-Z]/p" "$packaging/debian/control" | sed -n 's/^ \([a-z0-9.+-]*\).*,$/\1/p' | sort -u
}
list() { sed -e 's/#.*//' -e '/^ *$/d' "$packaging/toolchain/$1" | sort -u; }
field Build-Depends >"$scratch/build_depends"
# What the compiler's package brings is understood; what only makes packages is no developer's.
list packages.txt | grep -vx 'g++' >"$scratch/needed"
list packages_optional.txt | sort -u - "$scratch/needed" >"$scratch/known"
printf '%s\n' debhelper-compat dh-sequence-installsysusers esbuild qemu-user-static | sort -u - "$scratch/known" >"$scratch/allowed"
none() { # what is wrong with these, names
  [ -z "$2" ] || fail "$1: $(echo "$2" | tr '\n' ' ')"
}
none "in packages.txt, and not in debian/control's Build-Depends" "$(comm -23 "$scratch/needed" "$scratch/build_depends")"
none "in debian/control's Build-Depends, and in no list of toolchain/" "$(comm -23 "$scratch/build_depends" "$scratch/allowed")"
sed -n '/^Package: libswiftlet-dev/,$p' "$packaging/debian/control" | sed -n 's/^ \(.*-dev\b\).*,$/\1/p' | sort -u >"$scratch/development"
none "needed by libswiftlet-dev, and not in Build-Depends" "$(comm -23 "$scratch/development" "$scratch/build_depends")"
echo "debian/control: $(wc -l <"$scratch/build_depends") packages to build, as in the lists of toolchain/"
version=$(sed -n '1s/^swiftlet (\(.*\)+[0-9]*).*/\1/p' "$packaging/debian/changelog")
"$root/bin/swiftlet" --version | grep -qF "$version" || fail "debian/changelog has version $version, the program another"

for file in bin/swiftlet lib/systemd/system/swiftlet.service lib/udev/rules.d/60-swiftlet.rules \
  lib/sysusers.d/swiftlet.conf share/man/man1/swiftlet.1 share/swiftlet/foxglove_layout.json \
  include/swiftlet/estimator/odometry/odometry.hpp share/doc/swiftlet/docs/packages.md share/doc/swiftlet/README.md; do
  [ -e "$root/$file" ] || fail "no $file is installed"
done

# The manual page: every command, and nothing that a reader of man pages complains of.
page=$root/share/man/man1/swiftlet.1
for command in $("$root/bin/swiftlet" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p'); do
  grep -q "^\.SS swiftlet $(echo "$command" | sed 's/-/\\\\-/g') " "$page" || fail "the manual page lacks $command"
done
if command -v mandoc >/dev/null; then
  complaints=$(mandoc -T lint -W warning "$page" || true)
  [ -z "$complaints" ] || fail "mandoc: $complaints"
  echo "manual page: read by mandoc"
else
  skip "manual page: there is no mandoc" "toolchain/install.sh test, then toolchain/test.sh"
fi
if command -v man >/dev/null && man --version 2>&1 | grep -q '^man [0-9]'; then
  complaints=$(LC_ALL=C.UTF-8 MANROFFSEQ='' MANWIDTH=80 man --warnings -E UTF-8 -l -Tutf8 -Z "$page" 2>&1 >/dev/null)
  [ -z "$complaints" ] || fail "man: $complaints"
  echo "manual page: read by man"
fi

# The unit file: systemd says on stderr what it ignores.
if command -v systemd-analyze >/dev/null; then
  # Its documentation is looked up as well.
  said=$(MANPATH="$root/share/man" systemd-analyze verify "$root/lib/systemd/system/swiftlet.service" \
    2>&1) || true
  # Containers may have no man.
  said=$(echo "$said" | grep -v "Command 'man swiftlet(1)' failed" || true)
  [ -z "$said" ] || fail "systemd-analyze: $said"
  echo "unit file: verified"
else
  skip "unit file: there is no systemd-analyze" "apt-get install systemd, then toolchain/test.sh"
fi

# The example: settings and calibration are accepted, only the devices are not there.
example=$root/share/swiftlet/examples/vehicle
"$root/bin/swiftlet" settings --brief --settings "$example/vehicle.yaml" >"$scratch/settings.yaml" ||
  fail "the example's settings are refused"
grep -q 'protocol: vectornav' "$scratch/settings.yaml" || fail "the example's settings are not taken"
said=$("$root/bin/swiftlet" doctor --seconds 0 --settings "$example/vehicle.yaml" \
  --set "vehicle.calibration=$example/rig" | sed -n '/^this vehicle/,/^$/p' | sed 1d)
echo "$said" | grep -q '/dev/v4l/by-path' || fail "doctor does not look for the example's cameras: $said"
if echo "$said" | grep -q '^ *settings '; then fail "doctor refuses the example: $said"; fi
"$root/bin/swiftlet" fly --settings "$example/vehicle.yaml" --set "vehicle.calibration=$example/no" \
  --out "$scratch/flight" 2>"$scratch/refused.txt" && fail "fly takes a calibration that is not there"
[ $? -le 2 ] && grep -q "$example/no" "$scratch/refused.txt" || fail "fly does not name the calibration that it lacks"
echo "example of a vehicle: settings and calibration accepted"

# A state folder that cannot be made or written costs a flight its files: nothing in the unit insists on it. A variable
# does not: GStreamer lists its plugins anew where it cannot write.
unit=$root/lib/systemd/system/swiftlet.service
if grep -q '^StateDirectory=' "$unit" || grep '^[^#].*/var/lib/swiftlet' "$unit" | grep -v '^Environment=GST_REGISTRY=' | grep -qv '=-'; then
  fail "the unit does not start where its state folder cannot be made"
fi

# The rule that keeps a service with wrong settings from starting again.
code=0
"$root/bin/swiftlet" fly --settings "$scratch/nothing.yaml" --out "$scratch/flight" 2>/dev/null || code=$?
grep -q "^RestartPreventExitStatus=$code\$" "$unit" ||
  fail "fly ends with $code on wrong settings, and the service starts it again"
[ $failed -eq 0 ] && exit $skipped
