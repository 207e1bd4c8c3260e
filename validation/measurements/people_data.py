"""Data sets of recorded people and of actors, in windows round the strikes, for `people.py`."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from collections import Counter
from functools import partial
from pathlib import Path

import rtradar as rt

HEAD = """
seed = 0
folder = "{folder}"
[windows]
duration_s = 1.6
place = "strike"
count = 2
[each]
radar = ["few_channels.toml"]
scene = ["free-space"]
fidelity = ["analytic"]
[drawn]
heading_deg = [-30.0, 30.0]
snr_db = [15.0, 25.0]
offset_x_m = [-0.3, 0.3]
offset_y_m = [-0.3, 0.3]
"""
KEPT = 'keep = ["spectrograms"]\n'
FEW = Path(__file__).resolve().parents[1] / "few_channels.toml"
ACTIVITIES = {
    "walk": "walk",
    "kick": "kick",
    "punch": "punch",
    "punching": "punch",
    "jumping_jack": "jumping_jack",
    "jumping_jacks": "jumping_jack",
}
"""Activities of an actor by the names that the recordings have."""

WINDOW_S = 1.6


def of_mocap(folder: Path, *, known: bool = True) -> str:
    """Specification of the recordings with skeletons; those too short for a window are left out.

    They are of `ACTIVITIES`, or of all others.
    """
    text = ""
    for row in csv.DictReader((folder / "MANIFEST.csv").open()):
        if (row["activity"] in ACTIVITIES) != known or row["format"] not in ("AMC", "BVH"):
            continue
        rate, frames = float(row["fps"]), int(row["frames"])
        first, last = (int(row[key]) for key in ("start_frame", "end_frame"))
        start_s, end_s, length_s = (first - 1) / rate, last / rate, (frames - 1) / rate
        spare = max(0.0, WINDOW_S + 0.2 - (end_s - start_s)) / 2  # of an activity that is shorter
        start_s, end_s = max(0.0, start_s - spare), min(length_s - 1e-4, end_s + spare)
        if end_s - start_s < WINDOW_S:
            continue
        text += _recording(row["file"], row["activity"], row["subject"], start_s, end_s)
        if row["skeleton_file"]:
            text += f'skeleton = "{row["skeleton_file"]}"\n'
    return text


def of_joints(folder: Path, most: int, *, known: bool = True) -> str:
    """Specification of the recordings of joint positions, ``most`` of each person and activity.

    They are of `ACTIVITIES`, or of all others.
    """
    text, taken = "", Counter[tuple[str, str]]()
    for row in csv.DictReader((folder / "MANIFEST.csv").open()):
        if (row["activity"] in ACTIVITIES) != known:
            continue
        if long_enough(folder / row["file"]):
            taken[row["person"], row["activity"]] += 1
            if taken[row["person"], row["activity"]] > most:
                continue
            text += _recording(
                row["file"], row["activity"], f"{row['dataset']}_{row['person']}", 0.0
            )
    return text


def long_enough(recording: Path) -> bool:
    """Whether a file of joint positions holds a window.

    Where it has a gap it is read from one side alone, and is shorter than its manifest says.
    """
    return rt.load_motion(recording).duration_s > WINDOW_S + 0.05


def _recording(
    file: str, activity: str, subject: str, start_s: float, end_s: float | None = None
) -> str:
    until = "" if end_s is None else f"end_s = {end_s:.4f}\n"
    return (
        f'[[recordings]]\nfile = "{file}"\nlabel = "{ACTIVITIES.get(activity, activity)}"\n'
        f'subject = "{subject}"\nlicence = "see its folder"\nstart_s = {start_s:.4f}\n{until}'
    )


def data_sets(out: Path, most: int) -> dict[str, str]:
    """Text of the specification of every data set, by its name."""
    (out / "few_channels.toml").write_bytes(FEW.read_bytes())
    found = {"actors": KEPT + (FEW.parent / "actors.toml").read_text()}
    for name, variable, of in (
        ("mocap", "RTRADAR_MOCAP", of_mocap),
        ("joints", "RTRADAR_JOINTS", partial(of_joints, most=most)),
    ):
        if folder := os.environ.get(variable):
            head = HEAD.format(folder=f"${{{variable}}}")
            found[name] = KEPT + head + of(Path(folder))
            found[f"{name}_all_channels"] = found[name].replace(FEW.name, "paper-12ghz")
            found[f"{name}_others"] = head + of(Path(folder), known=False)
    return found


def build(out: Path, only: list[str] | None, most: int) -> None:
    """Build the data sets that are not complete."""
    out.mkdir(parents=True, exist_ok=True)
    for name, text in data_sets(out, most).items():
        if only is None or name in only:
            spec = out / f"{name}.toml"
            spec.write_text(text)
            words = ["dataset", "build", str(spec), "--out", str(out / name)]
            subprocess.run([sys.executable, "-m", "rtradar", *words], check=True)
