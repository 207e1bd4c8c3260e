"""Runs, a comparison and a data set, made again from their own folders, and compared bit by bit.

Each is made again by another process, from another working directory, with one thread and without
compiled code of before: `analytic` and `physical-optics` in free space and in the living room, each
level of a comparison, a data set in the living room, and a run whose background is a room alone.
Compared are all data sets of ``maps.h5``, both clouds, and the files of samples byte by byte. Last,
one byte of an input is changed, which must be refused with status 2 and one line.

    python validation/robustness/repeated.py [--quick] [--json FILE]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

import rtradar as rt
from rtradar.motion.formats import save_motion
from rtradar.validate.rows import Row, judged, main

RTRADAR = [sys.executable, "-m", "rtradar"]
LEVELS = ("analytic", "physical-optics")
SPEC = """
[windows]
duration_s = 0.3
[each]
radar = ["iwr1443"]
scene = ["{scene}"]
fidelity = ["{fidelity}"]
[[synthetic]]
label = "walk"
count = {half}
[[synthetic]]
label = "kick"
count = {half}
"""
SAYS = "made again from its own folder: values that differ"


def command(*words: object, again: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command; again: in an empty folder of its own, with one thread and nothing compiled."""
    own = {}
    if again is not None:
        again.mkdir()
        own = {"RTRADAR_THREADS": "1", "NUMBA_CACHE_DIR": str(again / "numba")}
    return subprocess.run(
        [*RTRADAR, *map(str, words)],
        cwd=again,
        env={**os.environ, **own},
        capture_output=True,
        text=True,
        check=False,
    )


def made(*words: object, again: Path | None = None) -> None:
    done = command(*words, again=again)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}: {done.stderr}")


def differing(one: Path, other: Path) -> int:
    """Count the values of maps and clouds of two runs that are not the same bits."""
    count = 0
    with h5py.File(one / "maps.h5") as ours, h5py.File(other / "maps.h5") as theirs:
        names: list[str] = []
        ours.visititems(lambda name, what: names.append(name) if hasattr(what, "shape") else None)
        for name in names:
            count += _unlike(ours[name][()], theirs[name][()])
    for cloud in ("cloud_rdt.npz", "cloud_xyz.npz"):
        with np.load(one / cloud) as ours, np.load(other / cloud) as theirs:
            count += sum(_unlike(ours[name], theirs[name]) for name in ours)
    return count


def _unlike(ours: np.ndarray, theirs: np.ndarray) -> int:  # type: ignore[type-arg]
    if ours.shape != theirs.shape:
        return max(ours.size, theirs.size)
    return int(np.count_nonzero((ours != theirs) & ~((ours != ours) & (theirs != theirs))))


def runs(folder: Path, quick: bool) -> Iterator[Row]:
    walk = folder / "walk.motion"
    save_motion(walk, rt.synthetic_motion("walk", seed=1, duration_s=0.5))
    words = "--radar", "iwr1443", "--duration", "0.2", "--quiet"
    cases = [(level, scene) for level in LEVELS for scene in ("free-space", "living-room")]
    for number, (level, scene) in enumerate(cases[:1] if quick else cases):
        out, again = folder / f"run{number}", folder / f"again{number}"
        made("run", walk, "--fidelity", level, "--scene", scene, *words, "--out", out)
        made("run", out / "run.toml", "--quiet", "--out", again / "out", again=again)
        found = differing(out, again / "out")
        yield judged(f"{level}, {scene}", "values that differ", "", found, 0, says=f"a run {SAYS}")
    content = walk.read_bytes()
    walk.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    refused = command("run", out / "run.toml", "--out", folder / "changed")
    walk.write_bytes(content)
    wrong = (refused.returncode != 2) + (refused.stderr.count("\n") != 1)
    says = "one byte of an input changed: not refused in one line"
    yield judged("one byte of a recording", "faults of the answer", "", wrong, 0, says=says)
    if quick:
        return
    empty, out, again = folder / "empty", folder / "cleared", folder / "again-cleared"
    made("run", "--scene", "living-room", *words, "--out", empty)
    room = "--scene", "living-room", "--background", empty
    made("run", walk, *room, *words, "--out", out)
    made("run", out / "run.toml", "--quiet", "--out", again / "out", again=again)
    found = differing(out, again / "out")
    yield judged("with a background", "values that differ", "", found, 0, says=f"a run {SAYS}")


def comparison(folder: Path) -> Iterator[Row]:
    words = "--fidelities", ",".join(LEVELS), "--radar", "iwr1443", "--scene", "living-room"
    made("compare", "synthetic:kick", *words, "--duration", "0.2", "--out", folder / "compared")
    for level in LEVELS:
        own, again = folder / "compared" / level, folder / f"compared-{level}"
        made("run", own / "run.toml", "--quiet", "--out", again / "out", again=again)
        found = differing(own, again / "out")
        says = f"a comparison {SAYS}"
        yield judged(f"comparison, {level}", "values that differ", "", found, 0, says=says)


def data_set(folder: Path, quick: bool) -> Iterator[Row]:
    spec, out, again = folder / "set.toml", folder / "set", folder / "again-set"
    chosen = ("free-space", "analytic", 2) if quick else ("living-room", "specular", 20)
    values = dict(zip(("scene", "fidelity", "half"), chosen, strict=True))
    spec.write_text(SPEC.format(**values))
    made("dataset", "build", spec, "--out", out)
    made("dataset", "build", out / "collection.toml", "--out", again / "set", again=again)
    ours = {path.name: path.read_bytes() for path in out.glob("*.npz")}
    theirs = {path.name: path.read_bytes() for path in (again / "set").glob("*.npz")}
    names = ours.keys() | theirs.keys()
    found = sum(ours.get(name) != theirs.get(name) for name in names)
    claim = f"data set of {len(ours)} samples"
    yield judged(claim, "samples that differ", "", found, 0, says=f"a data set {SAYS}")


def rows(quick: bool) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = [*runs(folder, quick), *data_set(folder, quick)]
        return found if quick else [*found, *comparison(folder)]


if __name__ == "__main__":
    sys.exit(main(__doc__, rows))
