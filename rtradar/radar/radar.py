"""The radar: its fields, and every quantity that follows from them.

A new radar with a name is a function that returns a `Radar`: one of another package is an entry
point of the group ``rtradar.radars``, one of a running program goes to `register_radar`. A TOML
file with the fields of `Radar` as its keys needs no code.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from rtradar.cards import html_card, text_card
from rtradar.conventions import BOLTZMANN_J_PER_K, NOISE_FIGURE_TEMPERATURE_K
from rtradar.errors import InputError, prefixed
from rtradar.front_end import Antenna, Chip, Receiver
from rtradar.radar import display
from rtradar.radar.checks import check_rules
from rtradar.radar.schedule import FollowingCount, Schedule
from rtradar.system.checks import brief, check_keys, printable
from rtradar.system.fields import Limits, MaybeEmpty, check_fields
from rtradar.system.registries import OR_RADAR_FILE, RADARS, radar_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PRESETS = RADARS
"""Radars that have a name: each is made by a function without arguments."""

register_radar = PRESETS.register


@dataclass(frozen=True, kw_only=True, repr=False)
class Radar(Schedule):
    r"""A MIMO FMCW radar with a cross of two linear arrays, or antennas anywhere.

    Antennas of a cross are numbered along the y-line first, then along the z-line; the index rises
    with y or z. Chirp m comes from Tx ``m mod n_tx``. Under TDM the Tx transmit one after the
    other, chirp by chirp. Under FDM and DDM all of them transmit at once: chirps 0 to ``n_tx - 1``
    are those that are transmitted together first, and so on. Under BPM each chirp is one of all Tx.

    Parameters
    ----------
    name : str
        Name that reports show.
    start_frequency_hz, bandwidth_hz : float
        Frequency at which the sweep starts, and the width by which it rises [Hz].
    chirp_duration_s : float
        Duration of one chirp, in which the frequency rises by the bandwidth [s].
    samples_per_chirp : int
        Number of complex IF samples in one chirp.
    idle_s : float
        Time from the end of a chirp to the start of the next [s].
    adc_start_s : float
        Time from the start of a chirp to its first IF sample [s].
    adc_rate_hz : float, optional
        Rate of the complex IF samples [Hz]; by default they fill the rest of the chirp. Range
        resolution follows from the part of the sweep that is sampled.
    tx_y, tx_z, rx_y, rx_z : int
        Numbers of Tx and Rx along y and along z.
    tx_spacing_wavelengths, rx_spacing_wavelengths : float
        Spacings of neighbours on a line, in wavelengths of the START frequency, as in the paper's
        Table 1.
    tx_positions_m, rx_positions_m : sequence of (x, y, z), optional
        Places of Tx and of Rx, in place of their two lines, in the radar's axes about its position
        [m]: x along the boresight, y to the left, z up.
    tx_order : sequence of int, optional
        Tx in the order in which they transmit, each once: indices into the list, or of the y-line
        and then the z-line. By default they transmit in that order.
    position_m : tuple of float
        Centre of both lines, or the origin of the lists, in world axes [m]. Where it is not given a
        scene may have another.
    yaw_deg, pitch_deg, roll_deg : float
        How the radar is turned [deg]: yaw turns its boresight from world x to the left, pitch
        raises it, and roll turns the array about it, anticlockwise seen from the front.
    path_times_s, path_m, path_angles_deg : sequence, optional
        Motion of the radar: times [s], ascending, how far it is from its position then, (x, y, z)
        in world axes [m], and how far it is turned from its yaw, pitch and roll [deg]. In between
        it goes straight and evenly, and before and after it rests.
    channels : {"pairs", "all"}
        ``pairs`` keeps y-Tx with y-Rx and z-Tx with z-Rx (96 channels in the paper); ``all`` keeps
        every Tx with every Rx (192). With a list every Rx is kept.
    frame_duration_s, frame_hop_s : float
        Length of one frame, the coherent processing interval, and the step between frames [s].
        They follow from the next two where these are given.
    frame_period_s : float, optional
        Time from the start of a frame to the start of the next [s], where chirps are transmitted in
        frames with a gap between them. By default they go on without a gap.
    cycle_period_s : float, optional
        Time from the start of a cycle to the start of the next [s], where a gap follows each. By
        default there is none. `over_capture` makes it of a ``frame_period_s``.
    chirps_per_frame : int, optional
        Number of chirps in one frame, counted over all Tx, a multiple of their number. By default
        what ``frame_duration_s`` holds.
    multiplexing : {"tdm", "fdm", "ddm", "bpm"}
        What tells the Tx apart: their time (TDM), their carrier (FDM: the sweep of Tx k lies
        ``tx_offset_hz[k]`` higher), or their Doppler (DDM: the IF of Tx k is multiplied by exp(j 2
        pi k p / D) at chirp p, which shifts it up by k of the D bands of the Doppler axis; some
        bands stay empty and show where the axis begins), or their sign (BPM: 2, 4, 8 ... Tx
        transmit at once, each with a row of a Hadamard matrix as the signs of its chirps).
    carrier_step_hz : float, optional
        Spacing of the carriers of FDM [Hz]; by default the sample rate, the least that keeps the
        bands apart.
    doppler_bands : int, optional
        Number D of Doppler bands of DDM, more than there are Tx; by default a third more than Tx.
    polarization : {"v", "h"}
        Co-polar polarisation of Tx and Rx on the boresight: v is along the radar's own z axis, h
        along its y axis.
    transmit_power_dbm : float, optional
        Power of one Tx at its antenna [dBm]. With it powers are known in watts.
    noise_figure_db : float, optional
        Noise figure of the receiver, from the antenna to the IF samples [dB].
    noise_temperature_k : float
        Noise temperature of the scene that the antennas see [K]; that of the receiver itself
        follows from its noise figure.
    tx_antenna, rx_antenna : Antenna, optional
        Elements of each Tx and Rx, a table in TOML; isotropic by default.
    receiver : Receiver, optional
        What the receiver adds to the IF, a table in TOML; an ideal one by default.
    chip : Chip, optional
        How `ti-oob` detects on this radar, a table in TOML; as the "out of box" demo by default.

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

    name: MaybeEmpty = "custom"
    polarization: Literal["v", "h"] = "v"
    transmit_power_dbm: Annotated[float | None, Limits(-200, 200)] = None
    noise_figure_db: Annotated[float | None, Limits(0, 100)] = None
    noise_temperature_k: Annotated[float, Limits(0, 1e6)] = 290.0
    tx_antenna: Antenna | None = None
    rx_antenna: Antenna | None = None
    receiver: Receiver | None = None
    chip: Chip | None = None

    def __post_init__(self) -> None:
        # The number of chirps either is given or follows from the duration of a frame. One that
        # follows is marked by its type, so that a copy with another duration finds its own.
        given: object = self.chirps_per_frame
        if given is None:
            object.__setattr__(self, "chirps_per_frame", FollowingCount(1))
        check_fields(self, f"radar {brief(self.name)}: ")
        check_rules(self)
        # Fields that follow from others are written into the radar, for whoever reads them: chirps
        # by the duration, the duration by chirps that were given, and the hop by the period of
        # frames.
        following: dict[str, float] = {}
        whole = self.cycles_per_frame * self.n_tx
        if isinstance(self.chirps_per_frame, FollowingCount):
            following["chirps_per_frame"] = FollowingCount(whole)
        elif self.cycles_in_frame_duration * self.n_tx != whole:
            following["frame_duration_s"] = self.cycles_per_frame * self.cycle_duration_s
        if self.frame_period_s is not None:
            following["frame_hop_s"] = self.frame_period_s
        for field, value in following.items():
            object.__setattr__(self, field, value)

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
        make = PRESETS.find(name, instead=OR_RADAR_FILE)
        with PRESETS.guarded(name):
            radar = make()
        if not isinstance(radar, Radar):
            raise PRESETS.refuse(name, f"gave a {type(radar).__name__}, not a Radar")
        return dataclasses.replace(radar, name=name)

    @classmethod
    def load(cls, source: str | Path | Mapping[str, Any], *, board: str | None = None) -> Radar:
        """Make a preset by its name, or read a TOML file whose keys are the fields of this class.

        Parameters
        ----------
        source : str, path or mapping
            Name of a preset, path of a ``.toml`` file or of a ``.cfg`` file (`from_ti_cfg`), or a
            table as in such a file. A key ``base`` is another such source, of which the other keys
            replace fields; ``board`` is that of a ``.cfg`` file there, or a preset.
        board : str, optional
            Preset whose antennas are those of a ``.cfg`` file.

        Returns
        -------
        Radar

        Raises
        ------
        InputError
            Where the file cannot be read, has an unknown key, or has a value without meaning.
        """
        if isinstance(source, Mapping):
            return cls._of_table(source, Path(), board)
        # A TOML file, a file of TI's SDK, or else a name.
        table = radar_table(source)
        path = Path(source)
        if table is not None:
            with prefixed(f"radar file '{path}': "):
                return cls._of_table({"name": printable(path.stem), **table}, path.parent, board)
        if path.suffix == ".cfg":
            return cls.from_ti_cfg(path, board)
        if board is not None:
            raise InputError(
                f"radar '{source}' has its own antennas; leave the board out (--board)"
            )
        return cls.preset(str(source))

    @classmethod
    def _of_table(cls, table: Mapping[str, Any], folder: Path, board: str | None) -> Radar:
        """Make the radar of a table, whose ``base`` may lie below a folder."""
        fields = dict(table)
        base, named = fields.pop("base", None), fields.pop("board", None)
        keys = tuple(sorted(field.name for field in dataclasses.fields(cls)))
        check_keys("", fields, (), ("base", "board", *keys))
        for key, value in (("base", base), ("board", named)):
            if value is not None and not isinstance(value, str):
                raise InputError(f"{key} = {brief(value)}; it must be a name or a path")
        board = named if board is None else board
        counts = fields.keys() & {"tx_y", "tx_z", "rx_y", "rx_z"}
        if base is None and board is None:
            # Who names the antennas of one line has none on the other.
            lines = {"tx_y", "rx_y"}, {"tx_z", "rx_z"}
            for own, other in (lines, lines[::-1]):
                if not counts & other and any(fields.get(key) for key in own):
                    fields |= dict.fromkeys(other, 0)
            return cls(**fields)
        # The radar that these keys change: a preset, or a file beside this one.
        if base is None or base in RADARS:
            under = cls.load(base or board, board=board if base else None)
        else:
            under = cls.load(folder / base, board=board)
        # What takes the place of another field does so here, too.
        if counts:
            fields = {"tx_positions_m": None, "rx_positions_m": None, "tx_order": None} | fields
        if "frame_duration_s" in fields:
            fields = {"frame_period_s": None, "chirps_per_frame": None} | fields
        return dataclasses.replace(under, **fields)

    @classmethod
    def from_ti_cfg(cls, path: str | Path, board: str | None = None) -> Radar:
        """Read a configuration file of TI's mmWave SDK, as it is sent to a chip.

        Times, slope, samples, Tx of each chirp, Rx and frames are those of the file, antennas,
        powers and noise those of the board. A warning names the lines that are not read.

        Parameters
        ----------
        path : str or path
            Path of the ``.cfg`` file.
        board : str, optional
            Preset whose antennas are meant. By default the line ``% Platform:`` of the file says
            it, as in ``% Platform:xWR14xx``, else the band: ``iwr6843`` or ``iwr1843``.

        Returns
        -------
        Radar

        Raises
        ------
        InputError
            Where the file cannot be read, has a line that is malformed, or asks for what is not
            simulated: advanced frames, several Tx in one chirp, chirps that differ.
        """
        from rtradar.radar.ti_cfg import read_ti_cfg

        return read_ti_cfg(path, board).radar

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
        return display.plot_radar(self, ax)

    @property
    def watts_per_m2(self) -> float:
        r"""Received power [W] of an echo with \|amplitude\|^2 = 1 m^2.

        P_t G_t G_r lambda^2 / (4 pi)^3; `conventions` has the rest. An `InputError` is raised where
        the radar does not state its transmit power.
        """
        power_dbm = self._stated("transmit_power_dbm", "powers in watts are not known")
        antennas = (self.tx_antenna, self.rx_antenna)
        # Patterns are normalised to their peak, so the peak gains are constants of the radar
        # equation.
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
        # The noise that the receiver adds, as the temperature of a source that makes as much.
        receiver_k = NOISE_FIGURE_TEMPERATURE_K * (10 ** (figure_db / 10) - 1)
        noise_k = self.noise_temperature_k + receiver_k
        return float(BOLTZMANN_J_PER_K * noise_k * self.sample_rate_hz)

    def _stated(self, field: str, otherwise: str) -> float:
        value: float | None = getattr(self, field)
        if value is None:
            raise InputError(f"radar '{self.name}' does not state {field}, so {otherwise}; give it")
        return value

    def at(self, time_s: float) -> Radar:
        """Return the radar at rest where it is at some time, itself if it does not move.

        Parameters
        ----------
        time_s : float
            Time as of `path_at`.

        Returns
        -------
        Radar
        """
        if not self.is_moving:
            return self
        (angles,), (place,) = self.path_at([time_s])
        # It may have turned more than once.
        pose = dict(zip(("yaw_deg", "pitch_deg", "roll_deg"), (angles % 360).tolist(), strict=True))
        # Without its path the radar rests in this pose.
        still: dict[str, Any] = dict.fromkeys(("path_times_s", "path_m", "path_angles_deg"))
        return dataclasses.replace(self, position_m=tuple(place.tolist()), **pose, **still)


def _refusing_other_words(made: Callable[..., None]) -> Callable[..., None]:
    """Let the constructor tell in one line which fields there are."""

    @wraps(made)
    def checked(self: Radar, **fields: Any) -> None:
        known = Radar.__dataclass_fields__
        if not fields.keys() <= known.keys():  # quick: a moving radar is made for each pose
            check_keys("Radar: ", fields, (), tuple(known))
        made(self, **fields)

    return checked


Radar.__init__ = _refusing_other_words(Radar.__init__)  # type: ignore[method-assign]
