"""`Echoes`: shapes fit each other, and what is given becomes arrays of the right kind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rtradar.echoes import Echoes

CHIRPS, RX, ECHOES = 5, 3, 2


def fields(nodes: int = 1, **changed: Any) -> dict[str, Any]:
    return {
        "length": np.full((CHIRPS, RX, ECHOES), 8.0),
        "amplitude": np.ones((nodes, CHIRPS, RX, ECHOES), complex),
        "frequency": np.linspace(12e9, 16e9, nodes),
        "tx": np.arange(CHIRPS),
        "part": np.arange(ECHOES),
        "bounces": np.ones(ECHOES, int),
        **changed,
    }


@pytest.mark.parametrize("nodes", [1, 3])
def test_good_shapes(nodes: int) -> None:
    echoes = Echoes(**fields(nodes))
    assert echoes.amplitude.shape == (nodes, *echoes.length.shape)


@pytest.mark.parametrize("shape", [(0, RX, ECHOES), (CHIRPS, RX, 0), (1, 1, 1)])
def test_none_at_all_is_allowed(shape: tuple[int, int, int]) -> None:
    chirps, _, echoes = shape
    none = fields(length=np.zeros(shape), amplitude=np.zeros((1, *shape)), tx=np.zeros(chirps, int))
    assert Echoes(**{**none, "part": [0] * echoes, "bounces": [1] * echoes}).length.shape == shape


def test_lists_become_arrays() -> None:
    echoes = Echoes(
        length=[[[8]]], amplitude=[[[[1 + 2j]]]], frequency=[14e9], tx=[3], part=[20], bounces=[1]
    )
    assert echoes.length.dtype == np.float64
    assert echoes.frequency.dtype == np.float64
    assert np.iscomplexobj(echoes.amplitude)
    assert all(index.dtype == np.int64 for index in (echoes.tx, echoes.part, echoes.bounces))


def test_amplitudes_keep_their_precision() -> None:
    single = np.ones((1, CHIRPS, RX, ECHOES), np.complex64)
    assert Echoes(**fields(amplitude=single)).amplitude.dtype == np.complex64


@pytest.mark.parametrize(
    ("field", "shape"),
    [
        ("length", (CHIRPS, RX)),
        ("length", (CHIRPS, RX, ECHOES, 1)),
        ("amplitude", (CHIRPS, RX, ECHOES)),
        ("amplitude", (2, CHIRPS, RX, ECHOES)),
        ("amplitude", (1, CHIRPS, RX, ECHOES + 1)),
        ("amplitude", (1, CHIRPS, 1, ECHOES)),
        ("amplitude", (1, 1, RX, ECHOES)),
        ("frequency", ()),
        ("frequency", (0,)),
        ("frequency", (1, 1)),
        ("frequency", (2,)),
        ("tx", ()),
        ("tx", (CHIRPS - 1,)),
        ("tx", (CHIRPS, RX)),
        ("part", (ECHOES + 1,)),
        ("part", ()),
        ("bounces", (CHIRPS,)),
    ],
)
def test_shapes_that_do_not_fit_are_refused(field: str, shape: tuple[int, ...]) -> None:
    # A wrong frequency may be reported as an amplitude that does not fit it.
    with pytest.raises(ValueError, match=rf"Echoes\.({field}|amplitude) has shape") as caught:
        Echoes(**fields(**{field: np.ones(shape)}))
    assert "\n" not in str(caught.value)


def test_no_nodes_are_refused_though_amplitude_fits() -> None:
    with pytest.raises(ValueError, match=r"Echoes\.frequency has shape \(0,\)"):
        Echoes(**fields(frequency=np.zeros(0), amplitude=np.zeros((0, CHIRPS, RX, ECHOES))))


def test_the_message_says_what_is_allowed() -> None:
    with pytest.raises(
        ValueError, match=r"Echoes\.tx has shape \(4,\); with this length it must be \(5,\)"
    ):
        Echoes(**fields(tx=np.zeros(4)))


def test_a_node_that_is_named_twice_is_refused() -> None:
    nodes = {"frequency": np.array([14e9, 14e9]), "amplitude": np.ones((2, CHIRPS, RX, ECHOES))}
    with pytest.raises(ValueError, match=r"Echoes\.frequency names a node twice"):
        Echoes(**fields(**nodes))
