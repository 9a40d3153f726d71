#!/bin/bash
# A test on a cluster that outlives its time limit: sbatch demos/slurm.sh SCENE FOLDER
#
# Two minutes before the limit Slurm sends SIGTERM to the ranks; they write a checkpoint and leave. The job
# then puts itself back into the queue and goes on from there, to the same bits on as many ranks.
#SBATCH --job-name=mufe
#SBATCH --ntasks=64
#SBATCH --cpus-per-task=1
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@120
#SBATCH --requeue
#SBATCH --open-mode=append
set -u
scene=$1 folder=$2

# One thread a rank: a rank is a core. Compiled kernels are kept where all nodes find them.
export OMP_NUM_THREADS=1
export NUMBA_CACHE_DIR=${NUMBA_CACHE_DIR:-$HOME/.cache/mufe_fenicsx/numba}

resume=""
[ -d "$folder/checkpoints" ] && resume="--resume"
srun mufe run "$scene" -o "$folder" $resume --quiet
status=$?

# 128 + SIGTERM, as a shell counts signals; 0 is the end of the test, 1 and 2 are errors.
if [ "$status" -eq 143 ]; then
    scontrol requeue "$SLURM_JOB_ID"
fi
exit "$status"
