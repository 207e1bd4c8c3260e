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
from timeit import repeat
from rtradar.kernels.prime_factor_dft import add_doppler_power, prime_factor_dft
from rtradar.kernels.tone_sum import Tones, add_tones, tone_tables

rng, shape = np.random.default_rng(0), (48, 8, 21)
length = np.broadcast_to(rng.uniform(0, 15, shape[1:]), shape).copy()
amplitude = rng.standard_normal((1, *shape)) + 1j * rng.standard_normal((1, *shape))
tones = Tones(length, amplitude, np.ones((1, 1)), 12e9, 4e9 / 60e-6, 256 / 60e-6)
samples = np.zeros((48, 8, 256), np.complex64)
spectra = rng.standard_normal((133, 8, 256, 2), dtype=np.float32).view(np.complex64)[..., 0]
weights, power = np.linspace(0, 1, 133, dtype=np.float32), np.zeros((133, 256), np.float32)
kernels = {
    "tone_sum.add_tones": (add_tones, 0, 48, tones, tone_tables(np.float32), samples),
    "prime_factor_dft.add_doppler_power": (
        add_doppler_power, spectra, range(8), weights, prime_factor_dft(133), power
    ),
}
best = {
    name: min(repeat(lambda: call[0](*call[1:]), number=1, repeat=200))
    for name, call in kernels.items()
}
print(json.dumps(best))
"""
LAYOUTS = ("aligned", "plain", "beside")


def measured(layout: str) -> dict[str, float]:
    """Best time of each kernel [s] in a process with aligned, plain or misaligned arrays."""
    command = [sys.executable, "-c", CHILD, layout]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5, help="rounds (default: 5)")
    rounds = [
        {layout: measured(layout) for layout in LAYOUTS} for _ in range(parser.parse_args().repeats)
    ]
    for layout in LAYOUTS[1:]:
        for name in rounds[0][layout]:
            ratio = median(own[layout][name] / own["aligned"][name] for own in rounds)
            print(f"{layout:8} {name:36} {ratio:.2f} times as long as aligned")
    return 0


if __name__ == "__main__":
    sys.exit(main())
