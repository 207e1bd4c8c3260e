"""Drawings of the pages: meshes, rooms, and the geometry of the theory, drawn anew at each build.

`python docs/drawings.py FOLDER` draws them without Sphinx.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial import ConvexHull
from scipy.special import fresnel

import rtradar as rt
import rtradar.process
from rtradar.scene import Furniture, material

MESHES = Path(__file__).parents[1] / "meshes"
SCENES = Path(__file__).parents[1] / "scenes"
BODY = {"facecolor": "#cfe0ee", "edgecolor": "#30618c"}


def panel(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure with one pair of axes in metres of equal scale, and no frame."""
    figure = Figure((width, height), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.axis("off")
    return figure, axes


def line(axes: Axes, *points: NDArray[np.float64], **look: object) -> None:
    """Draw a broken line through points (2,)."""
    axes.plot(*np.transpose(points), **look)


def arrow(axes: Axes, start: NDArray[np.float64], end: NDArray[np.float64], colour: str) -> None:
    """Draw an arrow between two points (2,)."""
    axes.annotate(
        "", xy=tuple(end), xytext=tuple(start), arrowprops={"arrowstyle": "-|>", "color": colour}
    )


def label(axes: Axes, point: NDArray[np.float64], text: str, dx: float = 0, dy: float = 8) -> None:
    """Write a text beside a point, dx and dy in points."""
    axes.annotate(
        text, tuple(point), xytext=(dx, dy), textcoords="offset points", ha="center", va="center"
    )


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale a vector to length 1."""
    return vector / np.linalg.norm(vector)


def scenes() -> Figure:
    """All scenes that have walls or furniture, from above."""
    named = {path.stem: rt.Scene.load(path.stem) for path in sorted(SCENES.glob("*.toml"))}
    drawn = {name: scene for name, scene in named.items() if scene.walls or scene.furniture}
    figure = Figure((11, 7.5), layout="constrained")
    for axes, (name, scene) in zip(
        figure.subplots(2, (len(drawn) + 1) // 2).flat, drawn.items(), strict=False
    ):
        for wall in scene.walls:
            if abs(float(wall.normal[2])) < 0.5:
                axes.plot(*wall.corners[:, :2].T, color="black", linewidth=2)
        for piece in scene.furniture:
            ground = piece.triangles().vertices[:, :2]
            outline = ground[ConvexHull(ground, qhull_options="QJ").vertices]
            axes.fill(*outline.T, **BODY)
            axes.text(*ground.mean(axis=0), piece.name, fontsize=7, ha="center", va="center")
        place = np.zeros(2) if scene.person_position_m is None else scene.person_position_m[:2]
        axes.plot(*place, "o", color="tab:red", label="person")
        given = scene.radar_position_m
        at = rt.Radar.preset("paper-12ghz").position_m if given is None else given
        axes.plot(*at[:2], ">", color="tab:green", markersize=9, label="radar")
        axes.set(title=name, xlabel="x [m]", ylabel="y [m]", aspect="equal")
    for axes in figure.axes[len(drawn) :]:
        axes.axis("off")
    figure.axes[0].legend(fontsize=8)
    return figure


def meshes() -> Figure:
    """All meshes that come along, each at its own scale."""
    names = [path.stem for path in sorted(MESHES.glob("*.ply"))]
    columns = 6
    figure = Figure((11, 6.5), layout="constrained")
    for number, name in enumerate(names):
        axes = figure.add_subplot(-(-len(names) // columns), columns, number + 1, projection="3d")
        corners = (
            Furniture(name=name, mesh=name, material=material("metal"), position_m=(0.0, 0.0, 0.0))
            .triangles()
            .corners
        )
        faces = Poly3DCollection(corners, linewidths=0.2, shade=True, facecolors=BODY["facecolor"])
        axes.add_collection3d(faces)
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(np.maximum(high - low, 0.01))
        axes.view_init(elev=22, azim=-40)
        axes.set_axis_off()
        axes.set_title(f"{name}\n" + " × ".join(f"{x:.2f}" for x in high - low) + " m", fontsize=8)
    return figure


def chirps() -> Figure:
    """The sweeps of a TDM cycle, and what the echo of one of them does to the beat frequency."""
    figure = Figure((9, 3), layout="constrained")
    axes = figure.subplots()
    for number in range(4):
        colour = f"C{number % 3}"
        axes.plot([number, number + 1], [0, 1], color=colour, linewidth=2)
        axes.plot([number + 0.12, number + 1], [0, 0.88], color=colour, linestyle="--")
        axes.text(number + 0.45, 0.82, f"Tx {number % 3 + 1}", color=colour, ha="right")
        axes.plot(number + 0.5, 0.5, "o", color=colour, markersize=4)
    axes.annotate("", (0.7, 0.7), (0.7, 0.58), arrowprops={"arrowstyle": "<->"})
    axes.text(0.74, 0.55, r"$s\tau$", fontsize=12)
    axes.annotate("", (0.3, 0.18), (0.18, 0.18), arrowprops={"arrowstyle": "<->"})
    axes.text(0.24, 0.06, r"$\tau$", fontsize=12, ha="center")
    axes.set_xticks(range(5), ["0", "T", "2T", "3T", "4T"])
    axes.set_yticks([0, 1], ["$f_c$", "$f_c + B$"])
    axes.set(xlabel="time", ylabel="frequency", xlim=(0, 4.05), ylim=(0, 1.05))
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def specular_point() -> Figure:
    """An ellipse, the specular point between Tx and Rx, its normal, and the centre path."""
    figure, axes = panel(8, 3.6)
    half = np.array([1.3, 0.6])
    tx, rx = np.array([-4.0, 1.6]), np.array([-4.0, -0.6])

    def at(angle: float) -> NDArray[np.float64]:
        return half * np.array([np.cos(angle), np.sin(angle)])

    def path(angle: float) -> float:
        return float(np.linalg.norm(tx - at(angle)) + np.linalg.norm(rx - at(angle)))

    point = at(minimize_scalar(path, bounds=(np.pi / 2, 3 * np.pi / 2), method="bounded").x)
    normal = unit(point / half**2)
    axes.add_patch(Ellipse((0, 0), *(2 * half), **BODY))
    for antenna, name in ((tx, "T"), (rx, "R")):
        line(axes, antenna, point, color="tab:red")
        arrow(axes, point, point + 0.9 * unit(antenna - point), "black")
        axes.plot(*antenna, "s", color="black")
        label(axes, antenna, f"${name}$", dx=-12, dy=0)
        label(
            axes, point + 0.9 * unit(antenna - point), f"$s_{name}$", dy=11 if name == "T" else -11
        )
    arrow(axes, point, point + 1.3 * normal, "tab:blue")
    label(axes, point + 1.3 * normal, "$n$", dx=-8, dy=0)
    line(axes, tx, np.zeros(2), rx, color="grey", linestyle=":")
    axes.plot(*point, "o", color="tab:red")
    label(axes, point, "$p$", dx=10, dy=0)
    axes.plot(0, 0, "+", color="grey")
    label(axes, np.zeros(2), "centre", dy=-10)
    axes.set(xlim=(-4.5, 1.5), ylim=(-1, 1.9))
    return figure


def visible_fraction() -> Figure:
    """Fresnel zones under the edge of an occluder, and the visible fraction as the edge crosses."""
    figure = Figure((9, 3.4), layout="constrained")
    rings, curve = figure.subplots(1, 2, width_ratios=(1, 1.6))
    for number in range(6, 0, -1):
        shade = "#cfe0ee" if number % 2 else "white"
        rings.add_patch(
            Ellipse((0, 0), *(2 * np.sqrt(number) * np.array([1.0, 0.7])), fc=shade, ec="#30618c")
        )
    rings.add_patch(Rectangle((0.7, -2.2), 2.2, 4.4, color="grey", alpha=0.75))
    rings.text(1.8, 0, "occluder", rotation=90, ha="center", va="center", color="white")
    rings.plot(0, 0, "o", color="tab:red")
    rings.set(xlim=(-2.7, 2.9), ylim=(-2.2, 2.2), aspect="equal")
    rings.axis("off")
    # Half-plane of Fresnel integrals (Born and Wolf, section 8.7): open where its edge is beyond.
    edge = np.linspace(-3, 3, 400)
    sine, cosine = fresnel(edge * np.sqrt(2))
    fraction = np.abs((0.5 + cosine + 1j * (0.5 + sine)) / (1 + 1j))
    curve.plot(edge, fraction, color="tab:blue", label=r"$|V|$")
    curve.plot(edge, edge > 0, color="tab:red", linestyle="--", label="visibility of $p$")
    curve.set(
        xlabel="edge beyond the specular point, in radii of the first zone", ylabel="amplitude"
    )
    curve.legend()
    return figure


def image_path() -> Figure:
    """An echo over a wall: the image of the radar, the echo over the wall, and the direct one."""
    figure, axes = panel(8, 3.8)
    radar, image, person = np.array([-3.5, 0.0]), np.array([-3.5, 3.6]), np.array([0.5, 0.3])
    wall = image + (person - image) * (image[1] - 1.8) / (image[1] - person[1])
    line(axes, np.array([-4.2, 1.8]), np.array([1.5, 1.8]), color="black", linewidth=3)
    label(axes, np.array([1.1, 1.8]), "wall", dy=10)
    axes.add_patch(Ellipse(tuple(person), 0.35, 0.8, **BODY))
    line(axes, radar, person, color="tab:red")
    line(axes, radar, wall, person, color="tab:blue")
    line(axes, image, wall, color="tab:blue", linestyle=":")
    axes.plot(*radar, "s", color="black")
    axes.plot(*image, "s", color="grey")
    axes.plot(*wall, "o", color="tab:blue", markersize=4)
    label(axes, radar, "$P$", dx=-12, dy=0)
    label(axes, image, "$P'$, its image", dx=0, dy=11)
    label(axes, person, "person", dx=38, dy=0)
    arrow(axes, np.array([-0.9, 1.8]), np.array([-0.9, 1.2]), "grey")
    label(axes, np.array([-0.9, 1.2]), "$n$", dx=9, dy=0)
    axes.set(xlim=(-4.4, 1.8), ylim=(-0.4, 4.0))
    return figure


def training_cells() -> Figure:
    """The cells that CFAR compares on a range-Doppler map, by its default guard and training."""
    defaults = inspect.signature(rt.process.os_cfar).parameters
    guard, train = (defaults[name].default for name in ("guard", "train"))
    far = guard + train
    figure, axes = panel(4.5, 4.5)
    for row in range(-far - 1, far + 2):
        for column in range(-far - 1, far + 2):
            away = max(abs(row), abs(column))
            colour = "white" if away <= guard else BODY["facecolor"]
            colour = "#eeeeee" if away > far else "tab:red" if away == 0 else colour
            axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fc=colour, ec="grey", lw=0.6))
    axes.text(0, 1.5, "guard", ha="center", va="center")
    axes.text(0, guard + train / 2 + 0.5, "training", ha="center", va="center")
    axes.text(0, -far - 2.2, "Doppler", ha="center", va="center")
    axes.text(-far - 2.2, 0, "range", ha="center", va="center", rotation=90)
    axes.set(xlim=(-far - 3, far + 2), ylim=(-far - 3, far + 2))
    return figure


DRAWINGS: dict[str, Callable[[], Figure]] = {
    "scenes.png": scenes,
    "meshes.png": meshes,
    "chirps.png": chirps,
    "specular-point.png": specular_point,
    "visible-fraction.png": visible_fraction,
    "image-path.png": image_path,
    "training-cells.png": training_cells,
}


def draw(folder: Path) -> None:
    """Draw all of them into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in DRAWINGS.items():
        make().savefig(folder / name, dpi=150)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
