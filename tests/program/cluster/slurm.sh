#!/bin/bash
# Runs Slurm on one machine: munged, slurmctld and slurmd on loopback, with their configuration and state in one folder.
#
#   slurm.sh start DIR    starts them and waits until the node accepts jobs; prints the reason if it does not
#   slurm.sh stop DIR     stops them
#
# Nothing outside DIR is read or written. Must run as root, since slurmd does.
set -u
action=$1
dir=$2
port=${SLURM_TEST_PORT:-17817}

stop() {
  for name in slurmd slurmctld munged; do
    if [ -s "$dir/$name.pid" ]; then
      pid=$(cat "$dir/$name.pid")
      kill "$pid" 2>/dev/null
      for _ in $(seq 50); do kill -0 "$pid" 2>/dev/null || break; sleep 0.1; done
      kill -9 "$pid" 2>/dev/null
    fi
  done
  return 0
}

if [ "$action" = stop ]; then
  stop
  exit 0
fi

for program in munged slurmctld slurmd sbatch squeue scontrol scancel; do
  command -v "$program" >/dev/null || { echo "$program is not installed"; exit 1; }
done
[ "$(id -u)" = 0 ] || { echo "slurmd has to be started by root"; exit 1; }

mkdir -p "$dir/state" "$dir/spool"
chmod 755 "$dir"
host=$(hostname -s)
dd if=/dev/urandom of="$dir/munge.key" bs=128 count=1 2>/dev/null
chmod 400 "$dir/munge.key"
cat >"$dir/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$dir/munge.sock,cred_expire=5
CredType=cred/munge
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
SchedulerParameters=sched_min_interval=100000,batch_sched_delay=0
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=5
MinJobAge=600
NodeName=$host NodeAddr=127.0.0.1 CPUs=8 State=UNKNOWN
PartitionName=short Nodes=$host Default=YES MaxTime=01:00:00 State=UP
CONF
: >"$dir/cgroup.conf"
export SLURM_CONF=$dir/slurm.conf

munged --force --socket="$dir/munge.sock" --key-file="$dir/munge.key" --pid-file="$dir/munged.pid" \
  --log-file="$dir/munged.log" --seed-file="$dir/munged.seed" || { echo "munged does not start"; exit 1; }
slurmctld -f "$SLURM_CONF" || { stop; echo "slurmctld does not start"; exit 1; }
slurmd -f "$SLURM_CONF" || { stop; echo "slurmd does not start"; exit 1; }
for _ in $(seq 150); do
  if [ "$(sinfo --noheader --format=%T 2>/dev/null)" = idle ]; then exit 0; fi
  sleep 0.2
done
echo "the node takes no jobs: $(sinfo 2>&1); $(tail -3 "$dir/slurmd.log" "$dir/slurmctld.log" 2>&1)"
stop
exit 1
