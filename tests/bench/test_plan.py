"""What is measured, and what is refused before anything runs."""

from __future__ import annotations

import pytest

from rtradar.bench import Plan, plan_of
from rtradar.cli import main


def test_quick_is_less_of_everything_unless_asked_for() -> None:
    plan = plan_of(fidelities="specular , analytic", duration_s=0.25, quick=True, radars=None)
    assert plan == Plan(
        ("paper-12ghz",), ("specular", "analytic"), repeats=1, duration_s=0.25, quick=True
    )
    assert plan.growing_durations_s == (0.25, 0.5)
    assert Plan().growing_durations_s == (3.0, 6.0, 12.0, 30.0, 60.0)


def test_growth_is_of_specular_or_of_the_last_model() -> None:
    assert Plan().growing_fidelity == "specular"
    assert Plan(fidelities=("analytic-paper", "analytic")).growing_fidelity == "analytic"


def test_a_quick_measurement_has_the_usual_model() -> None:
    plan = plan_of(quick=True)
    assert plan.fidelities == ("analytic-paper", "analytic", "specular")
    assert plan.growing_fidelity == "specular"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--radar", "paper-60ghz"], "radar 'paper-60ghz' is unknown; allowed"),
        (["--radar", "paper-12ghz,"], "--radar paper-12ghz,: name each once"),
        (["--fidelity", "specular,specular"], "--fidelity specular,specular: name each once"),
        (["--fidelity", "exact"], "fidelity 'exact' is unknown; allowed: analytic-paper"),
        (["--fidelity", "fresnel"], "fidelity 'fresnel' is gone; take 'specular' with visibility"),
        *((["--repeats", wrong], "invalid whole number, at least 1") for wrong in ("0", "some")),
        (
            ["--duration", "0.05"],
            "--duration 0.05: it holds no whole frame of radar 'paper-12ghz'; give at least 0.1 s",
        ),
        (["--only", "kernels"], "--only: invalid choice: 'kernels'"),
        (["--json", "nowhere/b.json"], "--json nowhere/b.json: there is no folder"),
        (["--figure", "nowhere/b.png"], "--figure nowhere/b.png: there is no folder"),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
