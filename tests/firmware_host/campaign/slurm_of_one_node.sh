# Sourced: starts a Slurm of this machine alone, as root, in the folder $1; it ends with the shell that sourced this.
# Without authentication, on ports of its own, beside whatever Slurm the machine may have.
slurm=$1
mkdir -p "$slurm/state" "$slurm/spool"
export SLURM_CONF=$slurm/slurm.conf
cat >"$SLURM_CONF" <<EOF
ClusterName=test
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=26817
SlurmdPort=26818
SlurmUser=root
AuthType=auth/none
CredType=cred/none
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SchedulerType=sched/builtin
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
StateSaveLocation=$slurm/state
SlurmdSpoolDir=$slurm/spool
SlurmctldPidFile=$slurm/slurmctld.pid
SlurmdPidFile=$slurm/slurmd.pid
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
EOF
slurmctld -D >"$slurm/slurmctld.log" 2>&1 &
slurmctld=$!
slurmd -D >"$slurm/slurmd.log" 2>&1 &
slurmd=$!
trap 'kill $slurmd $slurmctld 2>/dev/null; wait' EXIT
for _ in $(seq 300); do
  if sinfo --noheader --states=idle --format=%n 2>/dev/null | grep -q .; then break; fi
  sleep 0.1
done
sinfo --noheader --states=idle --format=%n | grep -q . || {
  tail -20 "$slurm/slurmctld.log" "$slurm/slurmd.log"
  exit 1
}
