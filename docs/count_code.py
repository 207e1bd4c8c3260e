"""How much code there is: lines by package, long modules, near-copies, and what it depends on.

    python docs/count_code.py [FOLDER]

FOLDER is a checkout, this one if left out; another commit is counted in a `git worktree` of it.
Lines are those that hold code, not blank, comment or docstring. Near-copies are pylint's, of eight
lines or more, where pylint is installed.
"""

from __future__ import annotations

import ast
import importlib.util
import io
import re
import subprocess
import sys
import tokenize
import tomllib
from collections import Counter
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path
from typing import cast

LONG = 250
_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def code_lines(source: str) -> int:
    """Lines with code on them."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", None)
        for text in body if isinstance(body, list) else []:
            if (
                isinstance(text, ast.Expr)
                and isinstance(text.value, ast.Constant)
                and isinstance(text.value.value, str)
            ):
                lines.difference_update(range(text.lineno, (text.end_lineno or text.lineno) + 1))
    return len(lines)


def dependencies(project: dict[str, object]) -> tuple[int, int]:
    """Packages that a user needs, and all that these bring into this environment."""
    needed = cast("list[str]", project["dependencies"])
    named = {re.split(r"[^\w.-]", line)[0].lower() for line in needed}
    found: set[str] = set()
    waiting = set(named)
    while waiting:
        name = waiting.pop()
        found.add(name)
        try:
            lines = requires(name) or []
        except PackageNotFoundError:
            continue
        plain = {
            re.split(r"[^\w.-]", line)[0].lower().replace("_", "-")
            for line in lines
            if "extra ==" not in line
        }
        waiting |= plain - found
    return len(named), len(found)


def near_copies(folder: Path) -> str:
    """How many, as pylint sees it."""
    if importlib.util.find_spec("pylint") is None:
        return "not counted, for pylint is not installed"
    words = [
        "--disable=all",
        "--enable=duplicate-code",
        "--min-similarity-lines=8",
        "--ignore-imports=yes",
        "--ignore-signatures=yes",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pylint", *words, "rtradar"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    return str(done.stdout.count("R0801"))


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1]
    by_package: Counter[str] = Counter()
    long = []
    for path in sorted((folder / "rtradar").rglob("*.py")):
        parts = path.relative_to(folder / "rtradar").parts
        source = path.read_text(encoding="utf-8")
        by_package[parts[0] if len(parts) > 1 else "(top)"] += code_lines(source)
        if (number := source.count("\n")) > LONG:
            long.append(f"{'/'.join(parts)} {number}")
    for name, number in sorted(by_package.items()):
        print(f"{name:<12}{number:>7}")
    print(f"{'rtradar':<12}{by_package.total():>7} lines of code")
    for name in ("tests", "validation", "docs"):
        number = sum(
            code_lines(path.read_text(encoding="utf-8")) for path in (folder / name).rglob("*.py")
        )
        print(f"{name:<12}{number:>7}")
    named, everything = dependencies(
        tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    )
    print(f"dependencies: {named} named, {everything} with what they bring")
    print(f"near-copies of 8 lines or more in rtradar: {near_copies(folder)}")
    print(f"modules of more than {LONG} lines: {', '.join(long)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
