#!/bin/sh
# Installs the Debian 12 packages that swiftlet needs, as root or through sudo.
# usage: toolchain/install.sh [test] [optional]
#   (nothing)  what building and running needs        packages.txt
#   test       also tests, benchmarks, fuzzers, lints  packages_test.txt
#   optional   also what adds features when present   packages_optional.txt (may fail),
#              and where there is no npm               packages_report.txt (may fail)
# Packages that are present are left alone; when all are, nothing is run.
set -eu
here=$(cd "$(dirname "$0")" && pwd)

names() { sed -e 's/#.*//' -e '/^[[:space:]]*$/d' "$here/$1"; }

missing_of() {
  for name in $(names "$1"); do
    status=$(dpkg-query -W -f='${db:Status-Abbrev}' "$name" 2>/dev/null || true)
    case $status in ii*) ;; *) printf '%s ' "$name" ;; esac
  done
}

as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  elif command -v sudo >/dev/null 2>&1; then
    sudo "$@"
  else
    echo "install: neither root nor sudo; run as root: $*" >&2
    exit 2
  fi
}

updated=no
install_list() { # file, what it is for
  missing=$(missing_of "$1")
  if [ -z "$missing" ]; then
    echo "install: packages $2: all present"
    return 0
  fi
  if ! command -v apt-get >/dev/null 2>&1; then
    echo "install: no apt-get here; install by hand, $2: $missing" >&2
    return 2
  fi
  echo "install: packages $2: apt-get install $missing"
  if [ $updated = no ]; then
    as_root apt-get update -qq
    updated=yes
  fi
  # shellcheck disable=SC2086 # a list of names, one argument each
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing
}

with_test=no
with_optional=no
for argument in "$@"; do
  case $argument in
    test) with_test=yes ;;
    optional) with_optional=yes ;;
    *)
      sed -n '2,8s/^# \{0,1\}//p' "$0"
      exit 2
      ;;
  esac
done

if ! command -v dpkg-query >/dev/null 2>&1; then
  echo "install: not a Debian system; the packages needed are in $here/packages*.txt" >&2
  exit 2
fi
install_list packages.txt "to build"
if [ $with_test = yes ]; then install_list packages_test.txt "to test"; fi
if [ $with_optional = yes ]; then
  install_list packages_optional.txt "optional" || echo "install: going on without optional packages"
  if ! command -v npm >/dev/null 2>&1; then
    install_list packages_report.txt "for the report's page" || echo "install: going on without npm"
  fi
fi
