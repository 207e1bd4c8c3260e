"""Write a page for each public package, from its ``__all__``."""

from __future__ import annotations

import ast
import inspect
from dataclasses import is_dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from types import ModuleType

PACKAGES = {
    "rtradar": "What most need",
    "rtradar.motion": "Motion",
    "rtradar.radar": "Radars",
    "rtradar.scene": "Scenes",
    "rtradar.pipeline": "Runs",
    "rtradar.clouds": "Point clouds",
    "rtradar.report": "Pictures and pages",
    "rtradar.exchange": "For other tools, and back",
    "rtradar.campaign": "Data sets",
    "rtradar.classify": "Classifiers",
    "rtradar.body": "Bodies",
    "rtradar.scatter": "Echo models",
    "rtradar.signal": "Signals",
    "rtradar.process": "Processing",
    "rtradar.rcs": "Closed forms",
    "rtradar.full_wave": "Full wave",
    "rtradar.paper": "The paper",
}
"""Packages with a page, and their titles, in the order of use."""

FIRST_PAGE = {
    "Motion": ("load_motion", "synthetic_motion", "Motion"),
    "Radar": ("Radar", "Antenna", "Receiver", "Interferer", "Chip"),
    "Scene": ("Scene", "Person", "Object", "Turning", "Swinging", "FollowingPath"),
    "Run": ("run", "simulate", "process_samples", "compare", "RunSettings", "Breathing"),
    "Results": ("Result", "Simulation", "Comparison"),
    "Pieces of a run": ("Body", "HumanMesh", "Ellipsoids", "Echoes", "scattering_length"),
    "Extensions": ("register_reader", "register_radar", "register_model", "register_detector"),
    "Errors and warnings": ("InputError", "BackendError", "ExtensionError", "ValidityWarning"),
}
"""Sections of the page of ``rtradar``; a name that none of them has comes at the end."""


def public(package: str) -> dict[str, object]:
    """Everything public of a package but its modules, by name."""
    module = import_module(package)
    found = {name: getattr(module, name) for name in module.__all__}
    return {name: thing for name, thing in found.items() if not isinstance(thing, ModuleType)}


def text_of(module: str, name: str) -> str:
    """Text below a constant in the module that sets it, however often it is imported from there."""
    tree = ast.parse(inspect.getsource(import_module(module)))
    for node, after in pairwise([*tree.body, ast.Pass()]):
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = {getattr(leaf, "id", "") for target in targets for leaf in ast.walk(target)}
            text = after.value if isinstance(after, ast.Expr) else None
            if name in names and isinstance(text, ast.Constant) and isinstance(text.value, str):
                return inspect.cleandoc(text.value)
    for source in ast.walk(tree):
        if isinstance(source, ast.ImportFrom) and source.module:
            for one in source.names:
                if (one.asname or one.name) == name:
                    return text_of(source.module, one.name)
    return ""


def page(package: str) -> str:
    """The page of a package; what is on the first page is not repeated."""
    first = {id(thing) for thing in public("rtradar").values()} if package != "rtradar" else set()
    heading = f"{PACKAGES[package]}: {package}"
    lines = [heading, "=" * len(heading), "", f".. automodule:: {package}", "   :no-members:", ""]
    if again := [name for name, thing in public(package).items() if id(thing) in first]:
        lines += [
            "Also here: " + ", ".join(f":py:obj:`rtradar.{name}`" for name in again) + ".",
            "",
        ]
    things = public(package)
    sections = FIRST_PAGE if package == "rtradar" else {}
    place = {name: title for title, names in sections.items() for name in names}
    order = [name for name in place if name in things]
    title = ""
    for name in [*order, *(name for name in things if name not in place)]:
        thing = things[name]
        if id(thing) in first:
            continue
        if sections and place.get(name, "Others") != title:
            title = place.get(name, "Others")
            lines += [title, "-" * len(title), ""]
        kind = (
            "class"
            if inspect.isclass(thing)
            else "function"
            if inspect.isroutine(thing)
            else "data"
        )
        if kind == "data":
            # Sphinx would show what Python says of the type, such as int or tuple.
            lines += [f".. py:data:: {package}.{name}", ""]
            lines += [f"   {line}".rstrip() for line in text_of(package, name).splitlines()]
        else:
            lines.append(f".. auto{kind}:: {package}.{name}")
        if kind == "class":
            lines.append("   :members:")
            if any(is_dataclass(base) for base in getattr(thing, "__bases__", ())):
                lines.append("   :inherited-members:")
        lines.append("")
    return "\n".join(lines)


def write(folder: Path) -> None:
    """Write all pages and their list. A page that has not changed keeps its date."""
    names = [package.replace(".", "_") for package in PACKAGES]
    title = "Python interface"
    pages = dict(zip(names, map(page, PACKAGES), strict=True))
    pages["index"] = "\n".join(
        [
            title,
            "=" * len(title),
            "",
            ".. toctree::",
            "   :maxdepth: 1",
            "",
            *(f"   {n}" for n in names),
            "",
        ]
    )
    folder.mkdir(exist_ok=True)
    for name, text in pages.items():
        path = folder / f"{name}.rst"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
