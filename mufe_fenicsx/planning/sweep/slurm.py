"""A sweep as one array of jobs of SLURM."""

import shlex
import sys
from pathlib import Path

from ...machine.files import write_atomically
from .runs import arguments_of

#: Names of the files: the job, and a line of arguments for each run.
JOB, LINES = "array.sh", "runs.txt"

SCRIPT = """\
#!/bin/bash
# Runs of a sweep, one a task: sbatch {job}
# Times and partitions are yours to state. A run that meets its time limit goes on in a job that
# puts itself back into the queue; one that is finished is left as it is.
#SBATCH --job-name=mufe-sweep
#SBATCH --array=1-{number}
#SBATCH --ntasks={ranks}
#SBATCH --cpus-per-task=1
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@120
#SBATCH --requeue
#SBATCH --open-mode=append
set -u
cd {here} || exit 2
export OMP_NUM_THREADS=1
eval "set -- $(sed -n "${{SLURM_ARRAY_TASK_ID}}p" {lines})"
folder=$4

grep -qs '"finished": true' "$folder/run.json" && exit 0
again=()
if compgen -G "$folder/checkpoints/step-*/manifest.json" > /dev/null; then
    again=(--resume)
elif [ -d "$folder" ]; then
    again=(--overwrite)
fi
srun {python} -m mufe_fenicsx "$@" "${{again[@]}}"
status=$?
if [ "$status" -eq 143 ]; then  # SIGTERM: there is a checkpoint
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}"
fi
exit "$status"
"""


def write_array(sweep, folder, grains, num_ranks) -> Path:
    """Write the job of all runs into the folder of a sweep; its path.

    Args:
        sweep: :class:`~.plan.Sweep`.
        folder: Of the sweep.
        grains: Folder of the grains of each run, or None.
        num_ranks: Of each run.
    """
    folder = Path(folder).resolve()
    lines = [
        shlex.join(arguments_of(sweep, number, folder, grains[number]))
        for number in range(len(sweep.rows))
    ]
    write_atomically(folder / LINES, "\n".join(lines) + "\n")
    text = SCRIPT.format(
        job=shlex.quote(str(folder / JOB)), number=len(lines), ranks=num_ranks,
        here=shlex.quote(str(Path.cwd())), lines=shlex.quote(str(folder / LINES)),
        python=shlex.quote(sys.executable),
    )  # fmt: skip
    write_atomically(folder / JOB, text)
    return folder / JOB
