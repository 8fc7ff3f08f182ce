#!/usr/bin/env bash
# Runs a Slurm cluster of three one-core nodes on this machine, for tests: as root, on loopback
# only, without systemd and cgroups.
#
#   scripts/slurm-cluster.sh DIR PORT PORT PORT PORT
#
# DIR is created and contains all files; the ports (of the controller and the nodes) must be free.
# Prints "up" once the nodes are idle: then use the cluster with SLURM_CONF=DIR/slurm.conf. Reads
# commands from standard input: "kill n2" kills a node and its jobs, "start n2" restarts the node;
# the reply to each is "done". The cluster stops when standard input ends, so that no process
# outlives a test that was killed.
set -eu

[ $# = 5 ] || { echo "usage: $0 DIR PORT PORT PORT PORT" >&2 && exit 2; }
# Slurm resolves the host name at every step, and waits a long time if this fails.
if ! getent hosts "$(hostname -s)" >/dev/null; then
    echo "$0: unknown host $(hostname -s): expected a line for 127.0.0.1 in /etc/hosts" >&2
    exit 1
fi

mkdir -p "$1"
dir=$(realpath "$1") controller_port=$2
shift 2
nodes='n1 n2 n3'
host=$(hostname -s)
conf=$dir/slurm.conf
# Not exported: otherwise, the processes that stop the cluster would count as part of it.
unset SLURM_CONF

# Lists the processes of this cluster and its jobs, which inherit SLURM_CONF from the daemons.
all() { grep -lzxF "SLURM_CONF=$conf" /proc/[0-9]*/environ 2>/dev/null | cut -d/ -f3; }

# Lists the processes of a node: its daemons run in its spool folder, and its jobs have its name in
# the environment.
of_node() {
    for pid in $(all); do
        if [ "$(readlink "/proc/$pid/cwd")" = "$dir/spool-$1" ] ||
            grep -qzxF "SLURMD_NODENAME=$1" "/proc/$pid/environ" 2>/dev/null; then
            echo "$pid"
        fi
    done
}

# Kills the processes listed by a command, and any that they start in the meantime.
end() {
    while pids=$("$@") && [ -n "$pids" ]; do
        # shellcheck disable=SC2086 # one word per process
        kill -9 $pids 2>/dev/null || true
        sleep 0.05
    done
}

trap 'trap - EXIT; end all' EXIT
trap 'exit 1' INT TERM HUP

run() {
    log=$dir/log/$1
    shift
    SLURM_CONF=$conf "$@" >>"$log" 2>&1 </dev/null &
    # Otherwise, the shell would report the process as killed.
    disown
}

start_node() {
    cd "$dir/spool-$1"
    run "$1" slurmd -D -c -N "$1"
    cd "$dir"
}

# Repeats a command until it succeeds, for at most half a minute.
until_true() {
    give_up=$((SECONDS + 30))
    while [ $SECONDS -lt $give_up ]; do
        if "$@"; then return; fi
        sleep 0.1
    done
    echo "$0: timed out waiting for: $*" >&2
    for log in "$dir"/log/*; do tail -n 5 "$log" >&2; done
    exit 1
}

all_idle() { [ "$(SLURM_CONF=$conf sinfo --noheader --Node --format=%T 2>/dev/null | grep -cx idle)" = 3 ]; }

mkdir "$dir"/{log,state,munge}
# munged requires that everyone can access its socket, and that nobody else can access its key.
chmod 755 "$dir"
chmod 700 "$dir/munge"
(umask 077 && head -c 1024 /dev/urandom >"$dir/munge/key")

{
    cat <<EOF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$controller_port
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$dir/munge.socket
CredType=cred/munge
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool-%n
SlurmctldPidFile=$dir/controller.pid
SlurmdPidFile=$dir/%n.pid
# No plugins that need a cgroup, a database or MPI.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
# One core per node, regardless of this machine's cores.
SlurmdParameters=config_overrides
# A failed node is detected quickly, and is used again as soon as it has restarted.
SlurmdTimeout=10
ReturnToService=2
SchedulerParameters=sched_interval=1,sched_min_interval=0,batch_sched_delay=0,bf_interval=1
KillWait=5
# A low limit, so that a test can exceed it.
MaxArraySize=101
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE
EOF
    for node in $nodes; do
        echo "NodeName=$node NodeHostname=$host NodeAddr=127.0.0.1 Port=$1 CPUs=1 RealMemory=256"
        shift
    done
} >"$conf"

run munge munged --foreground --force --socket="$dir/munge.socket" --key-file="$dir/munge/key" \
    --pid-file="$dir/munge/pid" --seed-file="$dir/munge/seed" --log-file="$dir/munge/log"
until_true test -S "$dir/munge.socket"
run controller slurmctld -D -c
for node in $nodes; do
    mkdir "$dir/spool-$node"
    start_node "$node"
done
until_true all_idle
echo up

while read -r verb node; do
    case $verb in
        kill) end of_node "$node" ;;
        start) start_node "$node" ;;
        *) echo "$0: unknown command $verb: expected kill or start" >&2 && exit 2 ;;
    esac
    echo 'done'
done
