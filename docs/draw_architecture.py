"""Draw the flow of data through the packages of rtradar, from the code alone.

    python docs/draw_architecture.py [--out docs/architecture.svg]

Rows are in the order of the import-linter contract in pyproject.toml; data flow against the
imports, which grimp finds, so downward. An arc means that a package takes from another; those that
follow from others are left out, or nothing could be seen. What is written under "hands on" are the
classes that other packages import from there.
"""

from __future__ import annotations

import argparse
import ast
import tomllib
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import escape

import grimp
import networkx as nx

ROOT = Path(__file__).parents[1]
GROUND = {"conventions", "errors", "kernels", "system", "__main__"}
"""What everybody uses, and what nobody does: not drawn."""

_ROW, _TOP, _LEFT, _WIDTH = 30, 48, 250, 1180
_COLOURS = ("#4477aa", "#ee6677", "#228833", "#aa8800", "#0099bb", "#aa3377")


def order() -> list[str]:
    """Packages from the source of the data to its end."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "importlinter"
    ]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    names = [name.strip() for layer in reversed(layers) for name in layer.split("|")]
    return [name for name in names if name not in GROUND]


def flows() -> nx.DiGraph:
    """Who takes from whom: against the imports."""
    imports = grimp.build_graph("rtradar", cache_dir=None)
    graph: nx.DiGraph = nx.DiGraph()
    graph.add_nodes_from(order())
    for importer in sorted(imports.modules):
        for imported in imports.find_modules_directly_imported_by(importer):
            taker, giver = package(importer), package(imported)
            if taker != giver and {taker, giver} <= set(order()):
                graph.add_edge(giver, taker)
    return graph


def classes_handed_on() -> dict[str, set[str]]:
    """Names with a capital, though not of capitals alone, that other packages import from each."""
    found: dict[str, set[str]] = {name: set() for name in order()}
    for path in (ROOT / "rtradar").rglob("*.py"):
        taker = path.relative_to(ROOT / "rtradar").parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            giver = package(node.module or "") if isinstance(node, ast.ImportFrom) else ""
            if giver in found and giver != taker and taker not in ("__init__", *GROUND):
                names = (
                    {alias.name for alias in node.names}
                    if isinstance(node, ast.ImportFrom)
                    else set()
                )
                found[giver] |= {name for name in names if name[0].isupper() and not name.isupper()}
    return found


def package(module: str) -> str:
    """The package or module right under rtradar that this one belongs to."""
    return ".".join(module.split(".")[1:2])


def summary(name: str) -> str:
    """First line of what a package says about itself."""
    folder = ROOT / "rtradar" / name
    source = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    text = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or ""
    return text.splitlines()[0].replace("`", "")


def drawing() -> str:
    """The picture as SVG."""
    shown, handed = nx.transitive_reduction(flows()), classes_handed_on()
    rows = {name: _TOP + _ROW * place for place, name in enumerate(order())}
    height = _TOP + _ROW * len(rows)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        'font-family="sans-serif" font-size="12">',
        f'<rect width="{_WIDTH}" height="{height}" fill="white"/>',
        f'<text x="{_LEFT}" y="22" font-weight="bold">package</text>',
        f'<text x="{_LEFT + 140}" y="22" font-weight="bold">what it is; hands on</text>',
        *arcs(sorted(shown.edges, key=lambda edge: (rows[edge[0]], rows[edge[1]])), rows),
    ]
    for name, y in rows.items():
        gives = ", ".join(sorted(handed[name]))
        lines += [
            f'<rect x="{_LEFT - 6}" y="{y - 11}" width="130" height="22" rx="4" '
            'fill="#eef3f8" stroke="#556"/>',
            f'<text x="{_LEFT}" y="{y + 4}">{escape(name)}</text>',
            f'<text x="{_LEFT + 140}" y="{y - 1}" font-size="10">{escape(summary(name))}</text>',
            f'<text x="{_LEFT + 140}" y="{y + 11}" font-size="10" fill="#225522" '
            f'font-style="italic">{escape(gives)}</text>',
        ]
    return "\n".join([*lines, "</svg>", ""])


def arcs(edges: Iterable[tuple[str, str]], rows: dict[str, int]) -> list[str]:
    """Each flow as an arc at the left of the rows, the wider the farther it goes."""
    found = []
    for place, (giver, taker) in enumerate(edges):
        start, end, x = rows[giver] + 5, rows[taker] - 5, _LEFT - 6
        reach, colour = x - 14 - (end - start) * 0.42, _COLOURS[place % len(_COLOURS)]
        found += [
            f'<path d="M{x} {start} C{reach:.0f} {start} {reach:.0f} {end} {x - 6} {end}" '
            f'fill="none" stroke="{colour}"/>',
            f'<path d="M{x} {end} l-8 -4 v8 z" fill="{colour}"/>',
        ]
    return found


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "architecture.svg")
    options = parser.parse_args()
    options.out.write_text(drawing(), encoding="utf-8")
    print(options.out)


if __name__ == "__main__":
    main()
