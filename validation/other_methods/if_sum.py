"""The fast IF samples against the plain sum of their formula: relative error and speed.

The plain sum is x[n] = sum_e A_e(f_n) exp(+j 2 pi (f_c tau + s tau t_n - s tau^2 / 2)) as written,
an exponential for every echo and sample. It is timed with phases in float64, and compared with
phases in long double, one chirp in sixteen. There are 21 echoes anywhere in the band: with constant
amplitudes, with the parabola through three frequencies, with a third of the echoes on such
parabolas and the others constant, and with the polynomial through five. Then 315 echoes in
complex64, which go through the NUFFT; and the time of the direct sum over that of the NUFFT, for
growing numbers of echoes. Errors are relative to the root mean square of the IF samples. Speed is
reported and not judged, because it depends on the machine.

    python validation/other_methods/if_sum.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.signal import synthesis, synthesize
from rtradar.validate.rows import Row, judged, main, reported

Complex = NDArray[np.complex128]

PARTS = 21
TOLERANCE = 1e-5
CASES = ((1, 0), (3, 0), (3, 14), (5, 0))  # nodes, constant echoes
MANY, MANY_CASES = 315, ((1, 0), (3, 0), (5, 0))  # a body and fourteen paths over walls
CROSSINGS = ((1, (40, 80, 160)), (3, (18, 36, 72)))  # nodes, echoes
COMPARED = slice(None, None, 16)
REPEATS = 3


def block(
    radar: Radar, chirps: int, nodes: int, constant: int, count: int, rng: np.random.Generator
) -> Echoes:
    """Static echoes anywhere in the band, so that only the sum is measured; some are constant."""
    shape = (chirps, radar.n_rx, count)
    way = rng.uniform(0.01, 0.99, shape[1:]) * 2 * radar.max_range_m
    amplitude = rng.standard_normal((nodes, *shape)) + 1j * rng.standard_normal((nodes, *shape))
    amplitude[..., :constant] = amplitude[:1, ..., :constant]
    return Echoes(
        length=np.broadcast_to(way, shape),
        amplitude=amplitude,
        frequency=radar.start_frequency_hz + (np.arange(nodes) + 0.5) / nodes * radar.bandwidth_hz,
        tx=radar.tx_of_chirp(np.arange(chirps)),
        part=np.arange(count),
        bounces=np.ones(count, dtype=np.int64),
    )


def plain_sum(echoes: Echoes, radar: Radar, kind: type[np.floating]) -> Complex:
    """IF samples (chirp, rx, sample), phases in this precision; chirp by chirp saves memory."""
    t = (
        np.arange(radar.samples_per_chirp, dtype=kind)
        * kind(radar.chirp_duration_s)
        / radar.samples_per_chirp
    )
    slope = kind(radar.bandwidth_hz) / kind(radar.chirp_duration_s)
    f = radar.start_frequency_hz + slope * t
    weights = np.ones((len(echoes.frequency), len(t)))  # Lagrange polynomials through the nodes
    for j, node in enumerate(echoes.frequency):
        for other in np.delete(echoes.frequency, j):
            weights[j] *= ((f - other) / (node - other)).astype(np.float64)
    x = np.empty((*echoes.length.shape[:2], len(t)), dtype=np.complex128)
    for chirp, length in enumerate(echoes.length):
        tau = (length.astype(kind) / SPEED_OF_LIGHT_MPS)[..., None]
        turns = radar.start_frequency_hz * tau + slope * tau * t - slope * tau**2 / 2
        phasor = np.exp(2j * np.pi * (turns - np.floor(turns)).astype(np.float64))
        amplitude = np.einsum("jre,jn->ren", echoes.amplitude[:, chirp], weights)
        x[chirp] = (amplitude * phasor).sum(axis=1)
    return x


def every_sixteenth(echoes: Echoes) -> Echoes:
    return Echoes(
        length=echoes.length[COMPARED],
        amplitude=echoes.amplitude[:, COMPARED],
        frequency=echoes.frequency,
        tx=echoes.tx[COMPARED],
        part=echoes.part,
        bounces=echoes.bounces,
    )


def case_rows(preset: str, nodes: int, constant: int, rng: np.random.Generator) -> Iterator[Row]:
    radar = Radar.preset(preset)
    chirps = Radar.preset("paper-12ghz").chirps_per_frame
    nodes_text = f"{nodes} node{'s' if nodes > 1 else ''}"
    claim = f"{preset}, {nodes_text}{f', {constant} echoes constant' if constant else ''}"
    yield from compared(
        claim, block(radar, chirps, nodes, constant, PARTS, rng), radar, np.complex128
    )


def many_rows(preset: str, nodes: int, constant: int, rng: np.random.Generator) -> Iterator[Row]:
    """Many echoes in complex64, by the NUFFT."""
    radar = Radar.preset(preset)
    claim = f"{preset}, {nodes} node{'s' if nodes > 1 else ''}, complex64"
    yield from compared(claim, block(radar, 192, nodes, constant, MANY, rng), radar, np.complex64)


def crossing_rows(
    preset: str, nodes: int, counts: tuple[int, ...], rng: np.random.Generator
) -> Iterator[Row]:
    """Where the NUFFT begins to pay, a constant of `synthesize`: the same echoes by both."""
    radar = Radar.preset(preset)
    claim = f"{preset}, {nodes} node{'s' if nodes > 1 else ''}, complex64"
    times = radar.chirp_times(192)
    for count in counts:
        echoes = block(radar, len(times), nodes, 0, count, rng)
        seconds: dict[int, list[float]] = {}
        for _ in range(1 + 3 * REPEATS):  # the first one compiles
            for many in (1, count + 1):
                with mock.patch.multiple(synthesis, MANY_ECHOES=many, MANY_VARYING_ECHOES=many):
                    took = timed(
                        lambda echoes=echoes: synthesize(echoes, radar, times, dtype=np.complex64)
                    )
                seconds.setdefault(many, []).append(took)
        spread, one_by_one = (float(np.median(own[1:])) for own in seconds.values())
        yield reported(
            claim,
            f"{count} echoes: direct sum over NUFFT, time",
            "",
            one_by_one / spread,
            key="if-sum",
        )


def compared(
    claim: str, echoes: Echoes, radar: Radar, dtype: type[np.complexfloating]
) -> Iterator[Row]:
    chirps, _, count = echoes.length.shape
    times = radar.chirp_times(chirps)
    fast = synthesize(echoes, radar, times, dtype=dtype)  # compiles before it is timed
    fast_s = min(
        timed(lambda: synthesize(echoes, radar, times, dtype=dtype)) for _ in range(REPEATS)
    )
    plain_s = timed(lambda: plain_sum(echoes, radar, np.float64))
    reference = plain_sum(every_sixteenth(echoes), radar, np.longdouble)
    error = float(
        np.abs(fast[COMPARED] - reference).max() / np.sqrt(np.mean(np.abs(reference) ** 2))
    )
    yield judged(
        claim, "largest relative error to the plain sum", "", error, TOLERANCE, key="if-sum"
    )
    yield reported(claim, f"plain sum, {chirps} chirps, {count} echoes", "s", plain_s, key="if-sum")
    yield reported(claim, "fast", "s", fast_s, key="if-sum")
    yield reported(claim, "times faster", "", plain_s / fast_s, key="if-sum")


def timed(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def measure(quick: bool) -> list[Row]:
    rng = np.random.default_rng(0)
    presets = ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz")
    kinds = [(CASES, case_rows), (MANY_CASES, many_rows)]
    if not quick:  # it only reports times
        kinds.append((CROSSINGS, crossing_rows))
    return [
        row
        for preset in presets
        for cases, rows in kinds
        for case in cases
        for row in rows(preset, *case, rng)
    ]


if __name__ == "__main__":
    sys.exit(main("The fast IF against the plain sum: error and speed.", measure))
