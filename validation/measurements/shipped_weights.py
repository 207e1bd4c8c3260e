"""Train the weights that come with the package: actors, their clouds, networks, in one command.

    python validation/measurements/shipped_weights.py OUT [--takes N] [--networks N] [--install]

Builds what OUT lacks of the data sets `actors_strike.toml` and `actors_random.toml`, trains on one
thread, and writes OUT/weights.npz, which follows from the code and the seed alone. With --install
it becomes the weights of the package. The time of both steps is printed.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from pathlib import Path

import torch

from rtradar.classify.weights import train_recogniser
from rtradar.clouds.collection import Collection
from rtradar.radar import Radar
from rtradar.recognition.recogniser import WEIGHTS

DATA_SETS = Path(__file__).resolve().parents[1]
NAMES = ("actors_strike", "actors_random")


def build(out: Path, takes: int | None, workers: int) -> list[Path]:
    """Build what is missing of both data sets, of fewer takes if a number is given."""
    out.mkdir(parents=True, exist_ok=True)
    shutil.copy(DATA_SETS / "few_channels.toml", out)
    for name in NAMES:
        text = (DATA_SETS / f"{name}.toml").read_text()
        if takes is not None:
            text = text.replace("count = 200", f"count = {takes}")
        (out / f"{name}.toml").write_text(text)
        words = ["dataset", "build", f"{name}.toml", "--out", name, "--workers", str(workers)]
        subprocess.run([sys.executable, "-m", "rtradar", *words], check=True, cwd=out)
    return [out / name for name in NAMES]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of clouds and weights")
    parser.add_argument("--takes", type=int, help="takes of each activity (default: 200)")
    parser.add_argument("--networks", type=int, default=5, help="number of networks")
    parser.add_argument("--workers", type=int, default=2, help="processes that make clouds")
    parser.add_argument("--install", action="store_true", help="replace the package's weights")
    options = parser.parse_args()
    began = time.perf_counter()
    folders = build(options.out, options.takes, options.workers)
    built = time.perf_counter()
    torch.set_num_threads(1)
    radar = Radar.load(DATA_SETS / "few_channels.toml")
    recogniser = train_recogniser(Collection(*folders), radar, networks=options.networks)
    path = options.out / "weights.npz"
    recogniser.save(path)
    print(
        f"clouds {built - began:.0f} s, training {time.perf_counter() - built:.0f} s "
        f"({recogniser.card['training_cpu_s']:.0f} s of CPU); "
        f"{recogniser.card['held_out_accuracy']:.1%} of actors that were left out are known; "
        f"{path} has {path.stat().st_size / 1e6:.2f} MB"
    )
    if options.install:
        shutil.copy(path, WEIGHTS)
    return 0


if __name__ == "__main__":
    sys.exit(main())
