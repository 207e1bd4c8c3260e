"""Picture of the README: a synthetic walk in the living room, as `rtradar view` shows it.

python validation/picture.py [--out validation/picture.png]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import rtradar as rt
from rtradar.pipeline.output.view import view

MOMENT_S = 1.3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("picture.png"))
    options = parser.parse_args()
    motion = rt.synthetic_motion("walk", seed=0, duration_s=3.0)
    radar, room = rt.Radar.preset("paper-12ghz"), rt.Scene.load("living-room")
    with tempfile.TemporaryDirectory() as folder:
        rt.run(motion, radar, room, out=folder, clutter_removal="mean")
        view(folder, still=options.out, time_s=MOMENT_S)
    print(options.out)


if __name__ == "__main__":
    main()
