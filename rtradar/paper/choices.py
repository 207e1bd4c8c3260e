"""The paper's own choices for a run, and a warning for each that is a fault."""

from __future__ import annotations

from rtradar.settings import RunOptions

PAPER_OS_SCALE = 5.0003
"""OS-CFAR multiplier of the paper's program, where its search ends for any number of cells."""

AS_PAPER: RunOptions = {
    "fidelity": "analytic-paper",
    "spreading": False,
    "snr_db": 20.0,
    "detector": "os-cfar",
    "detector_options": {"guard": 2, "train": 4, "quantile": 0.75, "scale": PAPER_OS_SCALE},
    "range_window": "hann",
    "doppler_window": "hann",
}
"""Options of `rtradar.run` that the paper chose; `paper_warnings` says which are faults."""

SIZES = ("500", "1000", "2000", "3000")
"""Points of a cloud, the columns of table 4."""

CURVES = ("train_loss", "train_accuracy", "test_loss", "test_accuracy")
"""What is kept of each epoch of a training."""


def paper_warnings() -> tuple[str, ...]:
    """Say what is wrong with the choices of `AS_PAPER`, and which faults are not repeated.

    Returns
    -------
    tuple of str
        One sentence for each.

    Examples
    --------
    >>> from rtradar.paper import paper_warnings
    >>> len(paper_warnings())
    5
    """
    return (
        "fidelity = analytic-paper: echoes come from the centres of the ellipsoids, up to 10 cm "
        "behind their surface, as plane waves, though the far field of the array begins at 32 m; "
        "and nothing is occluded",
        "spreading = False: near and far parts of the body are equally strong",
        f"detector scale = {PAPER_OS_SCALE}: on one channel it alarms once in 763 cells of noise, "
        "whatever rate is asked for; it is not the multiplier of a sum of channels",
        "velocities are those of the centre of the sweep; the paper's axis is that of its start, "
        "which reads 17 % too high at 12 GHz, and is not repeated",
        "the paper's program has an error in the cross-section, 14 to 26 dB low end-on, and noise "
        "of fixed power, 3 to 6 dB below the echoes; neither is repeated",
    )
