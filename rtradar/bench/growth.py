"""How time and memory grow with the length of the recording, the channels of the array and the echoes of a chirp."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.bench.plan import Case, Plan
from rtradar.bench.rates import best_s
from rtradar.bench.runs import Run, Runner
from rtradar.bench.times import Spread
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.signal import synthesize

ECHOES = (10, 21, 31, 42, 84, 168, 336)
"""Of one chirp and receiver: a body has 21."""

_CYCLES = 33  # 25 ms of the paper's radar, which a run synthesises at once
_ECHOES_S = 0.1  # of repeats


def _grown(runs: list[Run]) -> dict[str, Any]:
    return {
        "to_cloud_s": dataclasses.asdict(Spread.of([run.to_cloud_s for run in runs])),
        "whole_s": dataclasses.asdict(Spread.of([run.whole_s for run in runs])),
        "peak_memory_mb": max(run.peak_memory_mb for run in runs),
    }


def with_duration(plan: Plan, runner: Runner) -> list[dict[str, Any]]:
    """Runs of growing length, a row each: ``duration_s``, ``capture_s``, seconds and memory."""
    cases = [
        Case(plan.radars[0], plan.growing_fidelity, duration)
        for duration in plan.growing_durations_s
    ]
    runs = runner.measure(cases, plan.repeats, "length")
    return [
        {"duration_s": case.duration_s, "capture_s": own[0].summary["capture_s"], **_grown(own)}
        for case, own in runs.items()
    ]


def with_channels(plan: Plan, runner: Runner, folder: Path) -> list[dict[str, Any]]:
    """Runs by arrays of more and more receivers, a row each: ``channels``, seconds and memory."""
    found = {}
    for number, radar in enumerate(arrays(Radar.load(plan.radars[0]))):
        file = folder / f"array{number}.toml"
        file.write_text(as_toml(radar), encoding="utf-8")
        found[Case(str(file), plan.growing_fidelity, plan.duration_s)] = radar.n_channels
    runs = runner.measure(list(found), plan.repeats, "channels")
    return [{"channels": found[case], **_grown(own)} for case, own in runs.items()]


def arrays(radar: Radar) -> list[Radar]:
    """The radar with a quarter and half of its receivers, where they can be divided, itself, and every Tx with every Rx."""
    some = [
        dataclasses.replace(radar, rx_y=radar.rx_y // part, rx_z=radar.rx_z // part)
        for part in (4, 2)
        if radar.rx_y % part == radar.rx_z % part == 0
    ]
    whole = dataclasses.replace(radar, channels="all")
    return [*some, radar, *([whole] if whole.n_channels > radar.n_channels else [])]


def as_toml(radar: Radar) -> str:
    """The fields of a radar as a TOML file that `Radar.load` reads."""
    fields = {name: value for name, value in dataclasses.asdict(radar).items() if value is not None}
    tables = {
        name: fields.pop(name) for name, value in list(fields.items()) if isinstance(value, dict)
    }
    return _lines(fields) + "".join(f"[{name}]\n{_lines(table)}" for name, table in tables.items())


def _lines(fields: dict[str, Any]) -> str:
    # A JSON string, number or list of numbers is one of TOML.
    return "".join(
        f"{name} = {json.dumps(value)}\n" for name, value in fields.items() if value is not None
    )


def with_echoes(radar: Radar) -> list[dict[str, Any]]:
    """IF of a block of chirps, by itself, from more and more echoes, a row each: ``echoes``, ``samples``, ``signal_s`` (best)."""
    return [_if_row(radar, _echoes(radar, count)) for count in ECHOES]


def _if_row(radar: Radar, echoes: Echoes) -> dict[str, Any]:
    times = radar.chirp_times(len(echoes.tx))
    seconds = best_s(lambda: synthesize(echoes, radar, times, dtype=np.complex64), _ECHOES_S)
    return {
        "echoes": len(echoes.part),
        "samples": len(times) * radar.n_rx * radar.samples_per_chirp,
        "signal_s": seconds,
    }


def _echoes(radar: Radar, count: int) -> Echoes:
    """Echoes that stand still, anywhere in the band."""
    rng = np.random.default_rng(0)
    chirps = _CYCLES * radar.n_tx
    shape = (chirps, radar.n_rx, count)
    return Echoes(
        length=np.broadcast_to(rng.uniform(0.01, 0.99, shape[1:]) * 2 * radar.max_range_m, shape),
        amplitude=np.broadcast_to(rng.standard_normal(shape[1:]) + 0j, (1, *shape)),
        frequency=np.array([radar.centre_frequency_hz]),
        tx=radar.tx_of_chirp(np.arange(chirps)),
        part=np.arange(count),
        bounces=np.ones(count, dtype=np.int64),
    )
