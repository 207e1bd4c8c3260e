"""The paper's own choices for a run, and a warning for each that is a fault."""

from __future__ import annotations

from rtradar.paper.items import contents
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
    return tuple(contents()["warnings"])
