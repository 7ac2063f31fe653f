#!/bin/sh
# Installs the components of the Debian packages into a folder and looks at what is there: files in their places,
# each in one package, the service's unit file, the manual page, the example of a vehicle's settings.
# usage: check_installed.sh BUILD_FOLDER SCRATCH_FOLDER
set -eu
build=$1
root=$2
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

rm -rf "$root"
mkdir -p "$root"
for component in program development documentation; do
  cmake --install "$build" --prefix "$root/$component" --component $component >"$root/install_$component.log"
  (cd "$root/$component" && find . ! -type d) | sort >"$root/$component.txt"
done

# Every installed file is of one package: an install rule without a component would be of none.
grep -q '^set(CPACK_COMPONENTS_ALL "program;development;documentation")' "$build/CPackConfig.cmake" ||
  fail "CPack makes other packages than program, development, documentation"
cmake --install "$build" --prefix "$root/all" >"$root/install_all.log"
(cd "$root/all" && find . ! -type d) | sort >"$root/all.txt"
sort "$root/program.txt" "$root/development.txt" "$root/documentation.txt" >"$root/sum.txt"
if diff "$root/all.txt" "$root/sum.txt"; then
  echo "components: $(wc -l <"$root/all.txt") files, each in one package"
else
  fail "some files are in no package, or in two"
fi

has() { # component, file...
  component=$1
  shift
  for file in "$@"; do
    [ -e "$root/$component/$file" ] || fail "no $file among the files of $component"
  done
}
has program bin/swiftlet lib/systemd/system/swiftlet.service lib/udev/rules.d/60-swiftlet.rules \
  share/man/man1/swiftlet.1.gz share/swiftlet/foxglove_layout.json share/doc/swiftlet/copyright share/doc/swiftlet/changelog.gz
has development include/swiftlet/estimator/odometry/odometry.hpp share/doc/libswiftlet-dev/copyright
has documentation share/doc/swiftlet/docs/packages.md share/doc/swiftlet/README.md share/doc/swiftlet-doc/copyright
[ -n "$(find "$root/development" -name swiftletConfig.cmake)" ] || fail "no swiftletConfig.cmake"

# The manual page: every command, and nothing that a reader of man pages complains of.
page=$root/swiftlet.1
gzip -dc "$root/program/share/man/man1/swiftlet.1.gz" >"$page"
for command in $("$root/program/bin/swiftlet" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p'); do
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
  said=$(MANPATH="$root/program/share/man" systemd-analyze verify "$root/program/lib/systemd/system/swiftlet.service" \
    2>&1) || true
  # Containers may have no man.
  said=$(echo "$said" | grep -v "Command 'man swiftlet(1)' failed" || true)
  [ -z "$said" ] || fail "systemd-analyze: $said"
  echo "unit file: verified"
else
  skip "unit file: there is no systemd-analyze" "apt-get install systemd, then toolchain/test.sh"
fi

# The example: settings and calibration are accepted, only the devices are not there.
example=$root/program/share/swiftlet/examples/vehicle
"$root/program/bin/swiftlet" settings --brief --settings "$example/vehicle.yaml" >"$root/settings.yaml" ||
  fail "the example's settings are refused"
grep -q 'protocol: vectornav' "$root/settings.yaml" || fail "the example's settings are not taken"
said=$("$root/program/bin/swiftlet" doctor --seconds 0 --settings "$example/vehicle.yaml" \
  --set "vehicle.calibration=$example/rig" | sed -n '/^this vehicle/,/^$/p' | sed 1d)
echo "$said" | grep -q '/dev/v4l/by-path' || fail "doctor does not look for the example's cameras: $said"
if echo "$said" | grep -q '^ *settings '; then fail "doctor refuses the example: $said"; fi
"$root/program/bin/swiftlet" fly --settings "$example/vehicle.yaml" --set "vehicle.calibration=$example/no" \
  --out "$root/flight" 2>"$root/refused.txt" && fail "fly takes a calibration that is not there"
[ $? -le 2 ] && grep -q "$example/no" "$root/refused.txt" || fail "fly does not name the calibration that it lacks"
echo "example of a vehicle: settings and calibration accepted"

# A state folder that cannot be made or written costs a flight its files: nothing in the unit insists on it. A variable
# does not: GStreamer lists its plugins anew where it cannot write.
unit=$root/program/lib/systemd/system/swiftlet.service
if grep -q '^StateDirectory=' "$unit" || grep '^[^#].*/var/lib/swiftlet' "$unit" | grep -v '^Environment=GST_REGISTRY=' | grep -qv '=-'; then
  fail "the unit does not start where its state folder cannot be made"
fi

# The rule that keeps a service with wrong settings from starting again.
code=0
"$root/program/bin/swiftlet" fly --settings "$root/nothing.yaml" --out "$root/flight" 2>/dev/null || code=$?
grep -q "^RestartPreventExitStatus=$code\$" "$unit" ||
  fail "fly ends with $code on wrong settings, and the service starts it again"
for script in postinst prerm postrm; do
  sh -n "$(dirname "$0")/../../toolchain/packaging/debian/$script" || fail "$script is no shell script"
done
[ $failed -eq 0 ] && exit $skipped
