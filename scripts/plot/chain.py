"""Long runs as chains of restarts: each call goes on from the newest checkpoint and adds its wall time to `wall.csv`."""

import csv
import json
import os
import pathlib
import subprocess


def advance(program, case, folder, settings, minutes, ranks=1, threads=None):
    """Begins a run or goes on with it for so many minutes of wall time, at most 100; True when it has come to its end.

    `settings` are `--set` keys with TOML values. One rank runs on `threads` threads, all cores by default.
    """
    folder = pathlib.Path(folder)
    command = [program, "run", case, "--out", folder]
    for key, value in {**settings, "output.wall_time_limit": 60.0 * min(minutes, 100)}.items():
        command += ["--set", f"{key}={value}"]
    if any((folder / "checkpoint").glob("step_*/index.json")):
        command.append("--resume")
    if ranks > 1:
        command = ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", ranks, *command]
    extra = {"RAYON_NUM_THREADS": str(threads)} if threads else {}
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    subprocess.run(list(map(str, command)), env={**os.environ, **root, **extra}, check=True, stdout=subprocess.DEVNULL)
    summary = json.loads((folder / "summary.json").read_text())
    lines = folder / "wall.csv"
    new = not lines.exists()
    with open(lines, "a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(["steps", "time", "wall_seconds", "ranks", "threads", "seconds_per_node_step"])
        cost = summary["fluid"]["seconds_per_node_step"]
        row = [summary["steps"], summary["simulated_time"], summary["wall_seconds"], summary["ranks"], summary["threads"], cost]
        writer.writerow(row)
    return summary["stopped_by"] == "end"


def wall_seconds(folder):
    """Wall time of all calls so far."""
    with open(pathlib.Path(folder) / "wall.csv") as file:
        return sum(float(row["wall_seconds"]) for row in csv.DictReader(file))
