"""What was measured as tables for people, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from rtradar.bench.plan import CHEAPEST
from rtradar.bench.times import FILES, OTHER_PRODUCTS

Row = dict[str, Any]


def tables(found: dict[str, Any]) -> str:
    """All tables of what `rtradar.bench.bench` found."""
    return "\n\n".join(_blocks(found))


def _blocks(found: dict[str, Any]) -> Iterator[str]:
    models = found["models"]
    left_out = ", ".join((*OTHER_PRODUCTS, *FILES))
    yield (
        f"{found['settings']['motion']}, {found['machine']['cores']} cores, each run a process of its own, medians of "
        f"{found['settings']['repeats']} after warm-up. To the cloud: all stages but {left_out}. The paper's method goes to "
        "detections; IF: its echoes and IF over ours."
    )
    if models:
        yield _rates(found["rates"])
        yield _models(models)
        if found["paper"]["trouble"]:
            yield f"the paper's method was not timed: {found['paper']['trouble']}"
        else:
            yield _paper(found["paper"]["radars"])
        for radar in dict.fromkeys(row["radar"] for row in models):
            yield _stages(
                radar, [row for row in models if row["radar"] == radar and row["cores"] == "all"]
            )
    growth = found["growth"]
    if growth["chirps"]:
        lines = [
            [
                f"{row['radar']} / {row['of_radar']}",
                f"`{row['fidelity']}`",
                *map(_plain, _values(row)),
            ]
            for row in growth["chirps"]
        ]
        yield table(["radars", "model", "chirps", "to the cloud", "peak memory"], lines)
    if growth["duration"]:
        first = growth["duration"][0]
        lines = [
            [
                f"{row['duration_s']:g} s",
                f"{row['to_cloud_s']['median']:.2f} s",
                f"{row['whole_s']['median']:.2f} s",
                f"{_a_second(row) / _a_second(first):.3f}",
                f"{row['peak_memory_mb']:.0f} MB",
            ]
            for row in growth["duration"]
        ]
        head = [
            f"recording, `{growth['fidelity']}`",
            "to the cloud",
            "whole run",
            "to the cloud a second, over the first",
            "peak memory",
        ]
        yield table(head, lines)
    if growth["channels"]:
        lines = [
            [
                str(row["channels"]),
                f"{row['to_cloud_s']['median']:.2f} s",
                f"{row['peak_memory_mb']:.0f} MB",
            ]
            for row in growth["channels"]
        ]
        yield table([f"channels, `{growth['fidelity']}`", "to the cloud", "peak memory"], lines)
    if growth["echoes"]:
        lines = [
            [str(row["echoes"]), f"{1e9 * row['signal_s'] / row['samples']:.2f} ns"]
            for row in growth["echoes"]
        ]
        yield table(["echoes of a chirp and receiver", "IF alone, a sample"], lines)
    if found["kernels"]:
        lines = [
            [
                f"`{row['name']}`",
                row["does"],
                f"{1e3 * row['kernel_s']:.3g} ms",
                f"{1e3 * row['reference_s']:.3g} ms",
                f"{row['ratio']:.3g}",
                f"{row['difference']:.1g}",
            ]
            for row in found["kernels"]
        ]
        yield table(["kernel", "computes", "takes", "its reference", "ratio", "differs by"], lines)


def _rates(rates: dict[str, Any]) -> str:
    own = next(iter(rates.values()))
    return (
        f"A second here: {own['copied_bytes'] / 1e9:.1f} GB read and written, {own['random_words'] / 1e6:.0f} million "
        f"random words, {own['multiply_adds'] / 1e9:.0f} thousand million multiply-adds."
    )


def _models(models: Sequence[Row]) -> str:
    head = [
        "radar",
        "model",
        "to the cloud: best",
        "median",
        "whole run",
        "first use adds",
        "peak memory",
    ]
    head += [f"over `{CHEAPEST}`", "paper's method over it"]
    lines = [
        [
            row["radar"],
            f"`{row['fidelity']}`" + (", one core" if row["cores"] == "one" else ""),
            f"{row['to_cloud_s']['best']:.2f} s",
            f"{row['to_cloud_s']['median']:.2f} s",
            f"{row['whole_s']['median']:.2f} s",
            "-" if row["first_use"] is None else f"{row['first_use']['adds_s']:.1f} s",
            f"{row['peak_memory_mb']:.0f} MB",
            _or_dash(row[f"over_{CHEAPEST}"], "{:.2f}"),
            "-"
            if row["paper_over"] is None
            else f"{row['paper_over']['to_cloud']:.3g} (IF {row['paper_over']['if']:.3g})",
        ]
        for row in models
    ]
    return table(head, lines)


def _paper(radars: dict[str, Any]) -> str:
    names = dict.fromkeys(name for baseline in radars.values() for name in baseline["stages"])
    lines = [
        [
            radar,
            *(f"{baseline['stages'][name]['median']:.3f} s" for name in names),
            f"{baseline['total']['median']:.2f} s",
        ]
        for radar, baseline in radars.items()
    ]
    return table(["the paper's method in NumPy, one thread, a frame", *names, "all"], lines)


def _stages(radar: str, models: Sequence[Row]) -> str:
    """Medians of every stage, the floor, and how many times it they are in brackets."""
    names = dict.fromkeys(name for row in models for name in row["stages"])
    lines = []
    for name in names:
        group = " (not to the cloud)" if name in (*OTHER_PRODUCTS, *FILES) else ""
        own = [row["stages"].get(name) for row in models]
        known = [stage for stage in own if stage is not None]
        rule = known[0]["rule"]
        floor = _or_dash(known[0]["floor"], "{:.3f} s")
        lines.append([f"{name}{group}", *map(_stage, own), floor, rule])
    # The floors of all stages to the cloud, as if nothing else took time.
    sums = [
        sum(
            stage["floor"] or 0.0
            for name, stage in row["stages"].items()
            if name not in (*OTHER_PRODUCTS, *FILES)
        )
        for row in models
    ]
    whole = [
        f"{row['to_cloud_s']['median']:.3f} s ({_times(row['to_cloud_s']['median'], least)})"
        for row, least in zip(models, sums, strict=True)
    ]
    lines.append(["all to the cloud", *whole, f"{sums[0]:.3f} s", "sum of the floors"])
    return table(
        [f"{radar}: stage", *(f"`{row['fidelity']}`" for row in models), "floor", "floor's work"],
        lines,
    )


def _stage(stage: Row | None) -> str:
    if stage is None:
        return "-"
    return f"{stage['median']:.3f} s" + (
        f" ({_times(stage['median'], stage['floor'])})" if stage["floor"] else ""
    )


def _times(seconds: float, floor: float) -> str:
    return f"{seconds / floor:.3g}x" if floor > 0 else "-"


def _values(row: Row) -> list[float]:
    return [row["chirps"], row["to_cloud"], row["peak_memory"]]


def _plain(value: float) -> str:
    return f"{value:.2f}"


def _a_second(row: Row) -> float:
    return float(row["to_cloud_s"]["median"] / row["capture_s"])


def _or_dash(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Cells in aligned columns, as Markdown."""
    widths = [max(len(line[column]) for line in (head, *lines)) for column in range(len(head))]

    def row(cells: Sequence[str]) -> str:
        return (
            "| "
            + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
            + " |"
        )

    return "\n".join(
        [row(head), "|" + "|".join("-" * (width + 2) for width in widths) + "|", *map(row, lines)]
    )
