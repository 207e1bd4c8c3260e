"""`Motion`: a rigid skeleton moving through time, and its resampling to any instant."""

from __future__ import annotations

import dataclasses
import math
import threading
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.cards import html_card, text_card
from rtradar.errors import InputError
from rtradar.motion import display
from rtradar.motion.quaternions import quaternion_multiply, quaternion_rotate, sign_continuous
from rtradar.recordings import Finding, Source
from rtradar.system.checks import printable
from rtradar.system.row_files import file_backed, in_blocks, release_pages

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from scipy.interpolate import PPoly

Array = NDArray[np.float64]

_TIME_SLACK_S = 1e-9
"""Times this far outside the recording are rounding, not a mistake, and are moved to its end."""

_BLOCK_FRAMES, _BLOCK_MARGIN, _BLOCKS_KEPT = 256, 32, 2
"""Numbers of frames that a spline serves, of frames beside them that it uses, and of blocks kept.

The influence of a frame on a cubic spline falls by 73 % from frame to frame: beyond 32 frames
nothing of it is left in float64."""

_splines_lock = threading.Lock()  # not of each motion, which has to go to other processes


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Motion:
    """A recording of a rigid skeleton, in world axes.

    A joint is the end of one bone. ``rotations[:, j]`` is the world orientation of the bone that
    ENDS in joint j, so ``position_j = position_parent + R_j @ offsets_j``: an ASF bone's own
    rotation, a BVH parent joint's global one. That holds between frames too, so bones never change
    length.

    Parameters
    ----------
    name : str
        Name that reports show.
    joints : tuple of str
        Unique names, parents before children, the root first.
    parents : tuple of int
        Index of each joint's parent; -1 for the root.
    offsets : (joint, 3) float64
        Bone vectors in the bone's own axes [m]; the root's is ignored.
    root_positions : (frame, 3) float64
        Positions of the root, world [m].
    rotations : (frame, joint, 4) float64
        Unit quaternions, scalar last, world. The root's is that of the pelvis.
    rate_hz : float
        Number of frames per second [Hz].
    first_frame_s : float
        Time of the first frame, zero or less [s]. Frames before time zero serve interpolation only.
    length_s : float, optional
        Duration, where the motion ends before its last frame [s].
    girth : float
        Thickness of the subject relative to the nominal body.
    findings : tuple of Finding
        What was found of the recording, or assumed: unit, up, stature, rate, largest speed.
    source : Source, optional
        What it was made from, as a run file says it; None of a motion that was changed since.

    Raises
    ------
    InputError
        Where shapes do not fit each other, a value is not finite, or the tree is not one.

    Examples
    --------
    >>> import rtradar as rt
    >>> rt.synthetic_motion("walk", seed=0)
    Motion synthetic:walk
      duration  3 s
      frames    361 at 120 Hz
      joints    22, from root to r_hand
      height    1.7 m from the lowest to the highest joint
      place     root at x -1.57 to 1.66, y -0.02 to 0.02, z 0.95 to 0.99 m
      path      3.24 m over the floor

    >>> motion = rt.synthetic_motion("walk", seed=1, duration_s=2.0)
    >>> positions, rotations = motion.at([0.0, 0.5])
    >>> positions.shape[0], positions.shape[2], motion.duration_s
    (2, 3, 2.0)
    """

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    root_positions: Array
    rotations: Array
    rate_hz: float
    first_frame_s: float = 0.0
    length_s: float | None = None
    girth: float = 1.0
    findings: tuple[Finding, ...] = ()
    source: Source | None = dataclasses.field(default=None, init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", printable(self.name))  # that of a file may be any bytes
        count, frames = len(self.joints), len(self.root_positions)
        # Arrays are made contiguous, and checked in blocks where they wait in a file.
        for field, shape in (
            ("offsets", (count, 3)),
            ("root_positions", (frames, 3)),
            ("rotations", (frames, count, 4)),
        ):
            array = np.ascontiguousarray(getattr(self, field), dtype=np.float64)
            if not all(np.isfinite(rows).all() for (rows,) in in_blocks(array)):
                raise self._refusal(f"{field} holds NaN or infinity; every value must be finite")
            if array.shape != shape or not frames or not count:
                raise self._refusal(f"{field} has shape {array.shape}; it must be {shape}")
            object.__setattr__(self, field, array)
        if len(set(self.joints)) != count:
            raise self._refusal("joint names repeat; every joint needs its own name")
        # The tree: names once each, one root, and parents before their children.
        ordered = all(0 <= parent < j for j, parent in enumerate(self.parents) if j)
        if len(self.parents) != count or self.parents[0] != -1 or not ordered:
            raise self._refusal("parents must name one root first (-1), and precede their children")
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise self._refusal(f"rate_hz = {self.rate_hz}; it must be positive")
        # q and -q are one rotation; a spline needs neighbouring frames on the same side.
        object.__setattr__(self, "rotations", sign_continuous(self.rotations))
        norms = (np.linalg.norm(rows, axis=-1) for (rows,) in in_blocks(self.rotations))
        extremes = np.array([(norm.min(), norm.max()) for norm in norms])
        least, largest = extremes[:, 0].min(), extremes[:, 1].max()
        if least < 1 - 1e-6 or largest > 1 + 1e-6:
            raise self._refusal(
                f"rotations are not unit quaternions (norm {least:.3g} to {largest:.3g})"
            )
        # The frames must cover the time from 0 to the end, or poses there would be extrapolated.
        last = self.first_frame_s + (frames - 1) / self.rate_hz
        given = self.length_s is not None
        if self.first_frame_s > 0 or (given and not 0 <= self.duration_s <= last + _TIME_SLACK_S):
            raise self._refusal(
                f"frames from {self.first_frame_s:.6g} to {last:.6g} s do not cover 0 to "
                f"{self.length_s} s"
            )

    def __repr__(self) -> str:
        lines = {label.lower(): value for label, value in display.rows(self).items()}
        return text_card("Motion", self.name, lines)

    def _repr_html_(self) -> str:
        picture = display.picture_from_the_side(self)
        return html_card("Motion", self.name, {"": display.rows(self)}, picture=picture)

    def _refusal(self, why: str) -> InputError:
        return InputError(f"Motion {self.name}: {why}")

    # -- the recording -----------------------------------------------------------------------------

    @property
    def duration_s(self) -> float:
        """End of the recording [s]; it begins at 0."""
        if self.length_s is not None:
            return self.length_s
        return self.first_frame_s + (len(self.root_positions) - 1) / self.rate_hz

    @property
    def frame_times(self) -> Array:
        """Time of each frame (frame,) [s]; others than 0 to `duration_s` serve interpolation."""
        return self.first_frame_s + np.arange(len(self.root_positions)) / self.rate_hz

    @cached_property
    def positions(self) -> Array:
        """Joints at the frames, (frame, joint, 3) [m], world."""
        return file_backed(
            self._forward(*frames) for frames in in_blocks(self.root_positions, self.rotations)
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the skeleton at some instants, from the side and from above.

        Parameters
        ----------
        ax : Axes, optional
            Axes of Matplotlib for the view from the side alone; by default both views are drawn in
            a new figure.

        Returns
        -------
        Axes
            Axes of the view from the side, across x or y, in metres.

        Examples
        --------
        >>> import rtradar as rt
        >>> axes = rt.synthetic_motion("walk", seed=0).plot()
        >>> axes.get_ylabel()
        'z [m]'
        """
        return display.plot_motion(self, ax)

    # -- at any time -------------------------------------------------------------------------------

    def at(self, times: ArrayLike) -> tuple[Array, Array]:
        """Interpolate the pose at any time, with exactly rigid bones.

        Rotations go through a C2 cubic spline of the sign-continuous quaternion components,
        normalised; the root goes through PCHIP. Of the interpolations that
        ``validation/measurements/interpolation.py`` compares, the cubic meets left-out frames best,
        and leaves false Doppler lines of a swinging limb at -71 dB of a 77 GHz echo, where makima
        and PCHIP leave -17 dB and slerp, whose angular velocity jumps at every frame, 0 dB. A spike
        of one frame rings on with 13 % of its height, and falls by 3.7 from frame to frame.

        Parameters
        ----------
        times : (time,) float64
            Time since the beginning of the recording [s].

        Returns
        -------
        positions : (time, joint, 3) float64
            Positions of the joints, world [m].
        quaternions : (time, joint, 4) float64
            Rotations of the bones, world, scalar last.

        Raises
        ------
        InputError
            Where a time lies outside [0, duration_s].
        """
        from rtradar.kernels.motion import pose  # Numba is not needed to read a file

        instants = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if instants.ndim != 1:
            raise InputError(
                f"Motion.at: times have shape {instants.shape}; they must be one-dimensional"
            )
        ok = (instants >= -_TIME_SLACK_S) & (instants <= self.duration_s + _TIME_SLACK_S)
        if not ok.all():
            raise self._refusal(
                f"time {instants[~ok][0]:.6g} s is outside the recording, 0 to "
                f"{self.duration_s:.6g} s"
            )
        instants = np.clip(instants, 0.0, self.duration_s)
        # One frame is a statue: no spline goes through a single value.
        if len(self.root_positions) == 1:
            still = np.repeat(self.rotations, len(instants), axis=0)
            return self._forward(self.root_positions, still), still
        positions = np.empty((len(instants), len(self.joints), 3))
        quaternions = np.empty((len(instants), len(self.joints), 4))
        found = positions, quaternions.reshape(len(instants), -1)
        # Splines are made for blocks of frames, and each block serves all times in it.
        frame = (instants - self.first_frame_s) * self.rate_hz
        blocks = np.floor(frame / _BLOCK_FRAMES).astype(np.int64)
        skeleton = self.offsets, np.asarray(self.parents, dtype=np.int64)
        for block in sorted(set(blocks.tolist())):
            here = np.flatnonzero(blocks == block)
            root, rotation = self._splines(block)
            cubics = root.c, rotation.c.reshape(*rotation.c.shape[:2], -1)
            pose(instants, here, root.x, *cubics, *skeleton, *found)
        return positions, quaternions

    def _splines(self, block: int) -> tuple[PPoly, PPoly]:
        """Splines of the root and the rotations for one block of frames, which saves memory."""
        from scipy.interpolate import CubicSpline, PchipInterpolator  # slow to import

        with _splines_lock:
            if block not in self._kept_splines:
                first = max(0, block * _BLOCK_FRAMES - _BLOCK_MARGIN)
                frames = slice(first, (block + 1) * _BLOCK_FRAMES + _BLOCK_MARGIN + 1)
                times = self.frame_times[frames]
                splines = (
                    PchipInterpolator(times, self.root_positions[frames]),
                    CubicSpline(times, self.rotations[frames]),
                )
                release_pages(self.root_positions, self.rotations)
                while len(self._kept_splines) >= _BLOCKS_KEPT:
                    self._kept_splines.pop(next(iter(self._kept_splines)))
                self._kept_splines[block] = splines
            return self._kept_splines[block]

    @cached_property
    def _kept_splines(self) -> dict[int, tuple[PPoly, PPoly]]:
        return {}

    def _forward(self, roots: Array, quaternions: Array) -> Array:
        # Each bone from its parent first, and then the sums along the chains from the root.
        positions = quaternion_rotate(quaternions, self.offsets)
        positions[:, 0] = roots
        for joint, parent in enumerate(self.parents[1:], start=1):
            positions[:, joint] += positions[:, parent]
        return positions

    def made_from(self, source: Source) -> Motion:
        """Remember what the motion was made from, and return it.

        Parameters
        ----------
        source : Source
            Keys of a person in a run file, and the files that were read.

        Returns
        -------
        Motion
            The same object.
        """
        object.__setattr__(self, "source", source)
        return self

    # -- the same motion elsewhere -----------------------------------------------------------------

    def scaled(self, factor: float) -> Motion:
        """Scale the motion about the world's origin on the floor.

        Parameters
        ----------
        factor : float
            Factor of the subject's height and thickness, positive.

        Returns
        -------
        Motion
        """
        if not (math.isfinite(factor) and factor > 0):
            raise InputError(f"Motion.scaled: factor = {factor}; it must be positive")
        moved = file_backed(roots * factor for (roots,) in in_blocks(self.root_positions))
        return dataclasses.replace(
            self, offsets=self.offsets * factor, root_positions=moved, girth=self.girth * factor
        )

    def turned(self, yaw_rad: float) -> Motion:
        """Rotate the motion about the world's vertical axis.

        Parameters
        ----------
        yaw_rad : float
            Angle of the rotation, anticlockwise seen from above [rad].

        Returns
        -------
        Motion
        """
        return self.rotated(np.array([0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)]))

    def rotated(self, turn: Array) -> Motion:
        """Rotate the motion about the world's origin.

        Parameters
        ----------
        turn : (4,) float64
            Unit quaternion, scalar last.

        Returns
        -------
        Motion
        """
        blocks = in_blocks(self.root_positions), in_blocks(self.rotations)
        return dataclasses.replace(
            self,
            root_positions=file_backed(quaternion_rotate(turn, roots) for (roots,) in blocks[0]),
            rotations=file_backed(quaternion_multiply(turn, rows) for (rows,) in blocks[1]),
        )

    def shifted(self, by_m: ArrayLike) -> Motion:
        """Shift the motion.

        Parameters
        ----------
        by_m : (3,) array_like
            Displacement in world axes [m].

        Returns
        -------
        Motion
        """
        by = np.asarray(by_m, dtype=np.float64)
        moved = file_backed(roots + by for (roots,) in in_blocks(self.root_positions))
        return dataclasses.replace(self, root_positions=moved)
