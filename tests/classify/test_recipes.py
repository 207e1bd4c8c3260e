from __future__ import annotations

import pytest

from rtradar.classify.recipes import LEAN, PAPER, Recipe
from rtradar.errors import InputError


def test_the_papers_rate_is_halved_every_ten_epochs_and_ends_below_a_millionth() -> None:
    assert [PAPER.rate_at(epoch, 0.5) for epoch in (0, 9, 10, 25)] == [1e-4, 1e-4, 5e-5, 2.5e-5]
    assert PAPER.epochs_run == 70
    assert PAPER.rate_at(69, 1.0) >= 1e-6 > PAPER.rate_at(70, 0.0)
    assert PAPER.changed(stop_below=0.0).epochs_run == 200


def test_one_cycle_rises_to_the_rate_and_ends_at_nothing() -> None:
    rates = [LEAN.rate_at(epoch, part / 10) for epoch in range(LEAN.epochs) for part in range(10)]
    top = rates.index(max(rates))
    assert rates[top] == pytest.approx(LEAN.rate)
    assert top == len(rates) // 10
    # Half of it half-way up, along a line, and half-way down, along a cosine, which is at 3/4 after
    # a third.
    halves = [LEAN.rate_at(epoch, part) for epoch, part in ((1, 0.5), (16, 0.5), (12, 0.0))]
    assert halves == pytest.approx([LEAN.rate / 2, LEAN.rate / 2, LEAN.rate * 3 / 4])
    assert rates[: top + 1] == sorted(rates[: top + 1])
    assert rates[top:] == sorted(rates[top:], reverse=True)
    assert 0 < rates[0] < LEAN.rate / 50
    assert rates[-1] < LEAN.rate / 1000
    assert LEAN.epochs_run == LEAN.epochs


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("points", 0), ("batch", 1), ("epochs", 0), ("rate", 0.0), ("rate", float("nan")),
        ("dropout", 1.0), ("schedule", "none"), ("scaling", "none"), ("augmentation", "some"),
        ("precision", "float16"), ("stop_below", -1.0), ("step_epochs", 0),
    ],
)  # fmt: skip
def test_a_recipe_that_cannot_be_is_refused(field: str, value: object) -> None:
    with pytest.raises(InputError, match=f"{field} = .*(must be|allowed)"):
        PAPER.changed(**{field: value})


def test_plain_values_make_the_same_recipe() -> None:
    assert Recipe.from_dict(LEAN.as_dict()) == LEAN
    assert PAPER.as_dict()["schedule"] == "halving"  # as in the plans of earlier versions
    assert LEAN.as_dict()["redraw"] is True
    assert PAPER.changed(augmentation="turned") == PAPER.changed(augmentation="rotation")


def test_every_public_name_is_found() -> None:
    from rtradar import classify

    assert all(getattr(classify, name) is not None for name in classify.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        classify.__getattr__("nothing")
