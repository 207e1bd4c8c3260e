"""Lengths of the specular paths of an empty box room against closed-form images and Sionna RT.

Orders 0 to 2 are compared. Closed form: in a box the images of a source form a lattice, so a path
has the length of a vector to one of its points. Sionna RT (Apache 2.0,
https://nvlabs.github.io/sionna) is an independent solver that traces in float32. It is no
dependency: where `import sionna.rt` fails, one line says so and only the closed form is judged. To
install it: ``pip install sionna-rt``, best beside the environment of rtradar, because it brings its
own Mitsuba.

    python validation/other_methods/sionna_paths.py [--quick] [--json FILE]
"""

from __future__ import annotations

import os
import sys
from functools import partial
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from rtradar.scatter.multipath.image_paths import corners, wall_paths
from rtradar.scene import Surface, material, room_walls
from rtradar.trace.backend import select
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

Array = NDArray[np.float64]
judged, reported = (partial(kind, key="multipath") for kind in (rows.judged, rows.reported))
SIZE, CORNER = np.array([7.0, 5.2, 2.6]), np.array([-4.5, -2.2, 0.0])
ORDER = 2


def ours(tx: Array, rx: Array) -> Array:
    """Lengths of all valid paths from Tx to Rx [m]; the whole path is a way out, the body is Rx."""
    surface = Surface(material=material("concrete"), thickness_m=0.2)
    sides = dict.fromkeys(("near", "far", "right", "left", "floor", "ceiling"), surface)
    walls = room_walls(tuple(SIZE), tuple(CORNER[:2]), sides)
    found = []
    for path in wall_paths(walls, tx, ORDER):
        if path.back:
            continue
        along, valid = corners(path.out, tx, rx)
        if valid:
            found.append(sum(float(np.linalg.norm(b - a)) for a, b in pairwise(along)))
    return np.sort(found)


def lattice(tx: Array, rx: Array) -> Array:
    """Images at 2 n L + x and 2 n L - x along each axis, after |2 n| and |2 n - 1| reflections."""
    choices = []
    for axis in range(3):
        place, length = tx[axis] - CORNER[axis], SIZE[axis]
        own = [(2 * n * length + place, abs(2 * n)) for n in range(-ORDER, ORDER + 1)]
        own += [(2 * n * length - place, abs(2 * n - 1)) for n in range(-ORDER, ORDER + 1)]
        choices.append([(image + CORNER[axis], count) for image, count in own])
    kept = [images for images in product(*choices) if sum(count for _, count in images) <= ORDER]
    return np.sort(
        [np.linalg.norm(np.array([image for image, _ in images]) - rx) for images in kept]
    )


def sionna(pairs: list[tuple[Array, Array]]) -> list[Array] | None:
    """The same by Sionna RT; None where it is not installed."""
    library = select("auto").llvm_path
    if library:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", library)
    try:
        import mitsuba as mi
        import sionna.rt as other
    except ImportError as error:
        print(f"Sionna RT is skipped: {error}; 'pip install sionna-rt' installs it")
        return None
    scene = other.load_scene()
    middle = CORNER + SIZE / 2
    place = mi.ScalarTransform4f().translate(middle.tolist()).scale((SIZE / 2).tolist())
    concrete = other.ITURadioMaterial("walls", "concrete", thickness=0.2)
    scene.edit(
        add=[
            other.SceneObject(
                mi_mesh=mi.load_dict({"type": "cube", "to_world": place}),
                name="box",
                radio_material=concrete,
            )
        ]
    )
    scene.frequency = 10e9
    scene.tx_array = scene.rx_array = other.PlanarArray(
        num_rows=1, num_cols=1, pattern="iso", polarization="V"
    )
    found = []
    for number, (tx, rx) in enumerate(pairs):
        scene.add(other.Transmitter(f"tx {number}", tx.tolist()))
        scene.add(other.Receiver(f"rx {number}", rx.tolist()))
        paths = other.PathSolver()(scene, max_depth=ORDER, refraction=False)
        delay = np.array(paths.tau).astype(np.float64).ravel()
        found.append(np.sort(delay[delay > 0]) * 299_792_458.0)
        scene.remove(f"tx {number}")
        scene.remove(f"rx {number}")
    return found


def measure(quick: bool) -> list[Row]:
    rng = np.random.default_rng(0)
    inside = [CORNER + SIZE * rng.uniform(0.08, 0.92, (2, 3)) for _ in range(5 if quick else 20)]
    pairs = [(two[0], two[1]) for two in inside]
    mine, theirs = [ours(*pair) for pair in pairs], sionna(pairs)
    says = "specular paths of an empty box room, orders 0 to 2"
    rows = compared(mine, [lattice(*pair) for pair in pairs], ("the lattice of images", 1.0), says)
    if theirs is not None:
        says = "specular paths of an empty box room, to Sionna RT (float32)"
        rows += compared(mine, theirs, ("Sionna RT", 50.0), says)
    return rows


def compared(
    mine: list[Array], others: list[Array], reference: tuple[str, float], says: str
) -> list[Row]:
    """Number and lengths of all paths; the reference has a name and a limit of the length [um]."""
    name, limit_um = reference
    count = sum(len(lengths) for lengths in mine)
    lost = sum(abs(len(a) - len(b)) for a, b in zip(mine, others, strict=True))
    about = {"says": says, "cases": count}
    quantity = f"paths more or fewer than of {name}, {count}"
    rows = [judged("box room", quantity, "", lost, 0, **about)]
    if lost == 0:
        worst = max(float(np.abs(a - b).max()) for a, b in zip(mine, others, strict=True))
        quantity = f"worst length to {name}, {count} paths"
        rows.append(judged("box room", quantity, "um", worst * 1e6, limit_um, **about))
    return rows


if __name__ == "__main__":
    sys.exit(main("Specular paths of a box room, against images and Sionna RT.", measure))
