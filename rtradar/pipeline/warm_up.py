"""Before the work: compile, or load from disk, what a run compiles; on first use a second process compiles half of it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from rtradar.clouds import spatial_points
from rtradar.echoes import Echoes
from rtradar.kernels.jit import is_on_disk
from rtradar.kernels.tone_sum import add_tones
from rtradar.pipeline.capture import chirps_of
from rtradar.pipeline.cloud_maker import window_angles
from rtradar.process import (
    measures_angle,
    os_cfar,
    power_map,
    range_azimuth,
    range_elevation,
    range_spectrum,
)
from rtradar.radar import Radar
from rtradar.signal import Noise, receive, separate, synthesize
from rtradar.system.threads import environment_of, thread_count

_LONGEST_S = 120.0
"""For a second process; what it has not done by then is done here."""


def warm_up_processing(echoes: Echoes, radar: Radar) -> None:
    """Compile, or load, what echoes go through on their way to maps and clouds, so that times are of the work.

    Parameters
    ----------
    echoes : Echoes
        Of two TDM cycles.
    radar : Radar
    """
    # A slice of more, as in the stream: code is compiled for how arrays lie in memory.
    samples = synthesize(
        chirps_of(echoes, 0, radar.n_tx), radar, radar.chirp_times(radar.n_tx), dtype=np.complex64
    )
    received = receive(samples, radar, 0)
    Noise(1.0, 0).add(received, radar, 0)
    range_spectrum(separate(received, radar, 0), radar)
    window = np.ones((radar.cycles_per_frame, radar.n_tx, radar.n_rx, 1), dtype=np.complex64)
    power_map(window, radar)
    os_cfar(np.ones((16, 16), dtype=np.float32), looks=radar.n_channels)
    if measures_angle(radar):
        spectra = window_angles(window, np.arange(radar.cycles_per_frame)[None, :] == 0, radar)
        spatial_points(spectra, radar, 0.0)
        for there, lay_out in ((spectra.y, range_azimuth), (spectra.z, range_elevation)):
            if there is not None:
                lay_out(spectra, radar)


def warm_up_usual_processing() -> None:
    """`warm_up_processing` with the paper's radar; what another one needs beside, it compiles itself."""
    radar = Radar.preset("paper-12ghz")
    shape = 2 * radar.n_tx, radar.n_rx, 1
    amplitude, first = np.ones((1, *shape), dtype=np.complex128), np.zeros(1, dtype=np.int64)
    tx = np.arange(len(amplitude[0])) % radar.n_tx
    echoes = Echoes(
        length=np.full(shape, 8.0),
        amplitude=amplitude,
        frequency=np.array([12e9]),
        tx=tx,
        part=first,
        bounces=first + 1,
    )
    warm_up_processing(echoes, radar)


def compile_for_another_process() -> None:
    """`warm_up_usual_processing`, but for no longer than standard input is open, which it is while that process is there."""

    def end_with_it() -> None:
        os.read(sys.stdin.fileno(), 1)
        os._exit(1)

    threading.Thread(target=end_with_it, daemon=True).start()
    warm_up_usual_processing()


@contextmanager
def processing_compiled_beside() -> Iterator[None]:
    """Have another process compile what echoes go through, if none has; it is done when this ends."""
    # Within another program, the interpreter is that program.
    if (
        is_on_disk(add_tones)
        or thread_count() < 2
        or not Path(sys.executable or "").name.startswith("python")
    ):
        yield
        return
    words = [
        sys.executable,
        "-c",
        "from rtradar.pipeline.warm_up import compile_for_another_process as go; go()",
    ]
    environment, nothing = {**os.environ, **environment_of(1)}, subprocess.DEVNULL
    with subprocess.Popen(
        words, env=environment, stdin=subprocess.PIPE, stdout=nothing, stderr=nothing
    ) as other:
        try:
            yield
            with suppress(subprocess.TimeoutExpired):
                other.wait(_LONGEST_S)
        finally:
            other.kill()
