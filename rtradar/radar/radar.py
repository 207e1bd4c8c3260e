"""The whole radar: how it is made, by name or from a file, what is checked, and its powers in watts."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rtradar.antenna import Antenna
from rtradar.conventions import BOLTZMANN_J_PER_K, NOISE_FIGURE_TEMPERATURE_K
from rtradar.errors import InputError
from rtradar.radar.checks import check_array, check_multiplexing, checked_values
from rtradar.radar.schedule import Schedule
from rtradar.system.checks import printable
from rtradar.system.registry import Registry
from rtradar.system.toml_tables import check_keys, read_toml

PRESETS = Registry(
    "rtradar.radars",
    "radar",
    {"paper-12ghz": "rtradar.presets:paper_12ghz", "paper-77ghz": "rtradar.presets:paper_77ghz"},
)
"""Radars that have a name: what makes them, called without arguments."""

register_radar = PRESETS.register

_MOST_SAMPLES_PER_FRAME = 2**31  # 17 GB; the paper's have 3.3 and 16.4 million


@dataclass(frozen=True, kw_only=True)
class Radar(Schedule):
    """A MIMO FMCW radar with a cross of two linear arrays.

    Antennas are numbered y-line first, then z-line; the index rises with y or z. Chirp m comes from Tx ``m mod n_tx``. Under
    TDM the Tx take turns chirp by chirp, without a gap. Under FDM and DDM all of them transmit at once: chirps 0 to
    ``n_tx - 1`` are those that are on the air together first, and so on.

    Parameters
    ----------
    name : str
        Shown in reports.
    start_frequency_hz, bandwidth_hz : float
        The sweep runs from ``start_frequency_hz`` up by ``bandwidth_hz``.
    chirp_duration_s : float
        One chirp; the next begins as it ends.
    samples_per_chirp : int
        Complex IF samples in one chirp.
    frame_duration_s, frame_hop_s : float
        Length of one coherent processing window and the step between windows.
    tx_y, tx_z, rx_y, rx_z : int
        Antennas along y and along z.
    tx_spacing_wavelengths, rx_spacing_wavelengths : float
        In wavelengths of the START frequency, as in the paper's Table 1.
    position_m : tuple of float
        Centre of both lines, world axes.
    channels : {"pairs", "all"}
        ``pairs``: y-Tx with y-Rx and z-Tx with z-Rx (96 channels in the paper). ``all``: every Tx with every Rx (192).
    polarization : {"v", "h"}
        Co-polar: v is world z, h is world y.
    multiplexing : {"tdm", "fdm", "ddm"}
        What tells the Tx apart: their time (TDM), their carrier (FDM: Tx k sweeps ``tx_offset_hz[k]`` higher, and the receiver
        parts the bands), or their Doppler (DDM, Doppler division: the IF of Tx k is turned by exp(j 2 pi k p / D) from chirp to
        chirp p, which moves it k of D bands of the Doppler axis up; some bands stay empty and tell where the axis begins).
    carrier_step_hz : float, optional
        Of FDM: from one Tx's carrier to the next; the sample rate if left out, the least that keeps the bands apart.
    doppler_bands : int, optional
        Of DDM: D, more than there are Tx; a third more than Tx if left out.
    transmit_power_dbm : float, optional
        Of one Tx, at its antenna. With it powers are known in watts.
    noise_figure_db : float, optional
        Of the receiver, everything from the antenna to the IF samples. With the transmit power it says how strong noise is.
    noise_temperature_k : float
        Of what the antennas see. The noise of the receiver itself follows from its noise figure, which is defined for a source
        at 290 K, and does not change with it.
    tx_antenna, rx_antenna : Antenna, optional
        Of each Tx and Rx, a table in TOML; isotropic if left out.

    Raises
    ------
    InputError
        Where a value has no physical meaning; the message names the field and what is allowed.
    """

    polarization: Literal["v", "h"] = "v"
    transmit_power_dbm: float | None = None
    noise_figure_db: float | None = None
    noise_temperature_k: float = 290.0
    tx_antenna: Antenna | None = None
    rx_antenna: Antenna | None = None

    def __post_init__(self) -> None:
        for field, value in checked_values(
            {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        ).items():
            object.__setattr__(self, field, value)
        check_array(self.name, (self.tx_y, self.tx_z), (self.rx_y, self.rx_z), self.channels)
        check_multiplexing(
            self.name,
            self.multiplexing,
            carrier_step_hz=self.carrier_step_hz,
            start_frequency_hz=self.start_frequency_hz,
            sample_rate_hz=self.sample_rate_hz,
            doppler_bands=self.doppler_bands,
            n_tx=self.n_tx,
            all_heard=self.channels == "all" or not (self.tx_y and self.tx_z),
        )
        if self.cycles_per_frame < 1:
            raise InputError(
                f"radar '{self.name}': frame_duration_s = {self.frame_duration_s} holds no whole "
                f"{self.multiplexing.upper()} cycle of {self.cycle_duration_s * self.n_doppler_bands:.3g} s; "
                "lengthen the frame or shorten the chirp"
            )
        samples = self.chirps_per_frame * self.n_rx * self.samples_per_chirp
        if samples > _MOST_SAMPLES_PER_FRAME:
            raise InputError(
                f"radar '{self.name}': frame_duration_s = {self.frame_duration_s} holds {samples:.2g} samples, more than "
                f"{_MOST_SAMPLES_PER_FRAME:.2g}; shorten the frame, or take fewer samples or longer chirps"
            )

    @classmethod
    def preset(cls, name: str) -> Radar:
        """The radar of that name; `PRESETS` lists them.

        Parameters
        ----------
        name : str
            One of `PRESETS`.

        Returns
        -------
        Radar

        Raises
        ------
        InputError
            Where there is no such preset.
        ExtensionError
            Where it is of another package, and fails.
        """
        make = PRESETS.find(name, instead=", or the path of a TOML file")
        with PRESETS.guarded(name):
            radar = make()
        if not isinstance(radar, cls):
            raise PRESETS.refuse(name, f"gave a {type(radar).__name__}, not a Radar")
        return dataclasses.replace(radar, name=name)

    @classmethod
    def load(cls, source: str | Path) -> Radar:
        """A preset by its name, or a TOML file whose keys are the fields of this class.

        Parameters
        ----------
        source : str or path
            Name of a preset, or path of a ``.toml`` file.

        Returns
        -------
        Radar

        Raises
        ------
        InputError
            Where the file cannot be read, is not TOML, or has an unknown key or a value without meaning.
        """
        if str(source) in PRESETS:
            return cls.preset(str(source))
        path = Path(source)
        if path.suffix != ".toml":
            return cls.preset(str(source))
        table = read_toml(path, "radar", f"give a TOML file or one of: {', '.join(PRESETS)}")
        try:
            check_keys(
                "", table, (), tuple(sorted(field.name for field in dataclasses.fields(cls)))
            )
            return cls(**{"name": printable(path.stem), **table})
        except InputError as error:
            raise InputError(f"radar file '{path}': {error}") from None

    @property
    def watts_per_m2(self) -> float:
        r"""P_t G_t G_r lambda^2 / (4 pi)^3: what turns \|amplitude\|^2 [m^2] into received power [W]; `conventions` has the rest.

        Raises
        ------
        InputError
            Where the radar does not state its transmit power.
        """
        if self.transmit_power_dbm is None:
            raise InputError(
                f"radar '{self.name}' does not state transmit_power_dbm, so powers in watts are not known; give it"
            )
        gains = math.prod(
            antenna.peak_gain
            for antenna in (self.tx_antenna, self.rx_antenna)
            if antenna is not None
        )
        return float(
            1e-3
            * 10 ** (self.transmit_power_dbm / 10)
            * gains
            * self.wavelength_m**2
            / (4 * math.pi) ** 3
        )

    @property
    def noise_power_w(self) -> float:
        """K (T + 290 K (F - 1)) B of one complex IF sample [W].

        T is the `noise_temperature_k` of what the antennas see, F the noise factor and B the sample rate. Noise factors are
        defined for a source at 290 K, so the receiver itself adds the noise of 290 K (F - 1), whatever the antennas see.

        Raises
        ------
        InputError
            Where the radar does not state its noise figure.
        """
        if self.noise_figure_db is None:
            raise InputError(
                f"radar '{self.name}' does not state noise_figure_db, so its noise is not known; give it"
            )
        receiver_k = NOISE_FIGURE_TEMPERATURE_K * (10 ** (self.noise_figure_db / 10) - 1)
        return float(
            BOLTZMANN_J_PER_K * (self.noise_temperature_k + receiver_k) * self.sample_rate_hz
        )
