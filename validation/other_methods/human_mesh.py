"""The human mesh: closed, with the recording's joints, and what returns beside ellipsoids.

- The shape in rest is compared with that of the package `anny`, which is built by torch.
- Joints of the posed mesh are found in two ways and compared with the joints of the recording at
  every instant: by the regression that `anny` brings, means of vertices fitted to the keypoints of
  COCO, of which the mesh makes use itself; and as the middle of the limb's cross-section at the
  recording's knee, elbow or wrist, in the plane that halves the bend. Bent more than 90 degrees a
  limb touches itself, and at the ankle that plane cuts the foot: those are left out.
- What skinning costs: volume of the posed mesh over that in rest, and edges that it stretches.
- What the moving mesh returns at one chirp by `reference` is compared with `scattering_length` of
  the mesh as it then is, which divides facets at the edges of shadows.
- RCS by aspect of a standing person as a mesh and as ellipsoids, by physical optics, and a walk by
  `physical-optics` against `reference`, both on the mesh.

With ``--figure`` the RCS by aspect and the spectrogram of a walk of both bodies are drawn.

    python validation/other_methods/human_mesh.py [--quick] [--json FILE] [--figure DIR]
"""

from __future__ import annotations

import dataclasses
import os
import sys
import tempfile
import warnings
from collections.abc import Iterator
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body, HumanMesh
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.motion import Motion
from rtradar.motion.skeleton import NODES
from rtradar.scatter import build_model
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import field_db, power_db, rms

Array = NDArray[np.float64]
BENDS = {"knee": ("hip", "ankle"), "elbow": ("shoulder", "wrist"), "wrist": ("elbow", "hand")}
"""Joints at which a limb is one tube, and those before and after."""

LIMBS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
DISTANCE_M, HEIGHT_M = 4.0, 1.0
PIECE_S = 0.04


def bodies(motion: Motion) -> dict[str, Body]:
    """The same person as ellipsoids and as a mesh."""
    body = Body.from_motion(motion)
    return {"ellipsoids": body, "mesh": dataclasses.replace(body, mesh=HumanMesh(motion))}


def one_pair(preset: str) -> rt.Radar:
    """A radar with one Tx and one Rx."""
    radar = rt.Radar.preset(preset)
    return dataclasses.replace(radar, tx_y=1, tx_z=0, rx_y=1, rx_z=0)


def recordings(quick: bool) -> Iterator[Motion]:
    """Synthetic motions, and recordings of several kinds of skeleton where they are at hand."""
    yield rt.synthetic_motion("walk", seed=0)
    yield rt.synthetic_motion("walk", seed=0).scaled(0.65)
    if quick:
        return
    for activity in ("kick", "punch", "jumping_jack"):
        yield rt.synthetic_motion(activity, seed=0)
    if root := os.environ.get("RTRADAR_MOCAP"):
        folder = Path(root)
        yield rt.load_motion(folder / "cmu/02_01.amc", skeleton=folder / "cmu/02.asf")
        yield rt.load_motion(folder / "cmu/135_02.c3d")
        skeleton = next((folder / "hdm05").glob("HDM_bd*.asf"))
        takes = sorted((folder / "hdm05").glob("HDM_bd_*.amc"))[:3]
        # Arms over the head.
        for take in (*takes, folder / "hdm05/HDM_bd_throwBasketball_001_120.amc"):
            yield rt.load_motion(take, skeleton=skeleton)
        for take in sorted(folder.glob("bandai*/*.bvh"))[:2]:
            yield rt.load_motion(take)


# -- shape and joints ------------------------------------------------------------------------------


def shape_rows() -> Iterator[Row]:
    """The shapes in rest against those of `anny`."""
    from rtradar.body.human_shape import rest_shapes

    with tempfile.TemporaryDirectory() as cache, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        os.environ["ANNY_CACHE_DIR"] = cache
        import anny

        ours = rest_shapes()
        theirs = anny.Anny(
            topology="makehuman-noeyes-notongue",
            skinning_method="lbs",
            phenotype_blendshapes="original",
        )
        worst = 0.0
        for number, age in enumerate((0.0, 1 / 3, 2 / 3)):
            shape = theirs.get_phenotype_blendshape_coefficients(age=age)
            vertices = theirs.get_rest_model(shape)["rest_vertices"][0].numpy()[ours.base]
            worst = max(worst, float(np.abs(vertices - ours.vertices[number]).max()))
    yield judged(
        "shape in rest, three ages",
        "largest distance of a vertex from that of anny",
        "m",
        worst,
        1e-9,
        says="the human mesh in rest is that of the package anny",
    )


def joint_rows(motion: Motion) -> Iterator[Row]:
    mesh = HumanMesh(motion)
    times = np.linspace(0, mesh.motion.duration_s, 40)
    closed = [mesh.trimesh(time, level) for time in times[::13] for level in (0, 1)]
    faults = sum(not (own.is_watertight and own.euler_number == 2) for own in closed)
    claim = f"{motion.name}, {mesh.height_m:.2f} m tall"
    yield judged(claim, "poses in which the mesh is not one closed surface", "", faults, 0)
    for kind, away in (
        ("keypoint", keypoints_away(mesh, times)),
        ("middle of a limb", sections_away(mesh, times[::4])),
    ):
        worst = max(away, key=lambda joint: np.max(away[joint]))
        yield judged(
            claim,
            f"{kind} farthest from the recording's joint at any instant, the {worst}",
            "m",
            float(np.max(away[worst])),
            0.03,
            says=f"joints of the human mesh against the recording's, every instant: {kind}",
        )
        median = float(np.median(np.concatenate([*away.values()])))
        yield reported(claim, f"{kind}: median over joints and times", "m", median)
    edges = mesh.trimesh().edges_unique
    rest = mesh.fit.vertices * mesh.height_m / np.ptp(mesh.fit.vertices[:, 2])
    lengths = [
        np.linalg.norm(own[edges[:, 0]] - own[edges[:, 1]], axis=1)
        for own in (rest, *(found.vertices for found in closed[::2]))
    ]
    stretch = np.quantile(np.array(lengths[1:]) / lengths[0], [0.01, 0.99])
    yield reported(claim, "edges over those in rest, shortest hundredth", "", float(stretch[0]))
    yield reported(claim, "edges over those in rest, longest hundredth", "", float(stretch[1]))
    whole = trimesh.Trimesh(rest, mesh.faces(), process=False).volume
    volumes = [own.volume / whole for own in closed[::2]]
    yield reported(claim, "least volume over that in rest", "", min(volumes))


def keypoints_away(mesh: HumanMesh, times: Array) -> dict[str, Array]:
    """Distances (time,) [m] of keypoints of the posed mesh from joints of the recording."""
    vertices, joints = mesh.vertices(times), mesh.motion.at(times)[0]
    away = {}
    for limb in LIMBS:
        for side in ("left", "right"):
            found = np.einsum("v,tvx->tx", keypoints()[f"{side}_{limb}"], vertices)
            own = np.linalg.norm(found - joints[:, NODES.index(f"{side[0]}_{limb}")], axis=1)
            away[f"{side} {limb}"] = own
    return away


def sections_away(mesh: HumanMesh, times: Array) -> dict[str, Array]:
    """Distances (time,) [m] of middles of cross-sections from the joint, where bent at most 90."""
    away: dict[str, list[float]] = {}
    for time, joints in zip(times, mesh.motion.at(times)[0], strict=True):
        skin = mesh.trimesh(time)
        for side in ("left", "right"):
            for bent, ends in BENDS.items():
                before, at, after = (
                    joints[NODES.index(f"{side[0]}_{node}")] for node in (ends[0], bent, ends[1])
                )
                ways = [way / np.linalg.norm(way) for way in (at - before, after - at)]
                if ways[0] @ ways[1] < 0:
                    continue
                outlines = skin.section(plane_origin=at, plane_normal=ways[0] + ways[1]).discrete
                found = min(np.linalg.norm(middle(own) - at) for own in outlines)
                away.setdefault(f"{side} {bent}", []).append(float(found))
    return {name: np.array(own) for name, own in away.items()}


def middle(outline: Array) -> Array:
    """Mean (3,) of a closed line (point, 3) by its length."""
    length = np.linalg.norm(np.diff(outline, axis=0), axis=1)
    return np.average((outline[1:] + outline[:-1]) / 2, axis=0, weights=length)


@lru_cache(maxsize=1)
def keypoints() -> dict[str, Array]:
    """Weights (vertex,) of the mesh's vertices for each of COCO's keypoints, from `anny`."""
    import torch

    from rtradar.body.human_shape import data_folder, rest_shapes

    path = data_folder().parent / "keypoints" / "coco.pth"
    found = torch.load(path, map_location="cpu", weights_only=True)
    base = rest_shapes().base
    return {name: np.asarray(weights)[base] for name, weights in found.items()}


# -- radar returns ---------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def standing() -> Motion:
    return rt.synthetic_motion("stand", seed=0, duration_s=0.1)


@lru_cache(maxsize=2)
def by_aspect(count: int) -> tuple[Array, dict[str, Array]]:
    """Aspects (aspect,) [deg], 0 from ahead, and RCS (aspect,) [m^2] at 12 GHz of each body."""
    aspects = np.arange(count) * 360.0 / count
    motion, found = standing(), {}
    middle = motion.at([0.0])[0][0, 0] * [1, 1, 0]
    joints = motion.at([0.0])[0][0]
    left = joints[NODES.index("l_hip")] - joints[NODES.index("r_hip")]
    ahead = np.arctan2(-left[0], left[1])
    angles = np.radians(aspects) + ahead
    away = np.stack([np.cos(angles), np.sin(angles), np.zeros(count)], axis=1)
    antennas = middle + DISTANCE_M * away + [0, 0, HEIGHT_M]
    own = bodies(motion)
    targets = {
        "ellipsoids": own["ellipsoids"].ellipsoids(0.0),
        "mesh": own["mesh"].mesh.trimesh(0.0, 1),
    }
    for name, target in targets.items():
        length = rt.scattering_length(target, antennas, antennas, 12e9, "physical-optics")
        # Over the range to the person, not that to the origin.
        found[name] = np.abs(length / np.sum(antennas**2, axis=1) * DISTANCE_M**2) ** 2
    return aspects, found


def rcs_rows(count: int) -> Iterator[Row]:
    _, rcs = by_aspect(count)
    claim = f"standing, 12 GHz, {DISTANCE_M:g} m away, {count} aspects"
    for name, own in rcs.items():
        yield reported(claim, f"median RCS of the {name}", "dBsm", power_db(np.median(own)))
        yield reported(claim, f"mean RCS of the {name}", "dBsm", power_db(np.mean(own)))


def spectrum(echoes: rt.Echoes) -> NDArray[np.complex128]:
    """Field at the centre of the sweep (chirp, rx), of all parts."""
    middle = len(echoes.frequency) // 2
    turn = -2j * np.pi * echoes.frequency[middle] / SPEED_OF_LIGHT_MPS * echoes.length
    return np.asarray((np.conj(echoes.amplitude[middle]) * np.exp(turn)).sum(axis=2))


def moving_rows(preset: str, chirps_each: int) -> Iterator[Row]:
    """One chirp against `scattering_length`, and keyframes against every chirp."""
    radar = one_pair(preset)
    body = bodies(rt.synthetic_motion("walk", seed=0, duration_s=0.5))["mesh"]
    step = round(PIECE_S / chirps_each / radar.chirp_interval_s)
    # Between keyframes, which at 12 GHz are at multiples of 5 and 10 ms.
    chirps = round(0.2033 / radar.chirp_interval_s) + step * np.arange(chirps_each)
    reference = spectrum(build_model("reference", radar, body).echoes(chirps))
    claim = f"{preset}, a walk of {PIECE_S:g} s"
    if preset == "paper-12ghz":
        frequency = radar.centre_frequency_hz
        static = []
        for time in radar.centres_of(chirps[:4]):
            mesh, pair = body.mesh.trimesh(time, 1), (radar.tx, radar.rx)
            length = rt.scattering_length(mesh, *pair, frequency, "physical-optics")[0]
            ranges = [float(np.linalg.norm(own)) for own in pair]
            turn = -2j * np.pi * frequency / SPEED_OF_LIGHT_MPS * sum(ranges)
            static.append(length * np.exp(turn) / np.prod(ranges))
        yield judged(
            claim,
            "`reference` against scattering_length of the mesh as it then is, complex error",
            "",
            rms(reference[:4, 0] - static) / rms(static),
            0.05,
            says="a moving human mesh by `reference` against the mesh at rest: complex error",
        )
    for fidelity in ("physical-optics", "rays"):
        found = spectrum(build_model(fidelity, radar, body).echoes(chirps))
        yield judged(
            claim,
            f"`{fidelity}` against `reference`, complex error",
            "dB",
            field_db(rms(found - reference) / rms(reference)),
            -20.0,
            says=f"a walking human mesh by `{fidelity}` against `reference`: complex error",
        )
    if preset == "paper-12ghz":
        found = spectrum(build_model("rays", radar, body, anchor_s=10e-3).echoes(chirps))
        error = field_db(rms(found - reference) / rms(reference))
        yield reported(claim, "`rays`, keyframes 10 ms apart: complex error", "dB", error)


def beside_rows() -> Iterator[Row]:
    """A person of ellipsoids, alone and with a mesh 8 m beside the line of sight."""
    radar, chirps = one_pair("paper-12ghz"), np.arange(0, 1600, 200)
    one, other = (
        rt.motion.place(rt.synthetic_motion("walk", seed=seed), start_s=0.5, duration_s=0.11)
        for seed in (0, 1)
    )
    alone = Body.from_motion(one)
    far = other.shifted([8.0, 3.0, 0.0])
    mesh = dataclasses.replace(Body.from_motion(far), mesh=HumanMesh(far))
    count = len(alone.part_names)
    for level in ("physical-optics", "reference"):
        fields = []
        for body in (alone, rt.body.Bodies([alone, mesh])):
            echoes = build_model(level, radar, body).echoes(chirps)
            own = echoes.part < count
            fields.append(
                spectrum(
                    dataclasses.replace(
                        echoes,
                        length=echoes.length[..., own],
                        amplitude=echoes.amplitude[..., own],
                        part=echoes.part[own],
                        bounces=echoes.bounces[own],
                    )
                )
            )
        yield judged(
            f"ellipsoids, a mesh 8 m away, {level}",
            "change of the field",
            "",
            rms(fields[1] - fields[0]) / rms(fields[0]),
            0.02,
            says="a person of ellipsoids with a mesh 8 m away against the same alone: field",
        )


def measure(quick: bool) -> list[Row]:
    if missing := [name for name in ("anny", "torch") if find_spec(name) is None]:
        print(f"nothing is measured without {' and '.join(missing)}", file=sys.stderr)
        return []
    found: list[Row] = [] if quick else list(shape_rows())
    for motion in recordings(quick):
        found += joint_rows(motion)
    found += beside_rows()
    found += rcs_rows(4 if quick else 72)
    found += moving_rows("paper-12ghz", 4 if quick else 40)
    if not quick:
        found += moving_rows("paper-77ghz", 20)
    return found


# -- picture ---------------------------------------------------------------------------------------

WALK_S, EVERY_S, WINDOW = 1.2, 0.5e-3, 128


def spectrogram(body: Body, radar: rt.Radar) -> tuple[Array, Array, Array]:
    """Times [s], velocities [m/s] and power (velocity, time) [dB over the largest]."""
    step = round(EVERY_S / radar.chirp_interval_s)
    chirps = np.arange(0, round(WALK_S / radar.chirp_interval_s), step)
    found = build_model("physical-optics", radar, body).echoes(chirps)
    field = np.conj(spectrum(found)[:, 0])
    starts = np.arange(0, len(field) - WINDOW, 8)
    pieces = field[starts[:, None] + np.arange(WINDOW)] * np.hanning(WINDOW)
    power = np.abs(np.fft.fftshift(np.fft.fft(pieces, 512, axis=1), axes=1)) ** 2
    apart = step * radar.chirp_interval_s
    velocity = np.fft.fftshift(np.fft.fftfreq(512, apart)) * radar.wavelength_m / 2
    times = (starts + WINDOW / 2) * apart
    return times, velocity, power_db(power.T / power.max())


def figure(_: list[Row], path: Path) -> None:
    """RCS by aspect of both bodies, and the spectrogram of a walk of each."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(13, 4.4), layout="constrained")
    grid = drawing.add_gridspec(1, 3, width_ratios=(1, 1, 1))
    polar = drawing.add_subplot(grid[0], projection="polar", theta_offset=np.pi / 2)
    aspects, rcs = by_aspect(72)
    around = np.radians(np.append(aspects, 360.0))
    for name, own in rcs.items():
        polar.plot(around, power_db(np.append(own, own[0])), label=name, linewidth=1.2)
    polar.set_rlim(-30, 15)
    polar.set_title("RCS at 12 GHz [dBsm] by aspect, ahead is up", fontsize=9)
    polar.legend(loc="lower left", bbox_to_anchor=(-0.2, -0.1), fontsize=8)
    walk = rt.synthetic_motion("walk", seed=0, duration_s=WALK_S)
    radar = one_pair("paper-12ghz")
    for column, (name, body) in enumerate(bodies(walk).items(), start=1):
        ax = drawing.add_subplot(grid[column])
        shown = ax.pcolormesh(*spectrogram(body, radar), vmin=-50, vmax=0, rasterized=True)
        ax.set(xlabel="time [s]", ylabel="velocity [m/s]", ylim=(-6, 6))
        ax.set_title(f"walk at 12 GHz, {name}", fontsize=9)
    drawing.colorbar(shown, label="power [dB over the largest]")
    drawing.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(main("The human mesh: closed, its joints, and its returns.", measure, figure))
