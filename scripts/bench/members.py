"""Members of a validation that go on from their last checkpoint, a given time in each call."""

import argparse
import json
import os
import pathlib
import subprocess

import harness
import pandas as pd


def options(description, name, members, quick):
    """Command line of a validate.py: members to run, minutes, program, folder."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--members", nargs="+", default=list(members), choices=list(members))
    parser.add_argument("--minutes", type=float, default=60, help="wall time of each member in this call, at most 100; 0 looks at what is there")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help=", ".join(quick) + " alone")
    parser.add_argument("--program", type=pathlib.Path, default=harness.PROGRAM)
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "validate" / name)
    found = parser.parse_args()
    if found.quick:
        found.members = quick
    found.minutes = min(found.minutes, 100)
    found.out.mkdir(parents=True, exist_ok=True)
    return found


def run(options, case, label, settings):
    """Folder of a member, run for the given time unless it has ended."""
    folder = options.out / "runs" / label
    if options.minutes <= 0 or ended(folder):
        return folder
    command = [options.program, "run", case, "--out", folder]
    command += [f"--set={key}={value}" for key, value in settings.items()]
    command.append(f"--set=output.wall_time_limit={60.0 * options.minutes}")
    if any((folder / "checkpoint").glob("step_*/index.json")):
        command.append("--resume")
    environment = os.environ | {"RAYON_NUM_THREADS": str(options.threads)}
    subprocess.run(list(map(str, command)), env=environment, check=True, stdout=subprocess.DEVNULL)
    return folder


def ended(folder):
    """True when the run has come to its end; `summary.json` says why it stopped."""
    summary = folder / "summary.json"
    return summary.exists() and json.loads(summary.read_text())["stopped_by"] == "end"


def series(folder, name):
    """A series by time, or None where it is not there."""
    path = folder / "series" / f"{name}.csv"
    return pd.read_csv(path).set_index("time") if path.exists() else None


def summary(folder):
    path = folder / "summary.json"
    return json.loads(path.read_text()) if path.exists() else {}
