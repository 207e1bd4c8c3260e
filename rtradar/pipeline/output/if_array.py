"""The IF samples that a run keeps, on disk, chunk by chunk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rtradar.pipeline.capture import Capture


def if_array(path: Path, capture: Capture) -> Any:
    """A new Zarr array (chirp, rx, sample) there, of all samples of the capture; its attributes say how to read it."""
    import zarr

    radar = capture.radar
    together = (
        radar.n_tx if radar.multiplexing == "ddm" else 1
    )  # one receiver gets the sum of all Tx
    shape = (capture.n_chirps // together, radar.n_rx, radar.samples_per_chirp)
    chunks = (capture.block // together, *shape[1:])
    array = zarr.create_array(
        path,
        shape=shape,
        chunks=chunks,
        dtype="complex64",
        dimension_names=("chirp", "rx", "sample"),
    )
    told = {
        name: getattr(radar, name)
        for name in ("multiplexing", "chirp_duration_s", "sample_rate_hz")
    }
    array.attrs.update({"units": "m", **told})
    return array
