"""The radar: waveform, array, schedule of its Tx, and every limit that follows from them (the paper's Tables 1 and 2)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.antenna import Antenna
from rtradar.conventions import BOLTZMANN_J_PER_K, SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar_checks import check_array, check_multiplexing, checked_values
from rtradar.registry import Registry
from rtradar.toml_tables import check_keys, read_toml

PRESETS = Registry(
    "rtradar.radars", "radar", {"paper-12ghz": "rtradar.presets:paper_12ghz", "paper-77ghz": "rtradar.presets:paper_77ghz"}
)
"""Radars that have a name: what makes them, called without arguments."""

register_radar = PRESETS.register

_MOST_SAMPLES_PER_FRAME = 2**31  # 17 GB; the paper's have 3.3 and 16.4 million


@dataclass(frozen=True, kw_only=True)
class Radar:
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
        Of what the antennas see; 290 K is the one that noise figures refer to.
    tx_antenna, rx_antenna : Antenna, optional
        Of each Tx and Rx, a table in TOML; isotropic if left out.

    Raises
    ------
    InputError
        Where a value has no physical meaning; the message names the field and what is allowed.
    """

    name: str = "custom"
    start_frequency_hz: float = 12e9
    bandwidth_hz: float = 4e9
    chirp_duration_s: float = 62.5e-6
    samples_per_chirp: int = 256
    frame_duration_s: float = 0.1
    frame_hop_s: float = 0.025
    tx_y: int = 6
    tx_z: int = 6
    rx_y: int = 8
    rx_z: int = 8
    tx_spacing_wavelengths: float = 4.0
    rx_spacing_wavelengths: float = 0.5
    position_m: tuple[float, float, float] = (-4.0, 1.0, 1.0)
    channels: Literal["pairs", "all"] = "pairs"
    polarization: Literal["v", "h"] = "v"
    multiplexing: Literal["tdm", "fdm", "ddm"] = "tdm"
    carrier_step_hz: float | None = None
    doppler_bands: int | None = None
    transmit_power_dbm: float | None = None
    noise_figure_db: float | None = None
    noise_temperature_k: float = 290.0
    tx_antenna: Antenna | None = None
    rx_antenna: Antenna | None = None

    def __post_init__(self) -> None:
        for field, value in checked_values({field.name: getattr(self, field.name) for field in dataclasses.fields(self)}).items():
            object.__setattr__(self, field, value)
        check_array(self.name, (self.tx_y, self.tx_z), (self.rx_y, self.rx_z), self.channels)
        check_multiplexing(
            self.name,
            self.multiplexing,
            carrier_step_hz=self.carrier_step_hz,
            sample_rate_hz=self.sample_rate_hz,
            doppler_bands=self.doppler_bands,
            n_tx=self.n_tx,
            all_heard=not (self.rx_of_tx != self.rx_of_tx[0]).any(),
        )
        if self.cycles_per_frame < 1:
            raise InputError(
                f"radar '{self.name}': frame_duration_s = {self.frame_duration_s} holds no whole "
                f"{self.multiplexing.upper()} cycle of {self.cycle_duration_s * self._cycles_together:.3g} s; "
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
            check_keys("", table, (), tuple(sorted(field.name for field in dataclasses.fields(cls))))
            return cls(**{"name": path.stem, **table})
        except InputError as error:
            raise InputError(f"radar file '{path}': {error}") from None

    # -- waveform ------------------------------------------------------------------------------------------------

    @property
    def centre_frequency_hz(self) -> float:
        """Middle of the sweep [Hz]; phases at a range bin turn with this one."""
        return self.start_frequency_hz + self.bandwidth_hz / 2

    @property
    def wavelength_m(self) -> float:
        """Wavelength at the sweep centre [m]."""
        return SPEED_OF_LIGHT_MPS / self.centre_frequency_hz

    @property
    def start_wavelength_m(self) -> float:
        """Wavelength at the sweep start [m], the unit of the antenna spacings."""
        return SPEED_OF_LIGHT_MPS / self.start_frequency_hz

    @property
    def slope_hz_per_s(self) -> float:
        """Sweep rate [Hz/s]."""
        return self.bandwidth_hz / self.chirp_duration_s

    @property
    def sample_rate_hz(self) -> float:
        """Complex IF samples a second [Hz]."""
        return self.samples_per_chirp / self.chirp_duration_s

    # -- schedule ------------------------------------------------------------------------------------------------

    @property
    def n_tx(self) -> int:
        """Transmitters, and chirps in one cycle."""
        return self.tx_y + self.tx_z

    @property
    def n_rx(self) -> int:
        """Length of the rx axis: receivers that are kept in one chirp."""
        return self.rx_y + self.rx_z if self.channels == "all" else (self.rx_y if self.tx_y else self.rx_z)

    @property
    def n_channels(self) -> int:
        """Virtual channels, ``n_tx * n_rx``; channel = tx * n_rx + rx."""
        return self.n_tx * self.n_rx

    @property
    def cycle_duration_s(self) -> float:
        """Time until the same Tx transmits again [s]: one turn through all Tx under TDM, else one chirp."""
        return self.chirp_duration_s if self.at_once else self.n_tx * self.chirp_duration_s

    @property
    def at_once(self) -> bool:
        """Whether all Tx transmit at once."""
        return self.multiplexing != "tdm"

    @property
    def chirp_interval_s(self) -> float:
        """Mean time from one chirp to the next, counted over all Tx [s]."""
        return self.chirp_duration_s / self.n_tx if self.at_once else self.chirp_duration_s

    @cached_property
    def tx_delay_s(self) -> NDArray[np.float64]:
        """How long after the first Tx each Tx transmits in a cycle, (tx,) [s]."""
        return np.asarray(np.arange(self.n_tx) * (0.0 if self.at_once else self.chirp_duration_s), dtype=np.float64)

    @cached_property
    def tx_offset_hz(self) -> NDArray[np.float64]:
        """How far the sweep of each Tx lies above that of `start_frequency_hz`, (tx,) [Hz]; their mean is 0."""
        if self.multiplexing != "fdm":
            return np.zeros(self.n_tx)
        step = self.sample_rate_hz if self.carrier_step_hz is None else float(self.carrier_step_hz)
        return np.asarray((np.arange(self.n_tx) - (self.n_tx - 1) / 2) * step)

    @property
    def occupied_bandwidth_hz(self) -> float:
        """From the lowest to the highest frequency transmitted [Hz]; FDM takes more than the sweep."""
        return self.bandwidth_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def receiver_rate_hz(self) -> float:
        """Complex samples a second of a receiver before it parts the bands of FDM [Hz]; else the `sample_rate_hz`."""
        return self.sample_rate_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def n_doppler_bands(self) -> int:
        """Bands of the Doppler axis under DDM, else 1."""
        if self.multiplexing != "ddm":
            return 1
        return self.n_tx + math.ceil(self.n_tx / 3) if self.doppler_bands is None else int(self.doppler_bands)

    @property
    def _cycles_together(self) -> int:
        """A frame holds a multiple of so many cycles: with DDM, each Tx then moves by whole Doppler bins."""
        return self.n_doppler_bands

    @property
    def cycles_per_frame(self) -> int:
        """Whole cycles in one frame (133 of the paper's 133.3); under DDM a multiple of `n_doppler_bands`."""
        cycles = math.floor(self.frame_duration_s / self.cycle_duration_s * (1 + 1e-12))
        return cycles - cycles % self._cycles_together

    @property
    def chirps_per_frame(self) -> int:
        """Chirps in the whole cycles of one frame."""
        return self.cycles_per_frame * self.n_tx

    def tx_of_chirp(self, chirp: NDArray[np.integer]) -> NDArray[np.int64]:
        """Transmitter of each chirp, numbered from the start of the capture.

        Parameters
        ----------
        chirp : (chirp,) int
            From 0.

        Returns
        -------
        (chirp,) int64
            Index into `tx`.

        Notes
        -----
        Equation :eq:`tdm` of the theory page.
        """
        return np.asarray(chirp, dtype=np.int64) % self.n_tx

    def chirp_times(self, n: int, first: int = 0) -> NDArray[np.float64]:
        """Centres of ``n`` chirps from chirp ``first`` on, (chirp,) [s] since the start of the capture.

        Parameters
        ----------
        n : int
            How many.
        first : int
            Number of the first of them.

        Returns
        -------
        (chirp,) float64
            [s].

        Notes
        -----
        Equation :eq:`tdm` of the theory page.
        """
        return self.centres_of(np.arange(first, first + n))

    def centres_of(self, chirps: NDArray[np.integer]) -> NDArray[np.float64]:
        """When the centres of some chirps are.

        Parameters
        ----------
        chirps : (chirp,) int
            Counted from the start of the capture.

        Returns
        -------
        (chirp,) float64
            [s] since the start of the capture.
        """
        slots = np.asarray(chirps) // self.n_tx if self.at_once else np.asarray(chirps)
        return np.asarray((slots + 0.5) * self.chirp_duration_s, dtype=np.float64)

    def window_starts(self, n_chirps: int) -> NDArray[np.int64]:
        """First cycle of each processing window in a capture of ``n_chirps``, (window,).

        A window starts at the cycle boundary nearest to a multiple of ``frame_hop_s`` and takes ``cycles_per_frame``.

        Parameters
        ----------
        n_chirps : int
            In the capture.

        Returns
        -------
        (window,) int64
            Cycles; none where the capture is shorter than one window.
        """
        last = n_chirps // self.n_tx - self.cycles_per_frame
        if last < 0:
            return np.zeros(0, dtype=np.int64)
        # A hop below one cycle reaches every cycle, as one of a cycle does.
        hop = max(1.0, self.frame_hop_s / self.cycle_duration_s)
        starts = np.rint(np.arange(math.floor((last + 0.5) / hop) + 1) * hop).astype(np.int64)
        return np.unique(starts[starts <= last])

    def window_times(self, starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Centres of the windows that start at these cycles, (window,) [s].

        Parameters
        ----------
        starts : (window,) int
            First cycle of each, as of `window_starts`.

        Returns
        -------
        (window,) float64
            Since the start of the capture [s].
        """
        return np.asarray((np.asarray(starts) + self.cycles_per_frame / 2) * self.cycle_duration_s, dtype=np.float64)

    # -- watts ---------------------------------------------------------------------------------------------------

    @property
    def watts_per_m2(self) -> float:
        r"""P_t G_t G_r lambda^2 / (4 pi)^3: what turns \|amplitude\|^2 [m^2] into received power [W]; `conventions` has the rest.

        Raises
        ------
        InputError
            Where the radar does not state its transmit power.
        """
        if self.transmit_power_dbm is None:
            raise InputError(f"radar '{self.name}' does not state transmit_power_dbm, so powers in watts are not known; give it")
        gains = math.prod(antenna.peak_gain for antenna in (self.tx_antenna, self.rx_antenna) if antenna is not None)
        return float(1e-3 * 10 ** (self.transmit_power_dbm / 10) * gains * self.wavelength_m**2 / (4 * math.pi) ** 3)

    @property
    def noise_power_w(self) -> float:
        """K T F B of one complex IF sample [W], B the sample rate.

        Raises
        ------
        InputError
            Where the radar does not state its noise figure.
        """
        if self.noise_figure_db is None:
            raise InputError(f"radar '{self.name}' does not state noise_figure_db, so its noise is not known; give it")
        factor = 10 ** (self.noise_figure_db / 10)
        return float(BOLTZMANN_J_PER_K * self.noise_temperature_k * factor * self.sample_rate_hz)

    # -- array ---------------------------------------------------------------------------------------------------

    def _lines(self, along_y: int, along_z: int, spacing_m: float) -> NDArray[np.float64]:
        places = np.zeros((along_y + along_z, 3))
        places[:along_y, 1] = (np.arange(along_y) - (along_y - 1) / 2) * spacing_m
        places[along_y:, 2] = (np.arange(along_z) - (along_z - 1) / 2) * spacing_m
        return places + np.asarray(self.position_m)

    @cached_property
    def tx(self) -> NDArray[np.float64]:
        """Transmitters (tx, 3) [m], world."""
        return self._lines(self.tx_y, self.tx_z, self.tx_spacing_wavelengths * self.start_wavelength_m)

    @cached_property
    def rx(self) -> NDArray[np.float64]:
        """Receivers (rx, 3) [m], world: the y-line, then the z-line."""
        return self._lines(self.rx_y, self.rx_z, self.rx_spacing_wavelengths * self.start_wavelength_m)

    @cached_property
    def rx_of_tx(self) -> NDArray[np.int64]:
        """Indices into `rx` of the receivers kept while each Tx transmits, (tx, rx)."""
        if self.channels == "all":
            return np.tile(np.arange(self.rx_y + self.rx_z), (self.n_tx, 1))
        y_line = np.tile(np.arange(self.rx_y), (self.tx_y, 1)) if self.tx_y else np.zeros((0, self.n_rx), np.int64)
        z_line = np.tile(np.arange(self.rx_z) + self.rx_y, (self.tx_z, 1)) if self.tx_z else np.zeros((0, self.n_rx), np.int64)
        return np.concatenate([y_line, z_line])

    # -- what it can measure (the paper's Table 2, by the physics) ---------------------------------------------------

    @property
    def range_bin_m(self) -> float:
        """Range resolution and width of one range bin, c / 2B [m] (paper, eq. 2).

        Equation :eq:`range-axis` of the theory page.
        """
        return SPEED_OF_LIGHT_MPS / (2 * self.bandwidth_hz)

    @property
    def max_range_m(self) -> float:
        """Range whose beat frequency reaches the sample rate, c Fs / 2s [m] (paper, eq. 1).

        Equation :eq:`range-axis` of the theory page.
        """
        return self.range_bin_m * self.samples_per_chirp

    @property
    def max_velocity_mps(self) -> float:
        """Unambiguous velocity, lambda / (4 cycle) with the centre wavelength [m/s] (paper, eq. 3).

        Equation :eq:`doppler-axis` of the theory page.
        """
        return self.wavelength_m / (4 * self.cycle_duration_s)

    @property
    def velocity_bin_mps(self) -> float:
        """Velocity resolution and width of one Doppler bin, centre wavelength [m/s] (paper, eq. 4).

        Equation :eq:`doppler-axis` of the theory page.
        """
        return self.wavelength_m / (2 * self.cycles_per_frame * self.cycle_duration_s)

    @property
    def max_angle_deg(self) -> float:
        """Unambiguous azimuth and elevation, asin(lambda / 2d) with the centre wavelength [deg] (paper, eq. 5).

        Equation :eq:`angle-axis` of the theory page.
        """
        return math.degrees(math.asin(min(1.0, 1 / (2 * self._virtual_spacing_wavelengths))))

    @property
    def angle_resolution_deg(self) -> float:
        """Half-power beam width of one uniform virtual line in its far field at broadside, 0.886 lambda / N d [deg].

        Where Tx and Rx spacing do not fill a line without gaps this is that of the line of the same element count.

        Equation :eq:`angle-axis` of the theory page.
        """
        elements = max(self.tx_y * self.rx_y, self.tx_z * self.rx_z)
        if elements < 2:
            return 180.0
        return min(180.0, math.degrees(0.886 / (elements * self._virtual_spacing_wavelengths)))

    @property
    def _virtual_spacing_wavelengths(self) -> float:
        return self.rx_spacing_wavelengths * self.start_wavelength_m / self.wavelength_m

    @cached_property
    def range_m(self) -> NDArray[np.float64]:
        """Range of each range bin (range,) [m], half the Tx..Rx path."""
        return np.arange(self.samples_per_chirp, dtype=np.float64) * self.range_bin_m

    def velocity_mps(self, n_cycles: int) -> NDArray[np.float64]:
        """Velocity of each Doppler bin (velocity,) [m/s], ascending, zero at index ``n_cycles // 2``.

        Parameters
        ----------
        n_cycles : int
            In the window that is transformed.

        Returns
        -------
        (velocity,) float64
            [m/s].
        """
        bins = np.arange(n_cycles, dtype=np.float64) - n_cycles // 2
        return bins * (self.wavelength_m / (2 * n_cycles * self.cycle_duration_s))
