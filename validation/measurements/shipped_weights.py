"""Train the weights that come with the package: actors, their clouds, a forest, in one command.

    python validation/measurements/shipped_weights.py OUT [--install]

Builds what OUT lacks of the data sets `validation/actors.toml` and `validation/other_actors.toml`,
trains, and writes OUT/weights.npz, which follows from the code and the seed alone. With --install
it becomes the weights of the package. The time of both steps is printed.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from pathlib import Path

from rtradar.classify.forests import train_recogniser
from rtradar.clouds.collection import Collection
from rtradar.radar import Radar
from rtradar.recognition.recogniser import WEIGHTS

DATA_SETS = Path(__file__).resolve().parents[1]
NAMES = ("actors", "other_actors")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of clouds and weights")
    parser.add_argument("--install", action="store_true", help="replace the package's weights")
    options = parser.parse_args()
    began, folders = time.perf_counter(), [options.out / name for name in NAMES]
    for folder in folders:
        words = ["dataset", "build", str(DATA_SETS / f"{folder.name}.toml"), "--out", str(folder)]
        subprocess.run([sys.executable, "-m", "rtradar", *words], check=True)
    built = time.perf_counter()
    radar = Radar.load(DATA_SETS / "few_channels.toml")
    recogniser = train_recogniser(Collection(*folders), radar)
    path = options.out / "weights.npz"
    recogniser.save(path)
    print(
        f"clouds {built - began:.0f} s, training {time.perf_counter() - built:.0f} s; "
        f"{recogniser.card['held_out_accuracy']:.1%} of actors that were left out are known; "
        f"{path} has {path.stat().st_size / 1e6:.2f} MB"
    )
    if options.install:
        shutil.copy(path, WEIGHTS)
    return 0


if __name__ == "__main__":
    sys.exit(main())
