"""What a build or a plan gave, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_MOST_SHOWN = 8


def in_words(report: Mapping[str, Any]) -> str:
    """A few lines for people of what `rtradar.campaign.build_dataset` reports.

    Parameters
    ----------
    report : mapping
        What `rtradar.campaign.build_dataset` returned.

    Returns
    -------
    str
    """
    lines = [f"{report['samples']} samples"]
    for key, counted in report["by"].items():
        shown = [f"{name} {count}" for name, count in list(counted.items())[:_MOST_SHOWN]]
        more = [f"and {len(counted) - _MOST_SHOWN} more"] if len(counted) > _MOST_SHOWN else []
        lines.append(f"  by {key}: {', '.join(shown + more)}")
    workers = f"{report['workers']} worker{'' if report['workers'] == 1 else 's'}"
    damaged = f", {report['damaged']} were damaged" if report["damaged"] else ""
    there = f"{report['whole']} were there{damaged}"
    if report["made"]:
        there += (
            f", {report['made']} made in {_time(report['wall_s'])} by {workers} "
            f"({report['work_s']:.1f} s and {_size(report['bytes'] / report['made'])} each)"
        )
    lines.append(there)
    if "estimated_s" in report:
        lines.append(
            f"{report['missing']} are missing: about {_time(report['estimated_s'])} on {workers}, "
            f"and {_size(report['estimated_bytes'])}"
            if report["missing"]
            else "none is missing"
        )
    return "\n".join(lines)


def _time(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def _size(size: float) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
