"""The radar: its fields, and every quantity that follows from them.

A new radar with a name is a function that returns a `Radar`: one of another package is an entry
point of the group ``rtradar.radars``, one of a running program goes to `register_radar`. A TOML
file with the fields of `Radar` as its keys needs no code.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.antenna import Antenna
from rtradar.cards import html_card, text_card
from rtradar.conventions import BOLTZMANN_J_PER_K, NOISE_FIGURE_TEMPERATURE_K, SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import display
from rtradar.radar.checks import check_rules, checked_fields
from rtradar.system.checks import check_keys, printable, read_toml
from rtradar.system.registries import RADARS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PRESETS = RADARS
"""Radars that have a name: each is made by a function without arguments."""

register_radar = PRESETS.register


@dataclass(frozen=True, kw_only=True, repr=False)
class Radar:
    r"""A MIMO FMCW radar with a cross of two linear arrays.

    Antennas are numbered along the y-line first, then along the z-line; the index rises with y or
    z. Chirp m comes from Tx ``m mod n_tx``. Under TDM the Tx transmit one after the other, chirp by
    chirp, without a gap. Under FDM and DDM all of them transmit at once: chirps 0 to ``n_tx - 1``
    are those that are transmitted together first, and so on.

    Parameters
    ----------
    name : str
        Name that reports show.
    start_frequency_hz, bandwidth_hz : float
        Frequency at which the sweep starts, and the width by which it rises [Hz].
    chirp_duration_s : float
        Duration of one chirp [s]; the next begins as it ends.
    samples_per_chirp : int
        Number of complex IF samples in one chirp.
    tx_y, tx_z, rx_y, rx_z : int
        Numbers of Tx and Rx along y and along z.
    tx_spacing_wavelengths, rx_spacing_wavelengths : float
        Spacings of neighbours on a line, in wavelengths of the START frequency, as in the paper's
        Table 1.
    position_m : tuple of float
        Centre of both lines, in world axes [m].
    channels : {"pairs", "all"}
        ``pairs`` keeps y-Tx with y-Rx and z-Tx with z-Rx (96 channels in the paper); ``all`` keeps
        every Tx with every Rx (192).
    frame_duration_s, frame_hop_s : float
        Length of one frame, the coherent processing interval, and the step between frames [s].
    multiplexing : {"tdm", "fdm", "ddm"}
        What tells the Tx apart: their time (TDM), their carrier (FDM: the sweep of Tx k lies
        ``tx_offset_hz[k]`` higher), or their Doppler (DDM: the IF of Tx k is multiplied by exp(j 2
        pi k p / D) at chirp p, which shifts it up by k of the D bands of the Doppler axis; some
        bands stay empty and show where the axis begins).
    carrier_step_hz : float, optional
        Spacing of the carriers of FDM [Hz]; by default the sample rate, the least that keeps the
        bands apart.
    doppler_bands : int, optional
        Number D of Doppler bands of DDM, more than there are Tx; by default a third more than Tx.
    polarization : {"v", "h"}
        Co-polar polarisation of Tx and Rx: v is along world z, h along world y.
    transmit_power_dbm : float, optional
        Power of one Tx at its antenna [dBm]. With it powers are known in watts.
    noise_figure_db : float, optional
        Noise figure of the receiver, from the antenna to the IF samples [dB].
    noise_temperature_k : float
        Noise temperature of the scene that the antennas see [K]; that of the receiver itself
        follows from its noise figure.
    tx_antenna, rx_antenna : Antenna, optional
        Elements of each Tx and Rx, a table in TOML; isotropic by default.

    Raises
    ------
    InputError
        Where a value has no physical meaning.

    Examples
    --------
    >>> import rtradar as rt
    >>> radar = rt.Radar(name="24 GHz", start_frequency_hz=24e9, bandwidth_hz=1e9)
    >>> radar
    Radar 24 GHz
      sweep     24 GHz to 25 GHz, vertical polarisation
      chirp     62.5 µs, 256 samples at 4.096 MHz
      channels  12 Tx × 8 Rx = 96 (each line by itself)
      frame     100 ms every 25 ms: 133 cycles of 750 µs
      position  (-4, 1, 1) m, boresight +x
      range     38.37 m, resolution 14.99 cm
      velocity  ±4.079 m/s, resolution 0.0613 m/s
      angle     ±78.4° in azimuth and elevation, resolution 2.07° at boresight
    >>> print(f"{radar.max_velocity_mps:.2f} m/s")
    4.08 m/s
    >>> rt.Radar(name="own", tx_z=0, rx_z=0, bandwidth_hz=1e9).n_channels
    48
    """

    name: str = "custom"
    start_frequency_hz: float = 12e9
    bandwidth_hz: float = 4e9
    chirp_duration_s: float = 62.5e-6
    samples_per_chirp: int = 256
    tx_y: int = 6
    tx_z: int = 6
    rx_y: int = 8
    rx_z: int = 8
    tx_spacing_wavelengths: float = 4.0
    rx_spacing_wavelengths: float = 0.5
    position_m: tuple[float, float, float] = (-4.0, 1.0, 1.0)
    channels: Literal["pairs", "all"] = "pairs"
    frame_duration_s: float = 0.1
    frame_hop_s: float = 0.025
    multiplexing: Literal["tdm", "fdm", "ddm"] = "tdm"
    carrier_step_hz: float | None = None
    doppler_bands: int | None = None
    polarization: Literal["v", "h"] = "v"
    transmit_power_dbm: float | None = None
    noise_figure_db: float | None = None
    noise_temperature_k: float = 290.0
    tx_antenna: Antenna | None = None
    rx_antenna: Antenna | None = None

    def __post_init__(self) -> None:
        given = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        for field, value in checked_fields(given).items():
            object.__setattr__(self, field, value)
        check_rules(self)

    def __repr__(self) -> str:
        return text_card("Radar", self.name, display.brief_rows(self))

    def _repr_html_(self) -> str:
        tables = {
            "Settings": display.settings_rows(self),
            "Limits that follow": display.limit_rows(self),
        }
        return html_card("Radar", self.name, tables)

    @classmethod
    def preset(cls, name: str) -> Radar:
        """Make the preset of a name; an `InputError` is raised where there is none.

        Parameters
        ----------
        name : str
            Name among `rtradar.radar.PRESETS`.

        Returns
        -------
        Radar

        Examples
        --------
        >>> import rtradar as rt
        >>> rt.Radar.preset("paper-77ghz").start_frequency_hz
        77000000000.0
        """
        make = PRESETS.find(name, instead=", or the path of a TOML file")
        with PRESETS.guarded(name):
            radar = make()
        if not isinstance(radar, Radar):
            raise PRESETS.refuse(name, f"gave a {type(radar).__name__}, not a Radar")
        return dataclasses.replace(radar, name=name)

    @classmethod
    def load(cls, source: str | Path) -> Radar:
        """Make a preset by its name, or read a TOML file whose keys are the fields of this class.

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
            Where the file cannot be read, has an unknown key, or has a value without meaning.
        """
        path = Path(source)
        if str(source) in PRESETS or path.suffix != ".toml":
            return cls.preset(str(source))
        table = read_toml(path, "radar", f"give a TOML file or one of: {', '.join(PRESETS)}")
        keys = tuple(sorted(field.name for field in dataclasses.fields(cls)))
        try:
            check_keys("", table, (), keys)
            return cls(**{"name": printable(path.stem), **table})
        except InputError as error:
            raise InputError(f"radar file '{path}': {error}") from None

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the array, and beside it the ranges and velocities that it can measure.

        Parameters
        ----------
        ax : Axes, optional
            Axes of Matplotlib to draw the array on, without the limits beside it; by default both
            are drawn in a new figure.

        Returns
        -------
        Axes
            Axes of the array: Tx, Rx and virtual elements about their centre [mm], seen from behind
            the radar.

        Examples
        --------
        >>> import rtradar as rt
        >>> axes = rt.Radar.preset("paper-12ghz").plot()
        >>> axes.get_xlabel()
        'y [mm]'
        """
        from rtradar.radar.picture import plot_radar

        return plot_radar(self, ax)

    # -- waveform and range (derived) --------------------------------------------------------------

    @property
    def centre_frequency_hz(self) -> float:
        """Frequency at the middle of the sweep [Hz]; the phase at a range bin changes with it."""
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
        """Sweep rate [Hz/s] (:eq:`chirp`)."""
        return self.bandwidth_hz / self.chirp_duration_s

    @property
    def sample_rate_hz(self) -> float:
        """Rate of the complex IF samples [Hz]."""
        return self.samples_per_chirp / self.chirp_duration_s

    @property
    def range_bin_m(self) -> float:
        """Range resolution and width of one range bin, c / 2B [m] (:eq:`range-axis`)."""
        return SPEED_OF_LIGHT_MPS / (2 * self.bandwidth_hz)

    @property
    def max_range_m(self) -> float:
        """Range whose beat frequency is the sample rate, c Fs / 2s [m] (:eq:`range-axis`)."""
        return self.range_bin_m * self.samples_per_chirp

    @cached_property
    def range_m(self) -> NDArray[np.float64]:
        """Range of each range bin (range,) [m], half the length of the path from Tx to Rx."""
        return np.arange(self.samples_per_chirp, dtype=np.float64) * self.range_bin_m

    # -- array and angle (derived) -----------------------------------------------------------------

    @property
    def n_tx(self) -> int:
        """Number of transmitters, and of chirps in one cycle."""
        return self.tx_y + self.tx_z

    @property
    def n_rx(self) -> int:
        """Length of the rx axis: the number of receivers that are kept in one chirp."""
        one_line = self.rx_y if self.tx_y else self.rx_z
        return self.rx_y + self.rx_z if self.channels == "all" else one_line

    @property
    def n_channels(self) -> int:
        """Number of virtual channels, ``n_tx * n_rx``; channel = tx * n_rx + rx."""
        return self.n_tx * self.n_rx

    @cached_property
    def tx(self) -> NDArray[np.float64]:
        """Positions of the transmitters (tx, 3) [m], world: the y-line, then the z-line."""
        return self._lines(self.tx_y, self.tx_z, self.tx_spacing_wavelengths)

    @cached_property
    def rx(self) -> NDArray[np.float64]:
        """Positions of the receivers (rx, 3) [m], world: the y-line, then the z-line."""
        return self._lines(self.rx_y, self.rx_z, self.rx_spacing_wavelengths)

    def _lines(self, n_y: int, n_z: int, spacing_wavelengths: float) -> NDArray[np.float64]:
        spacing_m = spacing_wavelengths * self.start_wavelength_m
        positions = np.zeros((n_y + n_z, 3))
        positions[:n_y, 1] = (np.arange(n_y) - (n_y - 1) / 2) * spacing_m
        positions[n_y:, 2] = (np.arange(n_z) - (n_z - 1) / 2) * spacing_m
        return positions + np.asarray(self.position_m)

    @cached_property
    def rx_of_tx(self) -> NDArray[np.int64]:
        """Indices into `rx` of the receivers kept while each Tx transmits, (tx, rx)."""
        if self.channels == "all":
            return np.tile(np.arange(self.n_rx), (self.n_tx, 1))
        first = np.repeat([0, self.rx_y], [self.tx_y, self.tx_z])
        return first[:, None] + np.arange(self.n_rx)

    @property
    def max_angle_deg(self) -> float:
        """Unambiguous azimuth and elevation, asin(lambda / 2d) [deg] (:eq:`angle-axis`)."""
        return math.degrees(math.asin(min(1.0, 1 / (2 * self._virtual_spacing_wavelengths))))

    @property
    def angle_resolution_deg(self) -> float:
        """Half-power beam width of one virtual line at broadside, 0.886 lambda / N d [deg].

        It is that of the far field (:eq:`angle-axis`). Where the spacings of Tx and Rx do not fill
        a line without gaps, it is the width for a line of as many elements.
        """
        elements = max(self.tx_y * self.rx_y, self.tx_z * self.rx_z)
        if elements < 2:
            return 180.0
        return min(180.0, math.degrees(0.886 / (elements * self._virtual_spacing_wavelengths)))

    @property
    def _virtual_spacing_wavelengths(self) -> float:
        return self.rx_spacing_wavelengths * self.start_wavelength_m / self.wavelength_m

    # -- schedule and velocity (derived) -----------------------------------------------------------

    @property
    def at_once(self) -> bool:
        """Whether all Tx transmit at once."""
        return self.multiplexing != "tdm"

    @property
    def cycle_duration_s(self) -> float:
        """Time until the same Tx transmits again [s]: all chirps of a cycle under TDM, else one."""
        return self.chirp_duration_s if self.at_once else self.n_tx * self.chirp_duration_s

    @property
    def chirp_interval_s(self) -> float:
        """Mean time from one chirp to the next, counted over all Tx [s]."""
        return self.chirp_duration_s / self.n_tx if self.at_once else self.chirp_duration_s

    @cached_property
    def tx_delay_s(self) -> NDArray[np.float64]:
        """Delay of each Tx after the first Tx of a cycle, (tx,) [s]."""
        step_s = 0.0 if self.at_once else self.chirp_duration_s
        return np.arange(self.n_tx, dtype=np.float64) * step_s

    @cached_property
    def tx_offset_hz(self) -> NDArray[np.float64]:
        """Height of the sweep of each Tx above `start_frequency_hz`, (tx,) [Hz]; the mean is 0."""
        if self.multiplexing != "fdm":
            return np.zeros(self.n_tx)
        step = self.sample_rate_hz if self.carrier_step_hz is None else self.carrier_step_hz
        return np.asarray((np.arange(self.n_tx) - (self.n_tx - 1) / 2) * step)

    @property
    def occupied_bandwidth_hz(self) -> float:
        """Width from the lowest to the highest frequency transmitted [Hz]; larger under FDM."""
        return self.bandwidth_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def receiver_rate_hz(self) -> float:
        """Complex sample rate of a receiver before it separates the bands of FDM, if any [Hz]."""
        return self.sample_rate_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def n_doppler_bands(self) -> int:
        """Number of bands of the Doppler axis under DDM, else 1."""
        if self.multiplexing != "ddm":
            return 1
        default = self.n_tx + math.ceil(self.n_tx / 3)
        return default if self.doppler_bands is None else self.doppler_bands

    @property
    def cycles_per_frame(self) -> int:
        """Number of whole cycles in one frame; a multiple of `n_doppler_bands` under DDM."""
        cycles = math.floor(self.frame_duration_s / self.cycle_duration_s * (1 + 1e-12))
        return cycles - cycles % self.n_doppler_bands

    @property
    def hop_cycles(self) -> float:
        """Number of cycles from one frame to the next, not rounded, and at least 1."""
        return max(1.0, self.frame_hop_s / self.cycle_duration_s)

    @property
    def chirps_per_frame(self) -> int:
        """Number of chirps in the whole cycles of one frame."""
        return self.cycles_per_frame * self.n_tx

    @property
    def max_velocity_mps(self) -> float:
        """Unambiguous velocity, lambda / (4 cycle) [m/s] (:eq:`doppler-axis`)."""
        return self.wavelength_m / (4 * self.cycle_duration_s)

    @property
    def velocity_bin_mps(self) -> float:
        """Velocity resolution and width of one Doppler bin [m/s] (:eq:`doppler-axis`)."""
        return self.wavelength_m / (2 * self.cycles_per_frame * self.cycle_duration_s)

    def velocity_mps(self, n_cycles: int) -> NDArray[np.float64]:
        """Give the velocity of each Doppler bin, ascending, zero at index ``n_cycles // 2``.

        Parameters
        ----------
        n_cycles : int
            Number of cycles in the frame that is transformed.

        Returns
        -------
        (velocity,) float64
            Velocity [m/s].
        """
        bins = np.arange(n_cycles, dtype=np.float64) - n_cycles // 2
        return bins * (self.wavelength_m / (2 * n_cycles * self.cycle_duration_s))

    def tx_of_chirp(self, chirp: NDArray[np.integer]) -> NDArray[np.int64]:
        """Find the transmitter of each chirp (:eq:`tdm`).

        Parameters
        ----------
        chirp : (chirp,) int
            Numbers of chirps, from 0 at the start of the capture.

        Returns
        -------
        (chirp,) int64
            Index into `tx`.
        """
        return np.asarray(chirp, dtype=np.int64) % self.n_tx

    def chirp_times(self, n: int, first: int = 0) -> NDArray[np.float64]:
        """Give the centres of ``n`` successive chirps (:eq:`tdm`).

        Parameters
        ----------
        n, first : int
            Number of chirps, and the number of the first.

        Returns
        -------
        (chirp,) float64
            Time since the start of the capture [s].
        """
        return self.centres_of(np.arange(first, first + n))

    def centres_of(self, chirps: NDArray[np.integer]) -> NDArray[np.float64]:
        """Give the centres of some chirps.

        Parameters
        ----------
        chirps : (chirp,) int
            Numbers of chirps, from 0 at the start of the capture.

        Returns
        -------
        (chirp,) float64
            Time since the start of the capture [s].
        """
        slots = np.asarray(chirps) // self.n_tx if self.at_once else np.asarray(chirps)
        return np.asarray((slots + 0.5) * self.chirp_duration_s, dtype=np.float64)

    def window_starts(self, n_chirps: int) -> NDArray[np.int64]:
        """Find the first cycle of each frame in a capture of ``n_chirps``.

        A frame starts at the cycle boundary nearest to a multiple of ``frame_hop_s`` and holds
        ``cycles_per_frame``.

        Parameters
        ----------
        n_chirps : int
            Number of chirps in the capture.

        Returns
        -------
        (window,) int64
            Numbers of cycles; empty where the capture is shorter than one frame.
        """
        last = n_chirps // self.n_tx - self.cycles_per_frame
        candidates = np.arange(max(0, math.floor((last + 0.5) / self.hop_cycles) + 1))
        starts = np.rint(candidates * self.hop_cycles).astype(np.int64)
        return np.unique(starts[starts <= last])

    def window_times(self, starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Give the centres of frames.

        Parameters
        ----------
        starts : (window,) int
            First cycle of each frame, as `window_starts` gives them.

        Returns
        -------
        (window,) float64
            Time since the start of the capture [s].
        """
        centres = np.asarray(starts) + self.cycles_per_frame / 2
        return np.asarray(centres * self.cycle_duration_s, dtype=np.float64)

    # -- powers (derived) --------------------------------------------------------------------------

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
