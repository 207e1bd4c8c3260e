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
from collections import Counter
from pathlib import Path

import numpy as np

from rtradar.campaign.recogniser import Taught, train_recogniser
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.recognition import UNKNOWN, Recogniser
from rtradar.recognition.recogniser import WEIGHTS, cut_windows, describe

DATA_SETS = Path(__file__).resolve().parents[1]
NAMES = ("actors", "other_actors")


ANSWERS = {
    "walk": "walk",
    "kick": "kick",
    "punch": "punch",
    "boxing": "punch",
    "jumping_jack": "jumping_jack",
}
"""What is answered about the activities of actors; about all others it is `UNKNOWN`."""


def taught_by(clouds: Collection) -> Taught:
    """Describe the first window of each cloud of actors.

    Actors who do something else than `ANSWERS` names are learnt as one more class, `UNKNOWN`.

    Parameters
    ----------
    clouds : Collection
        Clouds in windows that begin at random, each as long as a capture.

    Returns
    -------
    Taught

    Raises
    ------
    InputError
        If a cloud is of a recording.
    """
    if set(clouds.column("source").tolist()) != {"synthetic"}:
        raise InputError("weights that are given away learn from synthetic actors alone")
    lengths = clouds.column("duration_s").astype(float)
    numbers = [
        describe(cut_windows(clouds.points(index), length)[0])
        for index, length in enumerate(lengths)
    ]
    labels = [ANSWERS.get(label, UNKNOWN) for label in clouds.labels.tolist()]
    return Taught(np.array(numbers), np.array(labels), clouds.column("subject").astype(str))


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
    radar, clouds = Radar.load(DATA_SETS / "few_channels.toml"), Collection(*folders)
    made = train_recogniser(taught_by(clouds), radar)
    snr_db = clouds.column("snr_db").astype(float)
    card = {
        "snr_db": [float(snr_db.min()), float(snr_db.max())],
        "clouds": dict(Counter(clouds.labels.tolist())),
    }
    recogniser = Recogniser(made.forest, made.card | card)
    right = np.mean(list(recogniser.card["held_out"].values()))
    path = options.out / "weights.npz"
    recogniser.save(path)
    print(
        f"clouds {built - began:.0f} s, training {time.perf_counter() - built:.0f} s; "
        f"{right:.1%} of actors that were left out are known; "
        f"{path} has {path.stat().st_size / 1e6:.2f} MB"
    )
    if options.install:
        shutil.copy(path, WEIGHTS)
    return 0


if __name__ == "__main__":
    sys.exit(main())
