"""Reading a run: its folder, summary and series."""

import json
import pathlib
import sys

import pandas as pd

ROOT = pathlib.Path(__file__).resolve().parents[2]


def folder(name):
    """Folder of the run: the first argument, or runs/NAME."""
    return pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "runs" / name


def summary(run):
    return json.loads((run / "summary.json").read_text())


def series(run, name):
    return pd.read_csv(run / "series" / f"{name}.csv")


def picture(run, name):
    """Path of a picture; the folder is made."""
    (run / "pictures").mkdir(exist_ok=True)
    return run / "pictures" / name
