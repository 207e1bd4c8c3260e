"""Compilation before the work: on first use a second process compiles half of what a run needs."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from rtradar.clouds import spatial_points
from rtradar.echoes import Echoes
from rtradar.kernels.expected_echoes import EchoesAtInstants, fields_in_bins, follow_echoes
from rtradar.kernels.jit import is_on_disk
from rtradar.kernels.tone_sum import add_tones
from rtradar.pipeline.capture import chirps_of
from rtradar.pipeline.processing import frame_angles
from rtradar.process import (
    measured_angles,
    os_cfar,
    power_map,
    range_azimuth,
    range_elevation,
    range_spectrum,
)
from rtradar.radar import Radar
from rtradar.signal import Noise, receive, separate, synthesize
from rtradar.system.threads import thread_count, thread_environment

_MAX_S = 120.0  # for the other process; what it has not compiled by then is compiled here


def warm_up_processing(echoes: Echoes, radar: Radar) -> None:
    """Compile or load what the echoes of two TDM cycles go through on their way to clouds."""
    # A slice of more, as in the stream: code is compiled for how arrays lie in memory.
    first_cycle, times = chirps_of(echoes, 0, radar.n_tx), radar.chirp_times(radar.n_tx)
    received = receive(synthesize(first_cycle, radar, times, dtype=np.complex64), radar, 0)
    Noise(1.0, 0).add(received, radar, 0)
    range_spectrum(separate(received, radar, 0), radar)
    frame = np.ones((radar.cycles_per_frame, radar.n_tx, radar.n_rx, 1), dtype=np.complex64)
    power_map(frame, radar)
    os_cfar(np.ones((16, 16), dtype=np.float32), looks=radar.n_channels)
    _warm_up_sources()
    if measured_angles(radar):
        spectra = frame_angles(frame, np.arange(radar.cycles_per_frame)[None, :] == 0, radar)
        spatial_points(spectra, radar, 0.0)
        if spectra.y is not None:
            range_azimuth(spectra, radar)
        if spectra.z is not None:
            range_elevation(spectra, radar)


def _warm_up_sources() -> None:
    """Compile or load what tells who returned a cell."""
    looks = EchoesAtInstants(np.arange(2), 1.0, *np.ones((3, 2, 1)))
    steps, fields = np.empty((1, 1), dtype=np.int32), np.empty((1, 1), dtype=np.complex64)
    follow_echoes(0, 1, 0, looks, 1.0, 1.0, steps, fields)
    none = np.zeros(1, dtype=np.int64)
    fields_in_bins(none, none, steps, fields, np.ones(1, dtype=np.float32), fields.copy())


def warm_up_any_processing() -> None:
    """Compile or load the processing of the paper's radar, without a person before it."""
    radar = Radar.preset("paper-12ghz")
    shape = 2 * radar.n_tx, radar.n_rx, 1
    echoes = Echoes(
        length=np.full(shape, 8.0),
        amplitude=np.ones((1, *shape), dtype=np.complex128),
        frequency=np.array([12e9]),
        tx=np.arange(2 * radar.n_tx) % radar.n_tx,
        part=np.zeros(1, dtype=np.int64),
        bounces=np.ones(1, dtype=np.int64),
    )
    warm_up_processing(echoes, radar)


def end_with_the_other_process() -> None:
    """End this process as soon as standard input closes with the one that started it."""

    def wait() -> None:
        os.read(sys.stdin.fileno(), 1)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


@contextmanager
def other_process(work: str, most_s: float) -> Iterator[Callable[[], None]]:
    """Have another process, of one thread, do ``work``, a line of Python.

    Given is a function that waits for it, for ``most_s`` at most; what is left then, or when this
    ends, is given up.
    """
    line = f"from {__name__} import end_with_the_other_process as also; also(); {work}"
    with subprocess.Popen(
        [sys.executable, "-c", line],
        env={**os.environ, **thread_environment(1)},
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as other:

        def wait() -> None:
            with suppress(subprocess.TimeoutExpired):
                other.wait(most_s)

        try:
            yield wait
        finally:
            other.kill()


@contextmanager
def processing_compiled_beside() -> Iterator[None]:
    """Have another process compile the processing if none has; it is done when this ends."""
    # Within another program, the interpreter is that program.
    is_python = Path(sys.executable or "").name.startswith("python")
    if is_on_disk(add_tones) or thread_count() < 2 or not is_python:
        yield
        return
    work = f"from {__name__} import warm_up_any_processing as go; go()"
    with other_process(work, _MAX_S) as wait:
        yield
        wait()
