"""Work on a cluster: what is missing is made, whatever dies meanwhile, and nothing else."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import cloudpickle
import numpy as np
import pytest
from distributed import Client
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtradar import __version__
from rtradar.campaign import build as building
from rtradar.campaign import in_words
from rtradar.campaign.build import _place_for_kernels as place_for_kernels
from rtradar.campaign.build import build_dataset, dask_client, make_and_store, missing_of, work
from rtradar.campaign.samples import Made, SamplePlan
from rtradar.cli import main
from rtradar.clouds import Collection, Sample
from rtradar.clouds.sample_files import sample_path, sweep, write_index
from rtradar.errors import CampaignError, InputError
from rtradar.system.output_folder import exclusive_lock

RECIPES = [
    SamplePlan(f"label {number % 3}", {"number": number, "version": __version__}, None, None)  # type: ignore[arg-type]
    for number in range(9)
]
TINY = """
[windows]
duration_s = 0.2
[each]
radar = ["small.toml"]
fidelity = ["analytic"]
[[synthetic]]
label = "walk"
count = 2
"""


@pytest.fixture
def tiny(tmp_path: Path, small_file: Path) -> Path:
    """The file of a data set of two short walks."""
    shutil.copy(small_file, tmp_path)
    (tmp_path / "set.toml").write_text(TINY)
    return tmp_path / "set.toml"


def fake(recipe: SamplePlan) -> Made:
    """A cloud that follows from the recipe, at no cost."""
    points = np.random.default_rng(recipe.parameters.get("number", 0)).random((4, 3))
    return Made(Sample(points, recipe.label, recipe.parameters), points, 2.0)


def deadly(recipe: SamplePlan) -> Made:
    """The same, but the process dies of signal 9 the first time."""
    mark = Path(recipe.parameters["mark"])
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return fake(recipe)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_what_is_missing_is_made_once(client: Client, tmp_path: Path) -> None:
    for recipe in RECIPES[:4]:
        make_and_store(recipe, str(tmp_path), fake)
    before = {name: (tmp_path / name).stat().st_mtime_ns for name in contents(tmp_path)}
    missing, damaged = missing_of(RECIPES, tmp_path)
    assert (damaged, len(missing)) == (0, 5)
    done = work(client, missing, tmp_path, fake)
    assert {outcome.identity for outcome in done} == {recipe.identity for recipe in missing}
    size = sample_path(tmp_path, RECIPES[5].identity).stat().st_size
    assert {outcome.size for outcome in done} == {size}
    assert missing_of(RECIPES, tmp_path) == ([], 0)
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in before} == before


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=15)
@given(
    order=st.permutations(RECIPES),
    killed=st.integers(0, 9),
    spoiled=st.integers(0, 8),
    cut=st.integers(0, 600),
)
def test_order_kills_and_damage_leave_the_same_bytes(
    tmp_path_factory: pytest.TempPathFactory,
    order: list[SamplePlan],
    killed: int,
    spoiled: int,
    cut: int,
) -> None:
    undisturbed, folder = (tmp_path_factory.mktemp(name) for name in ("undisturbed", "disturbed"))
    for recipe in RECIPES:
        make_and_store(recipe, str(undisturbed), fake)
    for recipe in order[:killed]:  # a run that ends early, with one file half-written
        make_and_store(recipe, str(folder), fake)
    (folder / f".{order[-1].identity}.npz.0123456789ab.part").write_bytes(b"half")
    path = sample_path(folder, order[spoiled].identity)
    if path.exists():
        path.write_bytes(path.read_bytes()[:cut])
    sweep(folder)
    for recipe in missing_of(order, folder)[0]:
        make_and_store(recipe, str(folder), fake)
    assert contents(folder) == contents(undisturbed)


def test_a_sample_that_cannot_be_made_does_not_stop_the_others(
    client: Client, tmp_path: Path
) -> None:
    def picky(recipe: SamplePlan) -> Made:
        if recipe.parameters["number"] == 3:
            raise InputError("the person stands in the wall")
        return fake(recipe)

    done = work(client, RECIPES, tmp_path, picky)
    troubles = [outcome.trouble for outcome in done if outcome.trouble]
    assert troubles == ["the person stands in the wall"]
    assert len(contents(tmp_path)) == 8


def test_a_folder_that_cannot_be_written_stops_it_in_one_line(
    client: Client, tmp_path: Path
) -> None:
    with pytest.raises(
        InputError,
        match=r"cannot write .*; 0 of 9 samples were made and are kept: run the same command",
    ) as caught:
        work(client, RECIPES, tmp_path / "none", fake)
    assert "\n" not in str(caught.value)


def test_a_worker_of_another_version_makes_nothing(tmp_path: Path) -> None:
    plan = SamplePlan("walk", {"version": "0.0"}, None, None)  # type: ignore[arg-type]
    outcome = make_and_store(plan, str(tmp_path), fake)
    assert f"this worker has rtradar {__version__}, not 0.0" in outcome.trouble
    assert not contents(tmp_path)


def test_a_data_set_from_its_file_to_its_clouds(here: None, tmp_path: Path, tiny: Path) -> None:
    out = tmp_path / "new" / "out"
    planned = build_dataset(tmp_path / "set.toml", out, plan_only=True)
    assert [planned[key] for key in ("samples", "whole", "made", "missing")] == [2, 0, 2, 0]
    assert planned["by"]["label"] == {"walk": 2}
    assert planned["estimated_s"] == 0
    first = contents(out)
    again = build_dataset(tmp_path / "set.toml", out)
    assert (again["whole"], again["made"], again["workers"]) == (2, 0, 0)
    sample_path(out, Collection(out).ids[0]).write_bytes(b"spoiled")
    (out / ".x.npz.0123456789ab.part").write_bytes(b"left by a killed writer")
    mended = build_dataset(tmp_path / "set.toml", out)
    assert (mended["whole"], mended["damaged"], mended["made"]) == (1, 1, 1)
    assert contents(out) == first
    found = Collection(out)
    assert len(found) == 2
    sample = found[0]
    assert (sample.label, sample.points.shape) == ("walk", (3000, 3))
    assert sample.provenance["detections"] > 0
    assert 0 < len(found.spatial(0)) <= 3000


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX locks")
def test_a_second_build_into_a_folder_is_refused_and_takes_nothing_from_the_first(
    tmp_path: Path, tiny: Path
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    unfinished = out / ".0123.npz.0123456789ab.part"
    with exclusive_lock(out):
        unfinished.write_bytes(b"half")
        with pytest.raises(InputError, match=r"another command writes into .*out.*; wait"):
            build_dataset(tmp_path / "set.toml", out)
    assert list(out.iterdir()) == [unfinished]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_half_samples_of_own_workers_go_as_the_process_has_to_end(
    tmp_path: Path, tiny: Path
) -> None:
    program = f"""
import contextlib, os
from pathlib import Path
from rtradar.campaign import build
from rtradar.system.files import discard_unfinished
folder = Path({str(tmp_path)!r})

@contextlib.contextmanager
def killed(workers, scheduler):
    (folder / (scheduler or "own") / ".0123.npz.0123456789ab.part").write_bytes(b"half")
    discard_unfinished()
    os._exit(0)
    yield

build.dask_client = killed
for scheduler in (None, "another"):
    if not os.fork():
        build.build_dataset(folder / "set.toml", folder / (scheduler or "own"), scheduler=scheduler)
    assert os.wait()[1] == 0
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
    left = [path.relative_to(tmp_path).as_posix() for path in tmp_path.glob("*/.*.part")]
    assert left == ["another/.0123.npz.0123456789ab.part"]


def test_a_plan_estimates_what_it_does_not_make(
    here: None, tmp_path: Path, tiny: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = TINY.replace("count = 2", "count = 7")
    tiny.write_text(text.replace('["analytic"]', '["analytic", "specular"]'))

    def timed(recipe: SamplePlan) -> Made:
        points = np.zeros((10, 3))
        seconds = 1.0 if recipe.parameters["fidelity"] == "analytic" else 5.0
        return Made(Sample(points, recipe.label, {}), points, seconds)

    monkeypatch.setattr(building, "make_sample", timed)
    report = build_dataset(tmp_path / "set.toml", tmp_path / "out", plan_only=True)
    assert [report[key] for key in ("samples", "made", "missing")] == [14, 4, 10]  # two of each
    assert report["estimated_s"] == pytest.approx(5 * 1.0 + 5 * 5.0)
    assert report["estimated_bytes"] == pytest.approx(10 * report["bytes"] / 4)


def test_samples_that_cannot_be_made_are_told_in_one_line(
    here: None, tmp_path: Path, tiny: Path
) -> None:
    tiny.write_text(TINY + "[drawn]\noffset_x_m = [-4.0, -4.0]\noffset_y_m = [1.0, 1.0]")
    says = r"2 of 2 samples cannot be made, the other 0 are there; .*synthetic:walk"
    with pytest.raises(InputError, match=says):
        build_dataset(tmp_path / "set.toml", tmp_path / "out")


@pytest.mark.slow
def test_a_worker_killed_by_signal_9_loses_nothing(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import the tests
    request.addfinalizer(lambda: cloudpickle.unregister_pickle_by_value(sys.modules[__name__]))
    marked = [
        SamplePlan(recipe.label, {**recipe.parameters, "mark": str(tmp_path / "mark")}, None, None)  # type: ignore[arg-type]
        for recipe in RECIPES
    ]
    killed, undisturbed = tmp_path / "killed", tmp_path / "undisturbed"
    for folder in (killed, undisturbed):
        folder.mkdir()
    environment = dict(os.environ)
    with dask_client(workers=1) as client:
        done = work(client, marked, killed, deadly)
    assert (tmp_path / "mark").exists()
    assert os.environ == environment
    assert {outcome.identity for outcome in done} == {recipe.identity for recipe in marked}
    assert len(done) == len(marked)
    for recipe in marked:
        make_and_store(recipe, str(undisturbed), fake)
    sweep(killed)
    assert contents(killed) == contents(undisturbed)
    write_index(killed, [recipe.identity for recipe in marked])
    assert len(Collection(killed)) == len(marked)


@pytest.mark.skipif(sys.platform == "win32", reason="Dr.Jit keeps kernels elsewhere there")
@pytest.mark.parametrize("home", ["there", "not a folder", None])
def test_workers_have_a_place_for_kernels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: str | None
) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "not a folder").touch()
    monkeypatch.delenv("DRJIT_CACHE_DIR", raising=False)
    if home is None:
        monkeypatch.delenv("HOME")
    else:
        monkeypatch.setenv("HOME", str(tmp_path / home))
    environment: dict[str, str] = {}
    with place_for_kernels(environment):
        assert list(environment) == ([] if home == "there" else ["DRJIT_CACHE_DIR"])
        assert all(Path(place).is_dir() for place in environment.values())
    assert not any(Path(place).exists() for place in environment.values())


def test_no_scheduler_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rtradar.campaign.build._PATIENCE_S", 0.2)
    with (
        pytest.raises(InputError, match=r"--scheduler tcp://127.0.0.1:1: nothing answers there"),
        dask_client(scheduler="tcp://127.0.0.1:1"),
    ):
        pass


def test_a_scheduler_that_is_lost_is_said_in_one_line(tmp_path: Path) -> None:
    address = tmp_path / "scheduler.json"
    command = ["-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    scheduler = subprocess.Popen(
        [sys.executable, *command, "--no-dashboard", "--scheduler-file", str(address)],
        stderr=subprocess.DEVNULL,
    )
    try:
        with Client(scheduler_file=str(address), set_as_default=False) as client:
            # There are no workers: it waits until the scheduler dies.
            threading.Timer(0.2, scheduler.kill).start()
            with pytest.raises(
                CampaignError,
                match=r"the scheduler was lost; 0 of 9 samples were made and are kept",
            ):
                work(client, RECIPES, tmp_path, fake)
    finally:
        scheduler.kill()
        scheduler.wait()


@pytest.mark.slow
def test_a_script_without_a_guard_is_told_so(tmp_path: Path, tiny: Path) -> None:
    """Workers import the script, and would build there once more."""
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\nfrom rtradar.campaign import build_dataset\n"
        f"here = Path({str(tmp_path)!r})\n"
        "build_dataset(here / 'set.toml', here / 'out', workers=1)\n"
    )
    ended = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    said = ended.stderr.splitlines()
    assert ended.returncode == 1
    assert "put what builds it under: if __name__ == '__main__':" in said[-1]
    assert sum(line.startswith("Traceback") for line in said) == 1  # of the script itself


SPEC = """
[windows]
duration_s = 1.0
[[synthetic]]
label = "walk"
count = 12
subjects = 12
"""


def build_words(folder: Path) -> list[str]:
    return ["dataset", "build", str(folder / "set.toml"), "--out", str(folder / "out")]


def test_a_plan_then_the_whole(
    here: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtradar.campaign.build.make_sample", fake)
    (tmp_path / "set.toml").write_text(SPEC)
    words = build_words(tmp_path)
    words += ["--json", str(tmp_path / "told.json")]
    assert main([*words, "--plan"]) == 0
    said = capsys.readouterr().out
    assert "12 samples\n  by label: walk 12\n" in said
    # Eight are shown, by name: 0, 1, 10, 11, 2, 3, 4, 5.
    assert "synthetic-8 1, and 4 more" not in said
    assert "synthetic-5 1, and 4 more" in said
    assert "10 are missing: about 20 s on 1 worker," in said
    told = json.loads((tmp_path / "told.json").read_text())
    assert [told[key] for key in ("samples", "made", "missing", "estimated_s")] == [12, 2, 10, 20]
    assert main(words) == 0
    assert "2 were there, 10 made" in capsys.readouterr().out
    assert len(list((tmp_path / "out").glob("*.npz"))) == 12


PLAN = {"samples": 3, "by": {}, "whole": 1, "damaged": 0, "made": 0, "missing": 2, "workers": 1}


def test_what_was_made_is_said_in_units_that_fit() -> None:
    made = {"damaged": 2, "made": 4, "bytes": 4e9, "work_s": 3.0, "wall_s": 600.0, "workers": 2}
    assert in_words(PLAN | made) == (
        "3 samples\n1 were there, 2 were damaged, "
        "4 made in 10 min by 2 workers (3.0 s and 1.0 GB each)"
    )


@pytest.mark.parametrize(
    ("seconds", "size", "said"),
    [
        (119.4, 999_400.0, "about 119 s on 1 worker, and 1.0 MB"),
        (120.0, 999.9e6, "about 2 min on 1 worker, and 999.9 MB"),
        (7199.0, 1e9, "about 120 min on 1 worker, and 1.0 GB"),
        (7200.0, 15e6, "about 2.0 h on 1 worker, and 15.0 MB"),
    ],
)
def test_units_change_where_two_of_the_next_are_full(
    seconds: float, size: float, said: str
) -> None:
    plan = PLAN
    told = in_words({**plan, "estimated_s": seconds, "estimated_bytes": size})
    assert told == f"3 samples\n1 were there\n2 are missing: {said}"
    assert in_words({**plan, "missing": 0, "estimated_s": 0.0, "estimated_bytes": 0.0}).endswith(
        "\nnone is missing"
    )


@pytest.mark.parametrize(
    ("text", "options", "named"),
    [
        ("colour = 1" + SPEC, [], "colour"),
        (SPEC, ["--workers", "0"], "--workers"),
        (SPEC, ["--workers", "2", "--scheduler", "tcp://host:1"], "--scheduler"),
        (SPEC, ["--json", "/none/told.json"], "--json"),
        (SPEC + '[each]\nradar = ["none.toml"]', [], "none.toml"),
    ],
)
def test_bad_input_gets_one_clear_line_and_leaves_nothing(
    text: str, options: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "set.toml").write_text(text)
    words = build_words(tmp_path)
    assert main([*words, *options]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert named in said.err
    assert not (tmp_path / "out").exists()


def test_several_complaints_are_a_line_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "set.toml").write_text("colour = 1\nsize = 2" + SPEC.replace("walk", "dance"))
    words = build_words(tmp_path)
    assert main(words) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    for line, named in zip(lines, ("'colour'", "'size'", "'dance'"), strict=True):
        assert line.startswith("rtradar: data set file '")
        assert named in line
    assert not (tmp_path / "out").exists()


def test_without_dask_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "set.toml").write_text(SPEC)
    words = build_words(tmp_path)
    monkeypatch.setitem(sys.modules, "dask", None)
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "in a checkout: pip install -e '.[campaign]'" in said
