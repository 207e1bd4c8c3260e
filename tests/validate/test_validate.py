"""`rtradar validate`: the scripts that it runs, its table of their rows, and its refusals."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rtradar import validate
from rtradar.cli import main
from rtradar.errors import InputError
from rtradar.validate import BEGIN, END, KEYS, Claim, Outcome, markdown, write_readme
from rtradar.validate.rows import Row, used_up

GOOD = """
import sys
from rtradar.validate.rows import judged, main, reported
def measure(quick):
    error = 0.5 if quick else 0.25
    about = {"says": "balls are round", "cases": 3}
    round_ = judged("a ball", "round", "m", error, 1.0, key="sphere", **about)
    return [round_, reported("a ball", "red", "", 3.0, key="colour")]
if __name__ == "__main__":
    sys.exit(main("Balls.", measure))
"""
BAD = """
import sys
from rtradar.validate.rows import judged, main
def measure(quick):
    print("what goes to stdout does not matter")
    floor = judged("a floor", "flat", "dB", -70.0, -80.0)
    return [floor, judged("a wall", "straight", "dB", float("nan"), 1.0)]
if __name__ == "__main__":
    sys.exit(main("Floors.", measure))
"""
HANGS = """
import subprocess, sys, time
from rtradar.validate import rows
from rtradar.validate.rows import main
rows.QUICK_LIMIT_S = 0.2
def measure(quick):
    subprocess.Popen([sys.executable, "-c", "import time; time.sleep(8)"])
    time.sleep(60)
sys.exit(main("Hangs.", measure))
"""
BROKEN = """
from rtradar.validate.rows import main
def measure(quick): ...
if __name__ == "__main__":
    raise RuntimeError("no measurement")
"""
ELSEWHERE = """
from rtradar.validate.rows import leave_out, main
def measure(quick):
    leave_out("recorded walks", "RTRADAR_MOCAP, the folder of them")
    return []
raise SystemExit(main("Recordings.", measure))
"""
HELPER = "def measure(quick): ...\n"  # takes no `main` of rtradar.validate.rows: not a claim


def scripts(place: Path, **texts: str) -> Path:
    """Make a folder of scripts."""
    (place / "toys").mkdir(parents=True)
    (place / "toys" / "balls.py").write_text(GOOD)
    (place / "helper.py").write_text(HELPER)
    for name, text in texts.items():
        (place / f"{name}.py").write_text(text)
    return place


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of scripts in place of the real one."""
    place = scripts(tmp_path / "validation")
    monkeypatch.setattr(validate, "validation_folder", lambda: place)
    return place


class Told(NamedTuple):
    """What came of a command."""

    status: int
    out: str
    content: dict[str, Any]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Told:
    """Scripts whose rows pass, fail, or do not come, once for all that is said of them."""
    made = tmp_path_factory.mktemp("scripts")
    place = scripts(made / "validation", floors=BAD, walks=ELSEWHERE, zz=BROKEN)
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as out:
        patch.setattr(validate, "validation_folder", lambda: place)
        status = main(["validate", "--json", str(made / "v.json")])
    return Told(status, out.getvalue(), json.loads((made / "v.json").read_text()))


def test_rows_are_kept_and_one_outside_its_limit_fails(told: Told) -> None:
    assert told.status == 1
    assert "FAILED: 1 of 3 judged figures within their limits, 1 reported; 4 scripts" in told.out
    assert "FAILED  a floor: flat: -70 dB, limit -80" in told.out
    assert "FAILED  a wall: straight: nan dB, limit 1" in told.out
    assert told.content["passed"] is False
    rows = [(row["key"], row["script"], row["error"]) for row in told.content["rows"]]
    # The script's name where it names no key; JSON has no NaN.
    assert rows == [
        ("sphere", "balls.py", 0.25),
        ("colour", "balls.py", 3.0),
        ("floors", "floors.py", -70.0),
        ("floors", "floors.py", None),
    ]
    assert told.content["scripts"][0]["keys"] == ["sphere", "colour"]


def test_a_script_that_breaks_fails_and_what_cannot_be_measured_here_does_not(told: Told) -> None:
    assert (
        "FAILED  zz ended with status 1 and left no rows: RuntimeError: no measurement" in told.out
    )
    needed = "recorded walks: needs RTRADAR_MOCAP, the folder of them"
    assert f"not measured: {needed}" in told.out
    scripts = {one["script"]: one for one in told.content["scripts"]}
    assert scripts["walks.py"]["left_out"] == [needed]
    assert {name: bool(one["trouble"]) for name, one in scripts.items()} == {
        "balls.py": False, "floors.py": False, "walks.py": False, "zz.py": True,
    }  # fmt: skip


def test_the_costliest_scripts_are_said_with_what_they_judge(told: Told) -> None:
    _, _, costs = told.out.partition("a figure\n")
    judged = {line.split()[0]: line.split()[-3] for line in costs.splitlines() if "-" not in line}
    assert judged == {"balls": "1", "floors": "2"}


def test_scripts_of_costs_run_alone_after_all_others(folder: Path, tmp_path: Path) -> None:
    # Each notes when it begins and when it has measured; the one of costs is first by name.
    notes = tmp_path / "notes"
    note = f'open({str(notes)!r}, "a").write(__file__ + chr(10))'
    text = GOOD.replace("    error =", f"    {note}\n    error =")
    text = text.replace("    return", f"    {note}\n    return")
    (folder / "cost").mkdir()
    for place in ("cost/a_first.py", "toys/balls.py", "toys/cubes.py"):
        (folder / place).write_text(text)
    assert main(["validate"]) == 0
    names = [Path(line).name for line in notes.read_text().splitlines()]
    assert sorted(names[:4]) == ["balls.py"] * 2 + ["cubes.py"] * 2
    assert names[4:] == ["a_first.py"] * 2


def test_quick_and_figures_reach_the_script(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["validate", "--quick", "--json", str(tmp_path / "v.json")]
    assert main([*words, "--figure", str(tmp_path / "new" / "figures")]) == 0
    assert json.loads((tmp_path / "v.json").read_text())["rows"][0]["error"] == 0.5
    assert (tmp_path / "new" / "figures" / "balls.png").stat().st_size > 1000
    said = capsys.readouterr()
    assert "passed: 1 of 1 judged figures within their limits, 1 reported; 1 scripts" in said.out
    assert said.err == ""  # no progress bar where there is no terminal


def test_a_script_that_hangs_ends_and_says_where(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # So does one that leaves a process behind, which keeps what it writes to.
    (folder / "zz.py").write_text(HANGS)
    assert main(["validate", "--quick"]) == 1
    said = capsys.readouterr().out
    assert "FAILED  zz ended with status 1 and left no rows: Timeout (0:00:00.2" in said
    assert " in measure " in said


@pytest.mark.parametrize(
    ("only", "keys"),
    [("colour", ["colour"]), ("balls", ["sphere", "colour"])],
)
def test_only_takes_a_key_or_a_script(
    folder: Path, tmp_path: Path, only: str, keys: list[str]
) -> None:
    (folder / "floors.py").write_text(BAD)
    assert main(["validate", "--only", only, "--json", str(tmp_path / "v.json")]) == 0
    assert [row["key"] for row in json.loads((tmp_path / "v.json").read_text())["rows"]] == keys


def test_an_unknown_claim_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "--only", "moon"]) == 2
    said = capsys.readouterr()
    assert (
        said.err
        == "rtradar: --only moon: no such claim; allowed keys: colour, sphere; or a script: balls\n"
    )
    assert said.out == ""


def test_a_file_that_cannot_be_written_is_refused_before_the_work(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["validate", "--json", "/nowhere/v.json"]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_the_table_of_a_readme_is_replaced(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    assert main(["validate", "--readme", str(readme)]) == 0
    text = readme.read_text()
    assert text.startswith(f"before\n{BEGIN}\n")
    assert text.endswith(f"{END}\nafter\n")
    assert "| `sphere` | balls are round | 0.25 m | 1 m | 3 | `balls.py` |" in text
    assert "1 of 1 judged figures are within their limits; 1 more are reported." in text
    assert "old" not in text
    assert "colour" not in text  # not judged
    write_readme(readme, text.partition(BEGIN)[2].partition(END)[0].strip())
    assert readme.read_text() == text


def outcome(name: str, *rows: dict[str, object]) -> Outcome:
    """Outcome of a script with these rows, which pass a limit of 2 m unless they say otherwise."""
    usual = {"key": name, "claim": "a case", "quantity": "length", "unit": "m"}
    usual |= {"ours": 1.0, "error": 1.0, "tolerance": 2.0, "passed": True}
    claim = Claim(Path(f"{name}.py"), (name,))
    return Outcome(claim, [Row(**(usual | row)) for row in rows], 1.0, 1.0, "")


def test_rows_that_say_the_same_are_one_line_with_the_worst_of_them() -> None:
    says = {"says": "lengths |far| and near", "cases": 10}
    table = markdown([outcome("path", says, says | {"error": 1.5}, says | {"tolerance": 3.0})])
    assert table.splitlines()[2:4] == [
        "| `path` | lengths \\|far\\| and near | 1.5 m | 2 m | 20 | `path.py` |",
        "| `path` | lengths \\|far\\| and near | 1 m | 3 m | 10 | `path.py` |",
    ]


def test_a_failure_stands_out_in_the_table() -> None:
    wrong = {"error": 2.5, "passed": False}
    table = markdown([outcome("path", {"error": 1.9}, wrong)])
    assert "| `path` | length | **2.5 m: FAILED** | 2 m | 2 | `path.py` |" in table
    assert "1 of 2 judged figures" in table


def test_the_main_claims_come_first_in_the_table() -> None:
    table = markdown([outcome(name, {}) for name in ("angle", "cfar", "path", "sphere")])
    keys = [line.split("`")[1] for line in table.splitlines()[2:6]]
    assert keys == ["sphere", "path", "cfar", "angle"]


def test_a_script_that_did_not_finish_is_named_below_the_table() -> None:
    claim = Claim(Path("path.py"), ("path",))
    assert "`path.py` left no rows." in markdown([Outcome(claim, [], 1.0, 1.0, "left no rows")])


@pytest.mark.parametrize("content", ["no markers", f"{END} {BEGIN}", BEGIN])
def test_a_readme_without_its_place_is_refused(content: str, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text(content)
    with pytest.raises(InputError, match="must hold"):
        validate.validate(readme=tmp_path / "README.md")
    assert (tmp_path / "README.md").read_text() == content


def test_a_readme_is_not_written_from_a_part(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text(f"{BEGIN}{END}")
    with pytest.raises(InputError, match="leave out"):
        validate.validate(readme=tmp_path / "README.md", quick=True)


@pytest.mark.parametrize(
    ("error", "tolerance", "fraction"),
    [
        (0.05, 0.1, 0.5),
        (-3.0, 0.1, 0.0),
        (-100.0, -80.0, 0.8),
        (-40.0, -80.0, 2.0),
        (1.0, -80.0, float("inf")),
        (0.0, 0.0, 0.0),
        (1e-9, 0.0, float("inf")),
        (float("nan"), 1.0, float("inf")),
    ],
)
def test_how_much_of_a_limit_is_used(error: float, tolerance: float, fraction: float) -> None:
    assert used_up(error, tolerance) == fraction


def test_the_claims_of_this_checkout_have_their_scripts() -> None:
    found = validate.claims(validate.validation_folder())
    keys = {key for claim in found for key in claim.keys}
    assert set(KEYS) <= keys
    assert {claim.script.parent.name for claim in found} == {
        "closed_forms",
        "other_methods",
        "measurements",
        "robustness",
        "cost",
    }


IMPORTS = """
import runpy, sys
from pathlib import Path
for script in map(Path, sys.argv[1:]):
    sys.path.insert(0, str(script.parent))
    try:
        runpy.run_path(str(script), run_name="imported")
    except Exception as error:
        print(f"{script.name}: {type(error).__name__}: {error}")
    sys.path.pop(0)
"""


@pytest.mark.slow
def test_every_script_can_be_imported() -> None:
    # Type checks leave them out, and most run only where everything is validated.
    scripts = [str(claim.script) for claim in validate.claims(validate.validation_folder())]
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS, *scripts], capture_output=True, text=True, check=True
    )
    assert done.stdout == ""
