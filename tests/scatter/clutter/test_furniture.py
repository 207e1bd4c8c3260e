"""Furniture: plates and reflectors against closed forms, materials, shadows, walls on the way."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.clutter import furniture as clutter_furniture
from rtradar.scatter.clutter.furniture import furniture_returns
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scene import Furniture, Scene, material, reflection
from rtradar.trace.backend import select, use

AWAY = 60.0
WIDE = Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0, position_m=(-AWAY, 0, 1), samples_per_chirp=4096)
ONE = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, position_m=(-AWAY, 0, 1), samples_per_chirp=4096)


def returns(radar: Radar, scene: Scene) -> dict[str, RoomEchoes]:
    return {
        echoes.name: echoes for echoes in furniture_returns(use(select("scalar")), radar, scene)
    }


def field(
    echoes: RoomEchoes, radar: Radar, frequency: np.ndarray, to: float = 2 * AWAY
) -> np.ndarray:
    """Conjugate scattering length relative to that path, times R1 R2: (frequency, tx, rx)."""
    k = 2 * np.pi * frequency[:, None, None, None] / SPEED_OF_LIGHT_MPS
    return (echoes.at_nodes(frequency) * np.exp(1j * k * (echoes.length - to))).sum(axis=-1) * (
        to / 2
    ) ** 2


def block(
    folder: Path,
    name: str,
    size: tuple[float, float, float],
    at: tuple[float, float, float],
    made: str,
) -> Furniture:
    trimesh.creation.box(size).export(folder / f"{name}.ply")
    return Furniture(
        name=name,
        mesh=folder / f"{name}.ply",
        material=material(made),
        position_m=at,
        metres_per_unit=1.0,
    )


@pytest.mark.parametrize("made", ["perfect-conductor", "concrete"])
def test_a_flat_side_returns_as_a_plate(tmp_path: Path, made: str) -> None:
    scene = Scene(furniture=(block(tmp_path, "block", (0.1, 0.4, 0.3), (0.05, 0, 1), made),))
    frequency = np.linspace(12e9, 16e9, 9)
    found = field(returns(ONE, scene)["block"], ONE, frequency)[:, 0, 0]
    # A plate seen straight on: j k A / sqrt(pi), times the mirror's coefficient over that of a
    # conductor; conjugate.
    expected = np.conj(1j * 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS * 0.12 / np.sqrt(np.pi))
    expected *= np.conj(-reflection(material(made).eta(14e9), 1.0, "te"))
    # At 60 m waves bow over it: on the mean by (a^2 + b^2) / 12 R of path.
    expected *= np.exp(2j * np.pi * frequency / SPEED_OF_LIGHT_MPS * (0.4**2 + 0.3**2) / 12 / AWAY)
    # Its square, 0.06 rad about the mean, takes 0.2 % of the size; the factor of the phase of
    # concrete is that straight on.
    np.testing.assert_allclose(found, expected, rtol=0.005)


@pytest.mark.parametrize(
    ("mesh", "exact", "limit_db"), [("trihedral", 4 / 3, 0.3), ("dihedral", 8.0, 0.15)]
)
def test_corner_reflectors_return_what_closed_forms_say(
    mesh: str, exact: float, limit_db: float
) -> None:
    piece = Furniture(
        name="corner",
        mesh=mesh,
        material=material("perfect-conductor"),
        position_m=(0, 0, 1),
        yaw_deg=180,
    )
    echoes = returns(ONE, Scene(furniture=(piece,)))["corner"]
    frequency = np.array([14e9])
    wavelength = SPEED_OF_LIGHT_MPS / 14e9
    rcs = exact * np.pi * 0.4**4 / wavelength**2
    found = np.abs(field(echoes, ONE, frequency)) ** 2
    # Optics leaves out edges; at 60 m the dihedral is 1.3 times as far as 4 a^2 / lambda, where
    # fields are those of far away.
    assert abs(10 * np.log10(found.item() / rcs)) < limit_db
    assert echoes.kind == "reflector"
    assert set(echoes.bounces) >= {1, 2 if mesh == "dihedral" else 3}


def test_reflectors_do_nothing_from_behind_but_their_own_plates() -> None:
    piece = Furniture(
        name="corner", mesh="trihedral", material=material("metal"), position_m=(0, 0, 1)
    )
    assert (returns(ONE, Scene(furniture=(piece,)))["corner"].bounces == 1).all()


def test_what_stands_before_hides_what_stands_behind(tmp_path: Path) -> None:
    front = block(tmp_path, "front", (0.1, 1.0, 1.0), (0, 0, 1), "wood")
    behind = block(tmp_path, "behind", (0.1, 0.5, 0.5), (1.0, 0, 1), "metal")
    beside = block(tmp_path, "beside", (0.1, 0.5, 0.5), (1.0, 1.5, 1), "metal")
    assert set(returns(WIDE, Scene(furniture=(front, behind, beside)))) == {"front", "beside"}


def test_groups_and_their_frequency_nodes_add_up_to_all_facets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Tilted, deep, and near: paths to its facets differ by many range bins.
    piece = block(tmp_path, "block", (0.5, 0.9, 0.7), (0.4, 0.3, 1), "wood")
    scene = Scene(furniture=(Furniture(**{**vars(piece), "yaw_deg": 25.0}),))
    near = Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0)
    frequency = np.linspace(12.1e9, 15.9e9, 9)
    coarse = field(returns(near, scene)["block"], near, frequency, 8.0)
    monkeypatch.setattr(clutter_furniture, "FURNITURE_NODES", 9)
    monkeypatch.setattr(clutter_furniture, "_WIDTH_BINS", 1.0)
    fine = field(returns(near, scene)["block"], near, frequency, 8.0)
    # Facets seen edge-on reach two range bins from the middle of their group, more than five nodes
    # follow to the last digit.
    assert np.abs(coarse - fine).max() < 0.01 * np.abs(fine).max()


def test_too_many_facets_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clutter_furniture, "MOST_FACETS", 100)
    with pytest.raises(InputError, match="more than 100 facets"):
        returns(
            ONE, Scene(furniture=(block(tmp_path, "block", (0.5, 0.9, 0.7), (0, 0, 1), "wood"),))
        )
