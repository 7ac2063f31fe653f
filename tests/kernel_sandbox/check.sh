#!/bin/bash
# Checks toolchain/kernel_sandbox/run.sh: exit codes, output, time limit, what may be written, nothing left behind.
set -u
run=$(cd "$(dirname "$0")/../.." && pwd)/toolchain/kernel_sandbox/run.sh
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
. "$(dirname "$0")/checks.sh"
cd "$folder" || exit 1

left_behind() { # folders of jobs, and kernels whose files lie in our temporary folder
  find "$folder" -maxdepth 1 -name 'swiftlet_sandbox.*'
  grep -lsz "[u]ml_dir=$folder/" /proc/[0-9]*/cmdline
}

# Where there is no kernel, this test is skipped too.
TMPDIR=$folder "$run" true
code=$?
if [ $code = 77 ]; then exit 77; fi
check "a command that succeeds: 0" test $code = 0
SWIFTLET_SANDBOX_KERNEL=$folder/none "$run" true 2>words
check "no kernel: 77" test $? = 77
check "no kernel: says what to do" grep -q build_kernel.sh words
"$run" >/dev/null 2>&1
check "no command: 2" test $? = 2

export TMPDIR=$folder A_WORD='two words; $HOME "quoted"'
"$run" bash -c 'echo "out $A_WORD|$1"; echo err >&2; cat; exit 7' name 'an argument' >out 2>err <<<'not read'
check "exit code" test $? = 7
check "standard output, environment, arguments" test "$(cat out)" = "out $A_WORD|an argument"
check "standard error" test "$(cat err)" = err || sed 's/^/      was: /' err
"$run" bash -c 'kill -KILL $$' 2>/dev/null
check "killed: 128 + signal" test $? = 137
"$run" bash -c 'head -c 3000000 /dev/zero | tr "\0" x; sleep 1000 & exit 3' >out
check "a process left running does not hold it up" test $? = 3
check "three million bytes of output" test "$(stat -c %s out)" = 3000000

"$run" bash -c 'echo kept >kept; (cd /tmp && echo gone >swiftlet_gone) && ! echo x >/etc/swiftlet_gone' 2>/dev/null
check "only the shared folder is written to" test $? = 0
check "what is written there stays" test "$(cat kept)" = kept
check "what is written to /tmp does not" bash -c 'cd /tmp && test ! -e swiftlet_gone'

"$run" bash -c 'test -c $SANDBOX_CAMERA0 -a -c $SANDBOX_CAMERA1 -a -c $SANDBOX_OUTPUT0 -a -c $SANDBOX_OUTPUT1 -a \
  -c $SANDBOX_GPIO -a -d $SANDBOX_GPIO_SYSFS && ip link show up $SANDBOX_CAN | grep -q "mtu 72"'
check "cameras, GPIO chip, CAN bus" test $? = 0

begin=$SECONDS
SWIFTLET_SANDBOX_TIME=simulated "$run" bash -c 'begin=$SECONDS; sleep 300; exit $((SECONDS - begin > 298 ? 5 : 1))'
check "five simulated minutes" test $? = 5 -a $((SECONDS - begin)) -lt 60

SWIFTLET_SANDBOX_TIMEOUT=3 "$run" sleep 1000 2>words
check "time limit: 124" test $? = 124
"$run" sleep 1000 2>/dev/null &
sleep 2
kill -TERM $!
wait $!
check "ended by a signal: 143" test $? = 143
"$run" bash -c 'exit 11' &
first=$!
"$run" bash -c 'exit 12' &
wait $first
check "two at once: the first" test $? = 11
wait $!
check "two at once: the second" test $? = 12
sleep 0.5
check "nothing left behind" test -z "$(left_behind)"
exit $((failed > 0))
