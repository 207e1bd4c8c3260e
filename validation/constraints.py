"""Write the newest versions of all packages into constraints.txt, as pip would install them today.

Nothing is installed. The oldest Python that rtradar takes should ask, for what has a wheel for it
has one for newer ones, too. CUDA's packages, which torch names beside builds for a CPU, are left
out. The comments of the file stay.

    python3.11 validation/constraints.py        # or: make constraints
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
LEFT_OUT = re.compile("(cuda|nvidia|triton|pip)(-|$)")


def pins(installed: list[dict[str, dict[str, str]]]) -> list[str]:
    """Lines of a file of constraints, for the packages of a report of pip."""
    found = {
        re.sub("[-_.]+", "-", one["metadata"]["name"]).lower(): one["metadata"]["version"]
        for one in installed
        if not one["is_direct"]
    }
    return [
        f"{name}=={version.partition('+')[0]}"
        for name, version in sorted(found.items())
        if not LEFT_OUT.match(name)
    ]


def main() -> int:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    everything = f"{ROOT}[{','.join(project['optional-dependencies'])}]"
    command = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed"]
    command += ["--quiet", "--report", "-", everything]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    file = ROOT / "constraints.txt"
    comments = [line for line in file.read_text(encoding="utf-8").splitlines() if line[:1] == "#"]
    lines = [*comments, *pins(json.loads(done.stdout)["install"])]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
