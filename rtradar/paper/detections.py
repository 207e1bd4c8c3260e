"""CFAR on one channel and on all: the paper's pictures 6 and 7, and its table 3."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import ValidityWarning
from rtradar.paper.sources import Sources
from rtradar.pipeline import simulate
from rtradar.process import ca_cfar, os_cfar, power_map, range_spectrum
from rtradar.radar import Radar
from rtradar.report.canvas import VELOCITY_LABEL, add_colour_bar, draw_levels
from rtradar.system.figure_style import LIGHT, dress, new_figure, save_figure
from rtradar.validate import choose, claims, run_claim, validation_folder

_SCHEMES = ("SISO-CA", "SISO-OS", "MIMO-CA", "MIMO-OS")
_RULES = {"true": "noise-free map", "rule": "paper's rule", "coded": "paper as coded"}


def detection_figures(sources: Sources) -> dict[str, Any]:
    """Detect a jumping jack on one channel and on all, and score the detectors by `table3.py`.

    Parameters
    ----------
    sources : Sources
        Who moves, and the folder of the pictures.

    Returns
    -------
    dict
        Figures by their names.
    """
    radar = Radar.preset("paper-12ghz")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        duration_s = radar.frame_duration_s + radar.cycle_duration_s
        capture = simulate(sources.motion("jumping_jack"), radar, duration_s=duration_s)
        samples = capture.samples.values[: radar.chirps_per_frame]
    shape = -1, radar.n_tx, radar.n_rx, radar.samples_per_chirp
    cube = range_spectrum(samples, radar).reshape(shape)
    found: dict[str, Any] = {}
    for name, kind, looks in (("figure-6", "one", 1), ("figure-7", "all", radar.n_channels)):
        power = power_map(cube, radar, channel=0) if looks == 1 else power_map(cube, radar)
        masks = {"CA": ca_cfar(power, looks=looks), "OS": os_cfar(power, looks=looks)}
        found |= {f"ca_{kind}": int(masks["CA"].sum()), f"os_{kind}": int(masks["OS"].sum())}
        _draw(sources, name, power, masks, radar)
    return found | _table3(quick=sources.quick)


def _draw(
    sources: Sources,
    name: str,
    power: NDArray[np.floating[Any]],
    masks: dict[str, NDArray[np.bool_]],
    radar: Radar,
) -> None:
    """Draw a map once for each detector, with its detections."""
    figure = new_figure(4.0, width_in=9.0)
    panels = figure.subplots(1, 2, sharey=True)
    level = 10 * np.log10(power / power.max())
    velocity = radar.velocity_mps(radar.cycles_per_frame)
    for axes, (law, mask) in zip(panels, masks.items(), strict=True):
        image = draw_levels(axes, level, velocity, radar.range_m)
        rows, columns = np.nonzero(mask)
        colour = LIGHT.detection
        axes.scatter(velocity[columns], radar.range_m[rows], s=5, color=colour)
        axes.set(xlabel=VELOCITY_LABEL, ylabel="Range [m]", ylim=(2.5, 6.0))
        dress(axes, title=f"{law}-CFAR, {len(rows)} detections", grid=False)
    add_colour_bar(image, list(panels), "Power [dB re maximum]")
    save_figure(figure, sources.out / f"{name}.png")


def _table3(*, quick: bool) -> dict[str, Any]:
    """Run the script of table 3; precision and missing rate by rule of truth, in words."""
    ((claim, _),) = choose(claims(validation_folder()), "table3")
    outcome = run_claim(claim, quick=quick)
    if outcome.trouble:
        raise RuntimeError(f"{claim.script.name} {outcome.trouble}")
    together = "one of four" if quick else "all four"
    rows = {(row.claim, row.quantity): row.ours for row in outcome.rows}
    found: dict[str, Any] = {"table3_frames": together}
    for key, rule in _RULES.items():
        cells = []
        for scheme in _SCHEMES:
            where = f"{together}, {rule}"
            missed = rows[where, f"{scheme} missing rate"]
            # Where nothing is detected there is no precision.
            right = rows.get((where, f"{scheme} precision"))
            cells.append(f"{scheme} {'-' if right is None else f'{right:.1f}'} / {missed:.1f}")
        found[f"table3_{key}"] = "; ".join(cells)
    return found
