"""Clouds of people before a real radar (MARS), predicted from a camera's joints.

Person 3 is predicted. On person 1 are fitted: the offset of camera and radar in place and time, and
for each level one constant in place and one detection threshold. All else follows from the joints,
the radar and the chain of the chip (`mars_clouds`).

Doppler histogram     total variation of the bins of all points, with and without static removal
mean Doppler          of the points of a frame, weighted by their magnitudes
limb                  fraction of the points nearest to each limb, by move, less its mean over moves
points a frame        beside what the mean speed of the joints alone predicts, by a monotone curve
                      through the measured points of person 1
range, sideways       Wasserstein distance of the points of one frame, mean over frames; beside it
                      a torso that ignores the pose: the measured ranges of person 1 less that of
                      their torso, all poses together, about the torso of person 3; and halves of
                      the measured points of a frame
equal weights         as `analytic`, but each part returns alike: what cross-sections are worth

Points without an azimuth (x = 0) are left out sideways. Intervals are those of 95 % over moves.
Levels are laid beside each other by their distances in range. The positive control puts the points
of one level, with other noise, in place of the measured ones: so much would be gained if that level
were the truth and the joints had no error. Where an interval holds zero, it is undecided.

    RTRADAR_MEASURED=folder python validation/measurements/measured_radar.py [--quick] [--json FILE]

``--figure DIR`` also draws measured clouds beside predicted ones. ``--quick`` takes 6 s of each
move, with the offsets and thresholds that the whole script has found, `FITTED`.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.optimize import isotonic_regression

import rtradar as rt
from rtradar.scatter import MODELS, register_model
from rtradar.validate.rows import Row, judged, leave_out, main, reported

sys.path.append(str(Path(__file__).resolve().parent))

from cloud_figures import (
    LIMBS,
    Ints,
    Reals,
    correlation,
    counts,
    distances,
    interval,
    slope,
    variation,
)
from mars_clouds import FRAME_S, MOVES, Mounting, Points, Take, at_hand, takes_of
from mars_people import Comparison, Fit, Person, fitted, fitted_mounting, shift_m

LEVELS = ("specular", "analytic", "analytic-paper")
EQUAL = "equal-weights"
AIMS = {"limb": 0.6, "sideways": 0.22}
"""What is hoped for: reported with the mount of person 1, judged with the person's own."""

EQUAL_M2 = 0.01  # cross-section of each part then; the body of the others has some 0.2 m2


class EqualWeights:
    """`analytic`, but with one cross-section for all parts."""

    def __init__(self, radar: rt.Radar, body: object, *, spreading: bool = True) -> None:
        self._model = MODELS["analytic"](radar, body, spreading=spreading)
        self.variant = None

    def echoes(self, chirps: Ints) -> rt.Echoes:
        echoes = self._model.echoes(chirps)
        amplitude = np.sqrt(EQUAL_M2) * (2 / echoes.length) ** 2  # spreading there and back
        return dataclasses.replace(echoes, amplitude=amplitude[None].astype(np.complex128))


FITTED = Fit(Mounting((0.25, 0.0, -0.36), -0.013), 17.4, (0.0, 0.001, 0.129))
"""What the whole script finds on person 1 for `specular`."""


def speeds(person: Person, lag_s: float) -> Reals:
    """Mean speed of the joints in each frame as the camera has them [m/s]."""
    found = []
    for take in person.takes:
        times = take.numbers * FRAME_S
        speed = np.linalg.norm(np.gradient(take.joints, times, axis=0), axis=2).mean(axis=1)
        found.append(np.interp(times + lag_s, times, speed))
    return np.concatenate(found)


def counts_of_speed(learnt: Person, asked: Person, lag_s: float) -> Reals:
    """Points a frame that the speed alone predicts, by a monotone curve of another person."""
    speed = speeds(learnt, lag_s)
    order = np.argsort(speed)
    curve = isotonic_regression(counts(learnt.measured.frame, learnt.frames)[order]).x
    return np.interp(speeds(asked, lag_s), speed[order], curve)


def torso_m(learnt: Person, asked: Comparison, offset_m: tuple[float, float, float]) -> Reals:
    """Distance in range of each frame if points lay about the torso, whatever the pose [m]."""
    at = asked.person.takes[0].names.index("spine_mid")
    torso, own = (
        np.linalg.norm(person.joints[:, at] - offset_m, axis=1) for person in (learnt, asked.person)
    )
    about = learnt.measured.range_m - torso[learnt.measured.frame]
    usual = np.quantile(about, (np.arange(64) + 0.5) / 64)
    seen = asked.ours.seen
    values = (own[seen, None] + usual).ravel()
    points = asked.theirs
    pair = (values, np.repeat(seen, len(usual))), (points.range_m, points.frame)
    return distances(*pair, asked.person.frames)[seen]


def halves_m(points: Points, frames: int) -> float:
    """Mean distance in range between random halves of the points of a frame [m]."""
    first = np.random.default_rng(0).random(len(points.frame)) < 0.5
    one, other = (points.of(kept) for kept in (first, ~first))
    found = distances((one.range_m, one.frame), (other.range_m, other.frame), frames)
    return float(np.nanmean(found))


def doppler_rows(on: Comparison, off: Comparison) -> Iterator[Row]:
    """Distribution of Doppler with and without static removal, and the mean Doppler of a frame."""
    claim = "MARS, Doppler"
    far, farther = (variation(*(points.doppler for points in one.both)) for one in (on, off))
    # What the chain leaves out of the distribution without static removal is 0.25.
    says = "Doppler of measured points: total variation of predicted and measured histograms"
    yield judged(claim, "total variation", "1", far, 0.12, says=says)
    yield reported(claim, "total variation without static removal", "1", farther)
    says = "total variation with static removal over that without"
    yield judged(claim, says, "1", far / farther, 0.5, says=says)
    zero = [float((points.doppler == 0).mean()) for points in on.both]
    yield reported(claim, "points without Doppler", "1", zero[0], reference=zero[1])
    level = [20 * np.log10(points.level / np.median(points.level)) for points in on.both]
    for part in (0.05, 0.95):
        ours, theirs = (float(np.quantile(values, part)) for values in level)
        yield reported(claim, f"level over the median, {part:.0%}", "dB", ours, reference=theirs)
    pairs = on.mean_doppler
    # Joints are good to some centimetres and frames to some hundredths of a second.
    yield from judged_r(claim, "mean Doppler of a frame", pairs, on.move, 0.75)
    says = "mean Doppler of a frame: slope of predicted over measured"
    yield judged(claim, "mean Doppler, slope", "1", slope(pairs), 0.2, reference=1.05, says=says)
    spread = np.nanstd(pairs[np.isfinite(pairs).all(axis=1)], axis=0)
    yield reported(claim, "mean Doppler, spread over measured", "1", float(spread[0] / spread[1]))


def judged_r(claim: str, quantity: str, pairs: Reals, move: Ints, least: float) -> Iterator[Row]:
    """Rows of a correlation, judged by what it lacks to 1, and its interval over moves."""
    r = correlation(pairs)
    yield judged(claim, f"{quantity}, 1 - r", "1", 1 - r, 1 - least, says=f"{quantity}: 1 - r")
    yield from between(claim, f"{quantity}, r", "1", interval(pairs, move, correlation))


def between(claim: str, quantity: str, unit: str, ends: tuple[float, float]) -> Iterator[Row]:
    for end, name in zip(ends, ("2.5 %", "97.5 %"), strict=True):
        yield reported(claim, f"{quantity}, {name}", unit, end)


def detection_rows(learnt: Person, on: Comparison, off: Comparison, fit: Fit) -> Iterator[Row]:
    """Which limbs are seen, and how many points a frame has."""
    claim, offset = "MARS, detection", fit.mounting.offset_m
    # Reported: between the recordings of both persons the radar seems to have moved sideways by a
    # decimetre, so that a limb's points lie nearer to the bones of another.
    for name, one in (
        ("limb seen by move, r", on),
        ("limb seen by move without static removal, r", off),
    ):
        pairs, move = shares_by_move(one, offset)
        yield reported(claim, name, "1", correlation(pairs), reference=AIMS["limb"])
        yield from between(claim, name, "1", interval(pairs, move, correlation))
    pairs, move = shares_by_move(remounted(on), offset)
    yield from judged_r(claim, "limb seen by move, own mount", pairs, move, AIMS["limb"])
    yield from judged_r(claim, "points a frame", on.counts, on.move, 0.5)
    yield reported(claim, "points a frame without static removal, r", "1", correlation(off.counts))
    alone = counts_of_speed(learnt, on.person, fit.mounting.lag_s)[on.ours.seen]
    pairs = np.column_stack([on.counts, alone])
    less = interval(pairs, on.move, _over_speed)
    says = "points a frame: r by the speed of the joints alone, less r by the radar"
    yield judged(claim, "r by the speed alone, less r", "1", -_over_speed(pairs), 0.0, says=says)
    yield reported(claim, "r by the speed alone", "1", correlation(pairs[:, [2, 1]]))
    yield from between(claim, "r over that by the speed alone", "1", less)


def _over_speed(pairs: Reals) -> float:
    """By how much r of predicted and measured exceeds that of a third column and measured."""
    return correlation(pairs[:, :2]) - correlation(pairs[:, [2, 1]])


def place_rows(learnt: Person, on: Comparison, fit: Fit) -> Iterator[Row]:
    """How far the points of a frame are from the measured ones."""
    claim = "MARS, places"
    torso = torso_m(learnt, on, fit.mounting.offset_m)
    pairs = np.stack([on.away_m, torso], axis=1)
    away = float(np.nanmean(on.away_m))
    says = "points of a frame in range: Wasserstein distance of predicted and measured"
    # Three bins of 0.0293 m in the middle of what halves of a frame and the torso have.
    yield judged(claim, "in range", "m", away, 0.065, says=says)
    yield from between(claim, "in range", "m", interval(on.away_m, on.move, _mean))
    yield reported(
        claim, "in range, halves of the measured points", "m", halves_m(on.theirs, on.person.frames)
    )
    yield reported(claim, "in range, a torso that ignores the pose", "m", _mean(torso))
    says = "distance in range less that of a torso that ignores the pose"
    yield judged(claim, says, "m", -_gain(pairs), 0.0, says=says)
    yield from between(claim, "in range, gain over the torso", "m", interval(pairs, on.move, _gain))
    # Reported, for the same reason as limbs.
    yield reported(claim, "sideways", "m", _mean(on.aside_m), reference=AIMS["sideways"])
    yield from between(claim, "sideways", "m", interval(on.aside_m, on.move, _mean))
    aside, _, up = shift_m(on)
    yield reported(claim, "measured less predicted, sideways", "m", aside)
    yield reported(claim, "measured less predicted, up", "m", up)
    own = remounted(on)
    says = "points of a frame sideways, the mount by the first half of their own: distance"
    yield judged(claim, "sideways, own mount", "m", _mean(own.aside_m), AIMS["sideways"], says=says)
    ends = interval(own.aside_m, own.move, _mean)
    yield from between(claim, "sideways, own mount", "m", ends)


def remounted(one: Comparison) -> Comparison:
    """The second half of each take, as measured by the mount that the first halves tell.

    The first halves say by how much the measured points lie beside and above the predicted ones;
    those of the second are shifted back. Points without an azimuth stay at x = 0, where they are
    known by.
    """
    first, second = one.halves
    aside, _, up = shift_m(first)
    back = np.where(second.theirs.places[:, :1] != 0, [-aside, 0.0, -up], [0.0, 0.0, -up])
    theirs = second.theirs._replace(places=second.theirs.places + back)
    return dataclasses.replace(second, theirs=theirs)


def shares_by_move(one: Comparison, offset_m: tuple[float, float, float]) -> tuple[Reals, Ints]:
    """Fractions of the points that each limb has, less their mean over moves, and the moves."""
    shares = one.limbs(offset_m)
    own = (shares - shares.mean(axis=0)).reshape(-1, 2)
    return own, np.arange(len(shares)).repeat(len(LIMBS))


def _mean(values: Reals) -> float:
    return float(np.nanmean(values))


def _gain(pairs: Reals) -> float:
    """By how much the first of two distances (frame, 2) is the shorter."""
    return float(np.nanmean(pairs[:, 1] - pairs[:, 0]))


def weight_rows(analytic: Comparison, equal: Comparison) -> Iterator[Row]:
    """What cross-sections are worth beside equal weights."""
    pairs = np.stack([analytic.away_m, equal.away_m], axis=1)
    claim, name = "MARS, equal weights", "gain of cross-sections over equal weights in range"
    ends = interval(pairs, analytic.move, _gain)
    yield reported(claim, name, "m", _gain(pairs))
    yield from between(claim, name, "m", ends)
    yield reported(claim, "decided, 1, or undecided, 0", "1", float(ends[0] * ends[1] > 0))


def level_rows(person: Person, fits: dict[str, Fit], found: dict[str, Comparison]) -> Iterator[Row]:
    """Levels beside each other, by distances in range, and what they would gain if true."""
    truths = {level: person.predicted(level, fits[level], seed=1)[0].points for level in found}
    for level, one in found.items():
        yield reported(level, "threshold fitted on person 1", "dB", fits[level].threshold_db)
        yield reported(level, "shift away fitted on person 1", "m", fits[level].shift_m[1])
        yield reported(level, "in range", "m", _mean(one.away_m))
        yield reported(level, "mean Doppler of a frame, r", "1", correlation(one.mean_doppler))
    for first, other in itertools.combinations(found, 2):
        claim = f"{first} over {other}"
        pairs = np.stack([found[first].away_m, found[other].away_m], axis=1)
        ends = interval(pairs, found[first].move, _gain)
        yield reported(claim, "gain in range", "m", _gain(pairs))
        yield from between(claim, "gain in range", "m", ends)
        for truth in (first, other):
            own = [
                Comparison.of(person, found[level].ours, truths[truth]).away_m
                for level in (first, other)
            ]
            yield reported(
                claim, f"gain in range if {truth} were true", "m", _gain(np.stack(own, axis=1))
            )
        yield reported(claim, "decided, 1, or undecided, 0", "1", float(ends[0] * ends[1] > 0))


def longest(person: int, most: int | None = None) -> list[Take]:
    """The longest take of each move of a person, cut to so many frames."""
    takes = takes_of(person)
    found = [
        max((take for take in takes if take.move == move), key=lambda take: len(take.numbers))
        for move in range(MOVES)
    ]
    return [take.until(most) for take in found]


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    if not at_hand():
        leave_out("MARS", "RTRADAR_MEASURED, the folder of mars/")
        return []
    learnt = Person(takes_of(1), 1)
    if quick:
        asked = Person(longest(3, 60), 2)
        return prediction_rows(learnt, asked, FITTED)
    register_model(EQUAL, EqualWeights)
    first, asked = Person(longest(1), 3), Person(takes_of(3), 3)
    mounting = fitted_mounting(first)
    fits = {level: fitted(first, level, mounting) for level in (*LEVELS, EQUAL)}
    rows = prediction_rows(learnt, asked, fits["specular"])
    found = {
        level: Comparison.of(asked, asked.predicted(level, fit)[0]) for level, fit in fits.items()
    }
    rows += weight_rows(found["analytic"], found.pop(EQUAL))
    return [*rows, *fit_rows(mounting), *level_rows(asked, fits, found)]


def prediction_rows(learnt: Person, asked: Person, fit: Fit) -> list[Row]:
    """What `specular` predicts of a person, beside what is known of another."""
    points = asked.predicted("specular", fit, removals=(True, False))
    on, off = (Comparison.of(asked, one) for one in points)
    return [
        *doppler_rows(on, off),
        *detection_rows(learnt, on, off, fit),
        *place_rows(learnt, on, fit),
    ]


def fit_rows(mounting: Mounting) -> Iterator[Row]:
    for axis, value in zip(("to the right", "away", "up"), mounting.offset_m, strict=True):
        yield reported("MARS, fitted", f"radar from camera, {axis}", "m", value)
    yield reported("MARS, fitted", "radar after camera", "s", mounting.lag_s)


def figure(_: list[Row], path: Path) -> None:
    """Measured clouds beside predicted ones, of 6 s of three moves."""
    from measured_picture import draw

    takes = longest(3, 60)[::3]
    ours = [Person([take], 1).predicted("specular", FITTED)[0] for take in takes]
    draw(takes, [one.points for one in ours], path)


if __name__ == "__main__":
    sys.exit(main("Clouds of MARS, predicted from joints of a camera", measure, figure))
