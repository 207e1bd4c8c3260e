"""Real IF samples, as a receiver with one mixer records them, and the complex samples they equal.

Such a receiver records the real part of the IF alone, at twice the rate of complex samples of the
same bandwidth. One chirp of ``2 n`` real samples holds the frequencies from 0 to half their rate,
which ``n`` complex samples hold at half the rate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def complex_of_real(samples: NDArray[Any]) -> NDArray[np.complex64]:
    """Give the complex samples whose real part was recorded: the positive half of the spectrum.

    Parameters
    ----------
    samples : (..., 2 n) real
        Samples of each chirp at their rate Fs.

    Returns
    -------
    (..., n) complex64
        Samples at Fs / 2 of the signal without its negative frequencies. The mean, at range 0,
        stays real. Frequencies beyond Fs / 2 - Fs / 2n, the last bin, are left out.
    """
    from scipy import fft  # slow to import

    # The half spectrum of a real signal, without its last bin. The inverse transform of half as
    # many samples divides by half as much, which gives the positive frequencies their double
    # amplitude; the mean has no partner and is halved.
    spectrum = fft.rfft(np.asarray(samples, dtype=np.float64), axis=-1)[..., :-1]
    spectrum[..., 0] /= 2
    return np.asarray(fft.ifft(spectrum, axis=-1), dtype=np.complex64)


def real_of_complex(samples: NDArray[np.complexfloating]) -> NDArray[np.float64]:
    """Give the real part of complex samples at twice their rate, which `complex_of_real` inverts.

    Parameters
    ----------
    samples : (..., n) complex
        Samples of each chirp.

    Returns
    -------
    (..., 2 n) float64
        Real samples; of the mean over a chirp, at range 0, the imaginary part is lost.
    """
    from scipy import fft  # slow to import

    # The inverse steps: the mean doubled again, and an empty last bin.
    spectrum = fft.fft(np.asarray(samples, dtype=np.complex128), axis=-1)
    spectrum[..., 0] *= 2
    beyond = np.zeros((*spectrum.shape[:-1], 1))
    return np.asarray(fft.irfft(np.concatenate([spectrum, beyond], axis=-1), axis=-1))
