"""Axes, signs, units and constants that every module of rtradar shares.

World axes
    x points from the radar to the person, y to the left, z up; metres; the floor is z = 0. Motion
    capture is y-up: world (x, y, z) = mocap (z, x, y). The radar of the paper is at (-4, 1, 1)
    m, its boresight along +x, its axes parallel to the world's.

Angles
    azimuth = atan2(y, x), elevation = asin(z / r), both in the radar's frame.

Velocity
    The rate of range [m/s]: positive recedes, and so is positive Doppler frequency.

Phase
    Scattering code uses exp(+j omega t), so a path of ``length`` metres multiplies a field by
    exp(-j k length). The intermediate frequency (IF) signal is the transmitted chirp times the
    conjugate of the received one (paper, eq. 9), so it varies as exp(+j 2 pi f tau), tau = length /
    c. An echo's ``amplitude`` is the conjugate of the scattering length with the phase of
    ``length`` taken out: the received spectrum is H(f) = sum conj(amplitude) exp(-j 2 pi f length /
    c). A conducting sphere of radius a has the specular amplitude +sqrt(pi) a, real;
    ``|amplitude|^2`` is a radar cross-section [m^2] when spreading is left out.

Spreading
    Spherical spreading sits in ``amplitude``, a factor 1 / (R1 R2) normalised to 1 at R1 = R2 = 1
    m, so that the amplitude stays in metres. So does the pattern of antennas, relative to its peak;
    gains at the peak belong to watts.

Watts
    ``|amplitude|^2`` and the power of IF samples, in m^2, times P_t G_t G_r lambda^2 / (4 pi)^3
    (`Radar.watts_per_m2`) are the received power of the radar equation P_r = P_t G_t G_r lambda^2
    sigma / ((4 pi)^3 R1^2 R2^2) [W] (Skolnik, Introduction to Radar Systems, 3rd ed., section 1.2),
    lambda at the sweep centre. A complex sample holds noise of k (T + 290 K (F - 1)) Fs watts
    (`Radar.noise_power_w`): T is the temperature of what the antennas see, and the noise factor F
    is that of a source at 290 K (Friis, Proc. IRE 32, 1944). The ideal IF low-pass is as wide as
    the sample rate Fs (Richards, Fundamentals of Radar Signal Processing, chapter 2).

Wavelength
    Doppler, angle and near-field phases belong to the CENTRE frequency of the sweep, because the
    phase of a range bin changes with it. The antenna spacing of the paper's Table 1 belongs to
    the START frequency.

Arrays
    Axes have the order ``(chirp, rx, sample)``; per frame ``(cycle, tx, rx, sample)``. SI
    units; a unit that is not SI is in the name (``_db``, ``_dbsm``, ``_deg``). Lengths and phases
    are float64.

Windows
    Periodic (DFT-even).
"""

SPEED_OF_LIGHT_MPS = 299_792_458.0
"""Speed of light in vacuum [m/s], exact by the definition of the metre."""

BOLTZMANN_J_PER_K = 1.380649e-23
"""Boltzmann's constant [J/K], exact by the definition of the kelvin."""

NOISE_FIGURE_TEMPERATURE_K = 290.0
"""Temperature of the source for which the noise figure of a receiver is defined (IEEE) [K]."""

MINIMUM_ANTENNA_DISTANCE_M = 0.3
"""A body part nearer to an antenna than this is refused: the echo model has no meaning there."""

MINIMUM_KA = 5.0
"""Least product of wavenumber and radius of curvature for geometric and physical optics.

Below it they are off by decibels."""

PERSON_LIMITS = {"position_m": (-100.0, 100.0), "heading_deg": (-360.0, 360.0)}
"""Least and largest values of where a person is in a scene."""
