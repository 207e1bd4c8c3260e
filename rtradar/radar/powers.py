"""The powers of a radar: how strong an echo of 1 m^2 is received, and how strong the noise is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from rtradar.antenna import Antenna
from rtradar.conventions import BOLTZMANN_J_PER_K, NOISE_FIGURE_TEMPERATURE_K
from rtradar.errors import InputError
from rtradar.radar.schedule import Schedule
from rtradar.receiver import Receiver
from rtradar.system.fields import Limits, MaybeEmpty


@dataclass(frozen=True, kw_only=True, repr=False)
class Powers(Schedule):
    """What a radar transmits and receives, and what follows; `Radar` documents the fields."""

    name: MaybeEmpty = "custom"
    polarization: Literal["v", "h"] = "v"
    transmit_power_dbm: Annotated[float | None, Limits(-200, 200)] = None
    noise_figure_db: Annotated[float | None, Limits(0, 100)] = None
    noise_temperature_k: Annotated[float, Limits(0, 1e6)] = 290.0
    tx_antenna: Antenna | None = None
    rx_antenna: Antenna | None = None
    receiver: Receiver | None = None

    @property
    def watts_per_m2(self) -> float:
        r"""Received power [W] of an echo with \|amplitude\|^2 = 1 m^2.

        P_t G_t G_r lambda^2 / (4 pi)^3; `conventions` has the rest. An `InputError` is raised where
        the radar does not state its transmit power.
        """
        power_dbm = self._stated("transmit_power_dbm", "powers in watts are not known")
        antennas = (self.tx_antenna, self.rx_antenna)
        gains = math.prod(antenna.peak_gain for antenna in antennas if antenna is not None)
        power_w = 1e-3 * 10 ** (power_dbm / 10)
        return float(power_w * gains * self.wavelength_m**2 / (4 * math.pi) ** 3)

    @property
    def noise_power_w(self) -> float:
        """Noise power of one complex IF sample, K (T + 290 K (F - 1)) B [W].

        T is the `noise_temperature_k` of what the antennas see, F the noise factor, which is
        defined for a source at 290 K, and B the sample rate. An `InputError` is raised where the
        radar does not state its noise figure.
        """
        figure_db = self._stated("noise_figure_db", "its noise is not known")
        receiver_k = NOISE_FIGURE_TEMPERATURE_K * (10 ** (figure_db / 10) - 1)
        noise_k = self.noise_temperature_k + receiver_k
        return float(BOLTZMANN_J_PER_K * noise_k * self.sample_rate_hz)

    def _stated(self, field: str, otherwise: str) -> float:
        value: float | None = getattr(self, field)
        if value is None:
            raise InputError(f"radar '{self.name}' does not state {field}, so {otherwise}; give it")
        return value
