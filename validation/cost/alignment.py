"""What arrays on cache lines buy: the kernels that use them, beside arrays as NumPy gives them.

    python validation/cost/alignment.py [--repeats 5]

Processes with and without alignment take turns; printed are the medians of the ratios of their best
times. Above 1, `rtradar.kernels.jit.on_cache_lines` pays.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from statistics import median

KERNELS = ("tone_sum.add_tones", "prime_factor_dft.add_doppler_power")
CHILD = """
import json, sys
import numpy as np
from rtradar.kernels import jit

@jit.inlined()
def plain(count, like):
    return np.empty(count, dtype=like.dtype)

@jit.inlined()
def beside(count, like):
    return np.empty(count + 1, dtype=like.dtype)[1:]

if sys.argv[1] != "aligned":
    jit.on_cache_lines = {"plain": plain, "beside": beside}[sys.argv[1]]
from rtradar.bench.floors import best_s
from rtradar.bench.kernels import CASES
print(json.dumps({name: best_s(CASES[name].make()[0], 1.0) for name in sys.argv[2:]}))
"""
LAYOUTS = ("aligned", "plain", "beside")


def measured(layout: str) -> dict[str, float]:
    """Best time of each kernel [s] in a process with aligned, plain or misaligned arrays."""
    command = [sys.executable, "-c", CHILD, layout, *KERNELS]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5, help="rounds (default: 5)")
    rounds = [
        {layout: measured(layout) for layout in LAYOUTS} for _ in range(parser.parse_args().repeats)
    ]
    for layout in LAYOUTS[1:]:
        for name in KERNELS:
            ratio = median(own[layout][name] / own["aligned"][name] for own in rounds)
            print(f"{layout:8} {name:36} {ratio:.2f} times as long as aligned")
    return 0


if __name__ == "__main__":
    sys.exit(main())
