"""False-alarm rates of the CFAR detectors on noise alone, against those asked.

Independent cells: detections are counted in maps with a Gamma distribution. The rate must be
within 10 % of the one asked for.

Windowed maps: complex white noise goes through range and Doppler spectra as in the pipeline. The
Hann window correlates neighbouring cells, so the training cells count for fewer than they are and
the threshold scatters more: the rate exceeds the one asked for. It is counted, and it is also
computed from the thresholds alone. Cells three bins apart are independent, because the spectrum of
a Hann window is three bins wide; with two guard cells the cell under test is therefore independent
of its threshold T, and the rate is the mean of Q(looks, T), where Q is the survival function of
the Gamma law. This needs no alarm to occur, and so reaches down to the default rate of 1e-6.

    python validation/closed_forms/cfar.py [--quick] [--json FILE]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from rtradar.kernels.jit import compiled
from rtradar.process import ca_cfar, ca_scale, os_cfar, os_scale, power_map, range_spectrum
from rtradar.process.cfar import order_rank
from rtradar.process.window_functions import hann
from rtradar.radar import Radar
from rtradar.system.threads import in_threads
from rtradar.validate.rows import Row, judged, main, reported

GUARD, TRAIN, QUANTILE = 2, 4, 0.75
CAPTURE_S = 3.0
MOST_OFF = 0.1
DETECTORS: dict[str, Callable[..., NDArray[np.bool_]]] = {"os": os_cfar, "ca": ca_cfar}


class Rate(NamedTuple):
    """One rate: its cells and detector, the rate asked for, and the rates measured."""

    cells: str
    detector: str
    looks: int
    pfa: float
    n_cells: int
    alarms: int
    counted: float
    counted_error: float  # one standard deviation, from the scatter between maps
    conditional: float | None  # mean survival over the measured thresholds
    conditional_error: float | None


def noise_levels(power, ranks, guard, reach):
    """Order statistic, mean and number of the training cells of every cell, by sorting them."""
    levels = (np.empty(power.shape), np.empty(power.shape), np.empty(power.shape, np.int64))
    in_threads(_noise_levels, len(power), power, ranks, guard, reach, *levels)
    return levels


@compiled()
def _noise_levels(start, stop, power, ranks, guard, reach, ordered, averaged, counts):
    n_range, n_velocity = power.shape
    for i in range(start, stop):
        ring = np.empty((2 * reach + 1) ** 2)
        for j in range(n_velocity):
            n = 0
            for a in range(max(i - reach, 0), min(i + reach, n_range - 1) + 1):
                for b in range(max(j - reach, 0), min(j + reach, n_velocity - 1) + 1):
                    if abs(a - i) > guard or abs(b - j) > guard:
                        ring[n] = power[a, b]
                        n += 1
            ordered[i, j] = np.partition(ring[:n], ranks[n] - 1)[ranks[n] - 1]
            averaged[i, j] = ring[:n].mean()
            counts[i, j] = n


RING_SIZES = range(1, (2 * (GUARD + TRAIN) + 1) ** 2 + 1)
RANKS = np.array([0, *(order_rank(n, QUANTILE) for n in RING_SIZES)])


def scale_tables(pfa: float, looks: int) -> dict[str, NDArray[np.float64]]:
    """Multipliers of both detectors by the number of training cells."""
    return {
        "os": np.array([0.0, *(os_scale(n, QUANTILE, pfa, looks) for n in RING_SIZES)]),
        "ca": np.array([0.0, *(ca_scale(n, pfa, looks) for n in RING_SIZES)]),
    }


def rate(values: list[float]) -> tuple[float, float]:
    """Mean over the maps, and its standard deviation."""
    return float(np.mean(values)), float(np.std(values, ddof=1) / math.sqrt(len(values)))


def independent_maps(
    n_maps: int, looks: int, rng: np.random.Generator
) -> Iterator[NDArray[np.floating]]:
    for _ in range(n_maps):
        yield rng.standard_gamma(looks, size=(256, 133))


def noise_power(radar: Radar) -> float:
    """Mean power of a cell of one channel for noise of power 1 per sample."""
    factors = [
        np.sum(hann(n) ** 2) / np.sum(hann(n)) ** 2
        for n in (radar.samples_per_chirp, radar.cycles_per_frame)
    ]
    return float(np.prod(factors))


def windowed_maps(
    radar: Radar, n_maps: int, rng: np.random.Generator
) -> Iterator[tuple[NDArray[np.floating], list[NDArray[np.floating]]]]:
    """The sum of all channels and three single channels, in units of a channel's mean power."""
    shape = (radar.chirps_per_frame, radar.n_rx, radar.samples_per_chirp)
    unit = noise_power(radar)
    for _ in range(n_maps):
        noise = rng.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[
            ..., 0
        ] * np.float32(math.sqrt(0.5))
        cube = range_spectrum(noise, radar).reshape(
            -1, radar.n_tx, radar.n_rx, radar.samples_per_chirp
        )
        yield (
            power_map(cube, radar) / np.float32(unit),
            [power_map(cube, radar, channel=c) / np.float32(unit) for c in (0, 37, 95)],
        )


class Tally:
    """Alarms and mean survival probabilities of one kind of cells, map by map."""

    def __init__(
        self, cells: str, looks: int, pfas: tuple[float, ...], *, conditional: bool
    ) -> None:
        self.cells, self.looks, self.conditional = cells, looks, conditional
        self.scales = {pfa: scale_tables(pfa, looks) for pfa in pfas}
        self.counted: dict[tuple[str, float], list[float]] = {
            (d, pfa): [] for d in DETECTORS for pfa in pfas
        }
        self.survival: dict[tuple[str, float], list[float]] = {
            (d, pfa): [] for d in DETECTORS for pfa in pfas
        }
        self.alarms = dict.fromkeys(self.counted, 0)
        self.n_cells = 0

    def add(self, power: NDArray[np.floating]) -> None:
        self.n_cells += power.size
        for detector, pfa in self.counted:
            alarms = int(DETECTORS[detector](power, GUARD, TRAIN, pfa=pfa, looks=self.looks).sum())
            self.alarms[detector, pfa] += alarms
            self.counted[detector, pfa].append(alarms / power.size)
        if self.conditional:
            ordered, averaged, counts = noise_levels(
                power.astype(np.float64), RANKS, GUARD, GUARD + TRAIN
            )
            for (detector, pfa), means in self.survival.items():
                level = ordered if detector == "os" else averaged
                means.append(
                    float(gammaincc(self.looks, self.scales[pfa][detector][counts] * level).mean())
                )

    def rates(self) -> Iterator[Rate]:
        for (detector, pfa), values in self.counted.items():
            conditional = rate(self.survival[detector, pfa]) if self.conditional else (None, None)
            alarms = self.alarms[detector, pfa]
            yield Rate(
                self.cells,
                detector,
                self.looks,
                pfa,
                self.n_cells,
                alarms,
                *rate(values),
                *conditional,
            )


def rates(n_maps: int, seed: int) -> Iterator[Rate]:
    """Rates of ``n_maps`` windowed maps of 96 channels, and of four times as many single ones."""
    rng = np.random.default_rng(seed)
    for looks in (1, 96):
        tally = Tally("independent", looks, (1e-2, 1e-3), conditional=False)
        for power in independent_maps(4 * n_maps, looks, rng):
            tally.add(power)
        yield from tally.rates()
    radar = Radar.preset("paper-12ghz")
    pfas = (1e-2, 1e-3, 1e-4, 1e-6)
    one, summed = (
        Tally("windowed", 1, pfas, conditional=True),
        Tally("windowed", radar.n_channels, pfas, conditional=True),
    )
    for total, singles in windowed_maps(radar, n_maps, rng):
        summed.add(total)
        for single in singles:
            one.add(single)
    yield from one.rates()
    yield from summed.rates()


def rate_rows(found: Rate) -> Iterator[Row]:
    looks = f"{found.looks} look{'s' if found.looks > 1 else ''}"
    claim = f"{found.cells} cells, {found.detector}, {looks}, {found.pfa:g} asked"
    counted = found.counted / found.pfa
    if found.cells == "independent":
        says = "false alarms counted over those asked, independent cells, less 1"
        yield judged(
            claim,
            f"counted over asked, {found.n_cells} cells",
            "",
            counted,
            MOST_OFF,
            reference=1.0,
            says=says,
        )
    else:
        yield reported(claim, f"counted over asked, {found.alarms} alarms", "", counted)
    yield reported(claim, "one standard deviation of that", "", found.counted_error / found.pfa)
    if found.conditional is not None and found.conditional_error is not None:
        yield reported(claim, "from the thresholds, over asked", "", found.conditional / found.pfa)
        yield reported(
            claim, "one standard deviation of that, too", "", found.conditional_error / found.pfa
        )


def voxel_rows(found: list[Rate]) -> Iterator[Row]:
    """False voxels expected in the RDT volume of a capture, by OS-CFAR at the default rate.

    The rate of the 12 GHz map also holds for the 77 GHz map, because the joint distribution of a
    cell and its neighbours does not depend on the number of bins.
    """
    for name in ("paper-12ghz", "paper-77ghz"):
        radar = Radar.preset(name)
        windows = len(radar.window_starts(math.floor(CAPTURE_S / radar.chirp_duration_s)))
        cells = radar.samples_per_chirp * radar.cycles_per_frame
        for one in found:
            if (
                one.cells == "windowed"
                and one.detector == "os"
                and one.pfa == 1e-6
                and one.conditional is not None
            ):
                claim = f"{name}, {CAPTURE_S:g} s of noise alone, {one.looks} looks"
                yield reported(
                    claim,
                    f"false voxels expected in {windows} windows",
                    "",
                    windows * cells * one.conditional,
                )


def measure(quick: bool) -> list[Row]:
    found = list(rates(12 if quick else 60, seed=0))
    return [*(row for one in found for row in rate_rows(one)), *voxel_rows(found)]


if __name__ == "__main__":
    sys.exit(main("False-alarm rates of the CFAR detectors on noise alone.", measure))
