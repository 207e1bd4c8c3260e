"""Megabytes of each package that an installation brings, and what is the first to import it.

Sizes are those of the files that pip has listed, compiled modules included. Imports are those of
one process that does what `STEPS` says, in that order.

    python validation/cost/installed.py [--json FILE]

It is the environment of that Python which is measured; `validation/wheel.sh` makes an empty one.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from importlib.metadata import Distribution, distributions, packages_distributions

STEPS = {
    "`import rtradar`": "import rtradar as rt; rt.Radar, rt.Scene",
    "an `analytic` run in memory": "rt.run(*given, fidelity='analytic', **short)",
    "tracing": "rt.run(*given, **short)",
    "files and page": "rt.run(*given, out='run', **short)",
    "pictures": "rt.run(*given, out='drawn', pictures=True, **short)",
    "rooms": "rt.run(*given, 'living-room', **short)",
    "IF samples in a file": "rt.run(*given, out='if', save_if=True, **short)",
}
"""What a user does, and the Python of it."""

CHILD = """
import json, sys, warnings
warnings.simplefilter("ignore")
given, short, before = ("synthetic:walk", "paper-12ghz"), {"duration_s": 0.1}, set(sys.modules)
for step, code in json.loads(sys.argv[1]).items():
    exec(code)
    new = {name.partition(".")[0] for name in set(sys.modules) - before}
    print(json.dumps([step, sorted(new)]))
    before = set(sys.modules)
"""


def megabytes(package: Distribution) -> float:
    """Size of the files of a package [MB]; what links lead to is counted once."""
    paths = {os.path.realpath(str(package.locate_file(file))) for file in package.files or ()}
    return sum(os.path.getsize(path) for path in paths if os.path.isfile(path)) / 1e6


def importers() -> dict[str, str]:
    """The first step that imports each package, by its name; others are not in it."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", CHILD, json.dumps(STEPS)]
        done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    owners, found = packages_distributions(), {}
    for line in done.stdout.splitlines():
        if line.startswith("["):
            step, modules = json.loads(line)
            for package in (name for module in modules for name in owners.get(module, ())):
                found.setdefault(package.lower(), step)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="also write the figures there")
    file = parser.parse_args().json
    first = importers()
    rows = [
        {"package": name, "mb": round(megabytes(one), 1), "first": first.get(name.lower(), "")}
        for one in distributions()
        if (name := one.metadata["Name"]) not in ("pip", "setuptools")
    ]
    rows.sort(key=lambda row: -row["mb"])
    for row in rows:
        print("{mb:8.1f} MB  {package:24} {first}".format(**row))
    print(f"{sum(row['mb'] for row in rows):8.1f} MB  all")
    if file:
        with open(file, "w", encoding="utf-8") as output:
            json.dump({"installed": rows}, output, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
