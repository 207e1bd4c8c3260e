"""Runs that are repeated from the file that says what was simulated."""

from __future__ import annotations

import dataclasses
import inspect
import json
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import tomli_w
import trimesh

import rtradar as rt
from rtradar.cli import main
from rtradar.description import settings_of_table, table_of, with_value
from rtradar.description.run_file import plain
from rtradar.scene import Furniture, Scene, material
from rtradar.settings import RunSettings
from rtradar.system.registries import RADARS, scene_files

RADAR = rt.Radar(
    name="small", tx_y=2, tx_z=0, rx_y=4, rx_z=0, samples_per_chirp=256, frame_duration_s=0.05
)
QUICK: dict[str, Any] = {"fidelity": "analytic", "duration_s": 0.1}
SETTINGS = RunSettings()


def bits(folder: Path) -> dict[str, bytes]:
    """Every array of the maps and clouds of a folder."""
    found: dict[str, bytes] = {}
    with h5py.File(folder / "maps.h5") as maps:

        def keep(name: str, own: object) -> None:
            if isinstance(own, h5py.Dataset):
                values = own[()]
                text = values.dtype.kind == "O"
                found[name] = repr(values.tolist()).encode() if text else values.tobytes()

        maps.visititems(keep)
    for name in ("cloud_rdt.npz", "cloud_xyz.npz"):
        with np.load(folder / name) as cloud:
            found |= {f"{name} {key}": cloud[key].tobytes() for key in cloud.files}
    return found


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with joints of a walk, and a run of them."""
    folder = tmp_path_factory.mktemp("recording")
    walk = rt.synthetic_motion("walk", seed=1, duration_s=0.6)
    positions = walk.at(np.arange(72) / 120)[0]
    np.savez(
        folder / "walk.npz",
        positions=positions,
        joints=walk.joints,
        rate_hz=120.0,
        up="z",
        unit_m=1.0,
    )
    return folder


# -- runs again ------------------------------------------------------------------------------------


def test_a_run_of_the_command_line_is_repeated_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "small.toml").write_text("tx_y = 2\nrx_y = 4\nsamples_per_chirp = 128\n")
    monkeypatch.chdir(tmp_path)
    given = ["synthetic:kick,side=right", "--radar", "small.toml", "--pitch", "-5", "--seed", "3"]
    quick = ["--duration", "0.15", "--fidelity", "analytic", "--quiet"]
    assert main(["run", *given, *quick, "--snr-db", "12", "--out", "first"]) == 0
    (tmp_path / "small.toml").unlink()
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "there")
    again = ["run", "../first/run.toml", "--quiet", "--out", "../second"]
    assert main(again) == 0
    assert bits(tmp_path / "first") == bits(tmp_path / "second")
    first, second = (
        tomllib.loads((tmp_path / name / "run.toml").read_text()) for name in ("first", "second")
    )
    assert first == second
    assert first["settings"]["snr_db"] == 12.0
    assert first["radar"]["pitch_deg"] == -5.0


def test_what_no_file_holds_is_kept_beside_the_run(tmp_path: Path) -> None:
    motion = rt.synthetic_motion("walk", seed=2, duration_s=0.4).scaled(0.9)
    fan = rt.Object(
        "plate", "trihedral", "metal", position_m=(1, 1, 1), motion=rt.Turning(rate_hz=5)
    )
    person = rt.Person(motion, (0.2, 0.1), breathing=rt.Breathing(3, 0.3))
    first = rt.run([person, fan], RADAR, out=tmp_path / "first", snr_db=np.inf, **QUICK)
    assert (tmp_path / "first" / "person-1.motion").is_file()
    again = rt.Experiment.load(tmp_path / "first" / "run.toml")
    again.run(tmp_path / "second")
    assert bits(tmp_path / "first") == bits(tmp_path / "second")
    # Neither run in its own folder is refused, nor loses what it needs.
    rt.run([person, fan], RADAR, out=tmp_path / "first", snr_db=np.inf, **QUICK)
    rt.Experiment.load(tmp_path / "second" / "run.toml").run(tmp_path / "second")
    for name in ("first", "second"):
        assert (tmp_path / name / "person-1.motion").is_file()
    assert bits(tmp_path / "first") == bits(tmp_path / "second")
    with pytest.raises(rt.InputError, match="holds a run of"):
        rt.run("synthetic:walk", RADAR, out=tmp_path / "first", **QUICK)
    assert first.summary["run"]["settings"]["snr_db"] == "inf"
    assert first.experiment is not None
    np.testing.assert_array_equal(first.experiment.run().points, first.points)


def test_a_file_that_has_changed_is_refused_in_one_line(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = recording / "walk.npz"
    rt.run(rt.load_motion(file), RADAR, out=tmp_path / "run", **QUICK)
    made = tomllib.loads((tmp_path / "run" / "run.toml").read_text())
    assert (tmp_path / "run" / made["people"][0]["motion"]).resolve() == file.resolve()
    whole = file.read_bytes()
    file.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    run_file = str(tmp_path / "run" / "run.toml")
    try:
        assert main(["run", run_file, "--out", str(tmp_path / "other"), "--quiet"]) == 2
        said = capsys.readouterr().err.splitlines()
        assert len(said) == 1
        assert re.search(r"walk\.npz' has changed since; .*--changed", said[0])
        assert not (tmp_path / "other").exists()
        rt.Experiment.load(run_file, changed=True)
    finally:
        file.write_bytes(whole)
    file.rename(recording / "gone.npz")
    with pytest.raises(rt.InputError, match=r"No such file or directory; give the one"):
        rt.Experiment.load(run_file)
    (recording / "gone.npz").rename(file)


def test_flags_and_keys_replace_what_the_run_file_says(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text(
        """
        [[people]]
        motion = "synthetic:walk"
        heading_deg = 10
        [radar]
        base = "iwr6843"
        [scene]
        base = "living-room"
        [settings]
        fidelity = "analytic"
        snr_db = 10
        duration_s = 0.05
        """
    )
    out, chosen = tmp_path / "out", ["radar.pitch_deg=-15", "people.0.heading_deg=90"]
    chosen += ["scene.room.left.material=concrete", "settings.clutter_removal=mean"]
    words = ["run", str(tmp_path / "run.toml"), "--snr-db", "inf", "--order", "0", "--quiet"]
    words += [word for key in chosen for word in ("--set", key)]
    assert main([*words, "--out", str(out)]) == 0
    made = tomllib.loads((out / "run.toml").read_text())
    assert made["radar"]["pitch_deg"] == -15
    assert made["radar"]["name"] == "iwr6843"
    assert made["people"][0]["heading_deg"] == 90
    assert made["settings"]["snr_db"] == np.inf
    assert made["settings"]["clutter_removal"] == "mean"
    room = made["scene"]["room"]
    assert room["left"] == room["walls"] | {"material": "concrete"}


@pytest.mark.slow
def test_the_runs_of_a_comparison_can_be_repeated(recording: Path, tmp_path: Path) -> None:
    levels = ("analytic-paper", "analytic")
    walk, own = recording / "walk.npz", {"duration_s": 0.1}
    rt.compare(walk, RADAR, out=tmp_path / "both", fidelities=levels, **own)  # type: ignore[arg-type]
    for level in levels:
        again = rt.Experiment.load(tmp_path / "both" / level / "run.toml")
        again.run(tmp_path / level)
        assert bits(tmp_path / level) == bits(tmp_path / "both" / level)


# -- tables ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(scene_files()))
def test_a_scene_changed_in_python_has_a_table_too(name: str) -> None:
    scene = rt.Scene.load(name)
    poses = [f"radar_{key}" for key in ("position_m", "yaw_deg", "pitch_deg", "roll_deg")]
    apart: dict[str, Any] = dict.fromkeys(poses) | {"people": ()}  # in tables of their own
    changed = dataclasses.replace(scene, description="changed", **apart)
    assert changed.source is None
    table = table_of((), RADAR, changed, SETTINGS)
    assert "missing" not in table
    assert rt.Scene.of_table(table["scene"]) == changed


@pytest.mark.parametrize("name", RADARS.built_in)
def test_a_radar_has_a_table(name: str) -> None:
    radar = rt.Radar.preset(name)
    assert rt.Radar.load(plain(radar)) == radar


def test_receivers_and_antennas_are_in_the_table() -> None:
    receiver = rt.Receiver(leakage_db=-30.0, iq_gain_db=0.2)
    antenna = rt.Antenna(pattern="cosine", exponent=2.0)
    radar = dataclasses.replace(RADAR, receiver=receiver, tx_antenna=antenna)
    assert rt.Radar.load(plain(radar)) == radar


def test_every_bounce_is_not_the_default_of_bounces() -> None:
    settings = dataclasses.replace(SETTINGS, path_tolerance_db=None)
    made = tomllib.loads(tomli_w.dumps(table_of((), RADAR, rt.Scene(), settings)))
    assert settings_of_table(made["settings"]).path_tolerance_db in (None, -math.inf)


def test_own_materials_and_meshes_of_files_are_in_the_table(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    trimesh.creation.box((0.5, 0.5, 0.5)).export(tmp_path / "below" / "box.ply")
    (tmp_path / "room.toml").write_text(
        """
        [materials.brick-of-mine]
        source = "measured"
        low_hz = 1e9
        high_hz = 100e9
        a = 4.0
        [[furniture]]
        name = "box"
        mesh = "below/box.ply"
        metres_per_unit = 1
        material = "brick-of-mine"
        position_m = [1, 2, 0.25]
        """
    )
    scene = rt.Scene.load(tmp_path / "room.toml")
    for own in (scene, dataclasses.replace(scene, heading_deg=5.0)):
        assert rt.Scene.of_table(table_of((), RADAR, own, SETTINGS)["scene"]) == own


def test_a_mesh_made_in_python_cannot_be_run_again(tmp_path: Path) -> None:
    made, walk = trimesh.creation.box((0.5, 0.5, 0.5)), rt.synthetic_motion("walk", duration_s=0.3)
    box = rt.Object("box", made, "wood", position_m=(1, 1, 1))
    stool = Furniture("stool", made, material("wood"), position_m=(1, 1, 0))
    given: list[Any] = [([walk, box], {}), ([walk], {"scene": Scene(furniture=(stool,))})]
    for name, (people, scene) in zip(("box", "stool"), given, strict=True):
        rt.run(people, RADAR, out=tmp_path / name, **QUICK, **scene)
        with pytest.raises(rt.InputError, match=rf"lacks the mesh of '{name}'"):
            _ = rt.Experiment.load(tmp_path / name / "run.toml").parts


def test_keys_lead_to_tables_and_lists_and_nowhere_else() -> None:
    table = {"people": [{"motion": "synthetic:walk"}], "settings": {"seed": 1}}
    changed = with_value(table, "people.0.body", "mesh")
    assert changed["people"][0] == {"motion": "synthetic:walk", "body": "mesh"}
    assert table["people"][0] == {"motion": "synthetic:walk"}
    assert with_value(table, "scene.room.left.material", "wood")["scene"] == {
        "room": {"left": {"material": "wood"}}
    }
    for key, why in {
        "people.1.body": "no number from 0 to 0",
        "settings.seed.much": "there is no table",
        "room.left": "unknown key 'room'",
    }.items():
        with pytest.raises(rt.InputError, match=why):
            with_value(table, key, 1)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[setings]\nseed = 1", "unknown key 'setings'"),
        ("[settings]\nsnr = 1", "unknown key 'snr'"),
        ("[radar]\nbase = 5", "base = 5; it must be a name or a path"),
        ("[scene]\nbase = 5", "base = 5; it must be a name or a path"),
        ("[[people]]\nmotion = 'nobody.bvh'", "nobody.bvh"),
        (
            "[[people]]\nmotion = 'synthetic:walk'\n"
            "[[people]]\nmotion = 'synthetic:walk'\nbody = 'glass'",
            "number 2 person 'synthetic:walk': body = 'glass'",
        ),
    ],
)
def test_a_wrong_word_is_told(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "run.toml").write_text(text)
    with pytest.raises(rt.InputError, match=why):
        _ = rt.Experiment.load(tmp_path / "run.toml").parts


# -- placement -------------------------------------------------------------------------------------


def test_people_recorded_together_keep_their_places() -> None:
    walk = rt.synthetic_motion("walk", seed=0, duration_s=1.0)
    other = rt.synthetic_motion("stand", seed=1, duration_s=1.0).shifted([0.3, 2.0, 0.0])
    for motion in (walk, other):
        kept = rt.Person(motion, placement="recorded").placed()
        np.testing.assert_array_equal(kept.at([0.5])[0], motion.at([0.5])[0])
    turned = rt.Person(walk, (1.0, 0.0), 90.0, placement="recorded").placed(0.2, 0.5)
    x, y, z = walk.at([0.4])[0][0].T
    np.testing.assert_allclose(turned.at([0.2])[0][0], np.stack([1 - y, x, z], 1), atol=1e-12)
    with pytest.raises(rt.InputError, match="placement = 'here'; allowed: standard, recorded"):
        rt.Person(walk, placement="here")


def test_a_run_file_can_leave_people_to_its_scene(tmp_path: Path) -> None:
    (tmp_path / "room.toml").write_text('[[people]]\nmotion = "synthetic:walk"\n')
    (tmp_path / "run.toml").write_text(
        '[scene]\nbase = "room.toml"\n[settings]\nfidelity = "analytic"\nduration_s = 0.1\n'
    )
    words = ["run", str(tmp_path / "run.toml"), "--quiet"]
    assert main([*words, "--out", str(tmp_path / "one")]) == 0
    several = [f"settings.snr_db={value}" for value in (0, 10)]
    sets = [word for key in several for word in ("--set", key)]
    assert main([*words, *sets, "--out", str(tmp_path / "two")]) == 0
    made = tomllib.loads((tmp_path / "two" / "001-snr_db=0" / "run.toml").read_text())
    assert "synthetic:walk" in json.dumps(made)


# -- names, and other runs -------------------------------------------------------------------------


def test_names_and_paths_are_taken_and_signatures_list_every_setting(recording: Path) -> None:
    options: dict[str, Any] = {"fidelity": "analytic", "duration_s": 0.1}
    named = rt.run(str(recording / "walk.npz"), "paper-12ghz", "free-space", **options)
    made = rt.run(rt.load_motion(recording / "walk.npz"), rt.Radar.preset("paper-12ghz"), **options)
    np.testing.assert_array_equal(named.points, made.points)
    assert rt.simulate("synthetic:walk", "paper-12ghz", **options).duration_s > 0.09
    for function in (rt.run, rt.compare):
        parameters = inspect.signature(function).parameters
        for field in dataclasses.fields(RunSettings):
            assert parameters[field.name].kind is inspect.Parameter.KEYWORD_ONLY
    assert inspect.signature(rt.run).parameters["snr_db"].default == 20.0
    assert "pfa" not in inspect.signature(rt.simulate).parameters
    for wrong in ((5, "paper-12ghz"), ("synthetic:walk", 5), ("synthetic:walk", "paper-12ghz", 5)):
        with pytest.raises(rt.InputError):
            rt.run(*wrong, **options)  # type: ignore[arg-type]


def test_a_run_of_somebody_else_is_not_replaced_unasked(tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = ["--duration", "0.1", "--fidelity", "analytic", "--quiet"]
    assert main(["run", "synthetic:walk", *words, "--out", str(out)]) == 0
    assert main(["run", "synthetic:walk", *words, "--snr-db", "3", "--out", str(out)]) == 0
    before = (out / "maps.h5").read_bytes()
    with pytest.raises(rt.InputError, match=r"holds a run of synthetic:walk.*--overwrite"):
        rt.run("synthetic:kick", "paper-12ghz", out=out, **QUICK)
    assert (out / "maps.h5").read_bytes() == before
    rt.run("synthetic:kick", "paper-12ghz", out=out, overwrite=True, **QUICK)


def test_folders_are_compared_setting_by_setting(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    walk = rt.synthetic_motion("walk", duration_s=0.3)
    for name, pitch_deg in (("level", 0.0), ("tilted", -10.0)):
        radar = dataclasses.replace(RADAR, pitch_deg=pitch_deg)
        rt.run(walk, radar, out=tmp_path / name, **QUICK)
    folders = [str(tmp_path / name) for name in ("level", "tilted")]
    assert main(["compare", *folders, "--out", str(tmp_path / "both")]) == 0
    said = capsys.readouterr().out
    assert "radar.pitch_deg: 0.0 (level), -10.0 (tilted)" in said
    assert said.count("(tilted)") == 1
    assert "Settings that differ" in (tmp_path / "both" / "compare.html").read_text()


# -- sweeps ----------------------------------------------------------------------------------------


def test_several_values_of_a_key_are_a_run_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", "synthetic:walk", "--duration", "0.1", "--fidelity", "analytic"]
    keys = ["settings.snr_db=0", "settings.snr_db=20", "settings.clutter_removal=mean"]
    keys += ["people.0.heading_deg=45"]
    words += [word for key in keys for word in ("--set", key)]
    out = tmp_path / "out"
    assert main([*words, "--out", str(out)]) == 0
    found = json.loads((out / "sweep.json").read_text())
    assert found["keys"] == ["settings.snr_db"]
    folders = [run["folder"] for run in found["runs"]]
    assert folders == ["001-snr_db=0", "002-snr_db=20"]
    for run in found["runs"]:
        assert run["figures"]["snr_db"] == pytest.approx(run["values"][0], abs=0.1)
        made = tomllib.loads((out / run["folder"] / "run.toml").read_text())
        assert made["settings"]["clutter_removal"] == "mean"
        assert made["people"][0]["heading_deg"] == 45
    assert found["runs"][0]["figures"]["cloud_bins"] == 0
    assert found["runs"][1]["figures"]["cloud_bins"] > 0
    assert (out / "sweep.png").is_file()
    assert "settings.snr_db" in capsys.readouterr().out
    assert len((out / "sweep.csv").read_text().splitlines()) == 3


def test_a_sweep_is_refused_before_its_first_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    experiment = rt.Experiment({"people": [{"motion": "synthetic:walk"}]})
    for values, why in (
        ({"radar.pitch_deg": [0, "steep"]}, "pitch_deg"),
        ({"nothing": [1, 2]}, "unknown key 'nothing'"),
        ({}, "allowed are 1 to"),
    ):
        with pytest.raises(rt.InputError, match=why):
            rt.sweep(experiment, values, out=tmp_path / "out")  # type: ignore[arg-type]
    words = ["run", "synthetic:walk", "--fidelity", "analytic", "--model-option", "rays=3"]
    words += ["--set", "settings.snr_db=0", "--set", "settings.snr_db=20"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "has no option 'rays'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
