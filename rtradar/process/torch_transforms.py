"""Range spectra and Doppler power by torch, on any device that it has: for a GPU, where its FFTs are those of cuFFT.

What goes in and comes out are arrays of NumPy, so that nothing else needs to know where it was computed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import torch


def range_spectra(
    samples: NDArray[np.generic], scale: NDArray[np.float32], device: str
) -> NDArray[np.complex64]:
    """Weighted FFTs over fast time.

    Parameters
    ----------
    samples : (chirp, rx, sample) complex
    scale : (sample,) float32
    device : str
        As torch names it.

    Returns
    -------
    (chirp, rx, range) complex64
    """
    import torch

    with torch.inference_mode():
        weighted = _handed_over(samples, device) * torch.as_tensor(scale, device=device)
        return _handed_back(torch.fft.fft(weighted, dim=2))


def doppler_power(
    spectra: NDArray[np.complexfloating], scale: NDArray[np.float32], device: str
) -> NDArray[np.float32]:
    """Squared magnitudes of weighted FFTs over slow time, summed over channels.

    Parameters
    ----------
    spectra : (cycle, channel, range) complex
    scale : (cycle,) float32
    device : str
        As torch names it.

    Returns
    -------
    (doppler, range) float32
        In the order of the DFT.
    """
    import torch

    with torch.inference_mode():
        weighted = (
            _handed_over(spectra, device) * torch.as_tensor(scale, device=device)[:, None, None]
        )
        parts = torch.view_as_real(torch.fft.fft(weighted, dim=0))
        return _handed_back(parts.square_().sum(dim=(1, 3)))


def _handed_over(values: NDArray[np.generic], device: str) -> torch.Tensor:
    import torch

    # By way of memory that does not move, from which a GPU reads by itself; and torch takes no array that is read-only.
    staged = torch.empty(
        values.shape, dtype=torch.complex64, pin_memory=torch.device(device).type == "cuda"
    )
    staged.numpy()[...] = values
    return staged.to(device)


def _handed_back(values: torch.Tensor) -> NDArray[Any]:
    return values.cpu().numpy()
