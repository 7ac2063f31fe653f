# For the shell tests of the sandbox: what is checked, a line each, and how many failed.
# shellcheck shell=bash
failed=0

check() { # what, condition...
  local what=$1
  shift
  if "$@"; then
    echo "ok    $what"
  else
    echo "FAIL  $what"
    failed=$((failed + 1))
    return 1
  fi
}
