"""Small faults put into the core one at a time: which of them does no test notice?

A mutant is a copy of the tree with one change: a constant 7 % larger or one more, + for -, * for /,
one comparison for another, a dropped `not`, minus sign or conj, sin for cos, min for max, all for
any, swapped arguments of arctan2, or another axis. Docstrings, messages, annotations, decorators
and assertions are not changed. Mutants are drawn in turn from motion, radar, signal, process,
clouds, scatter and rcs, the same for the same seed; those of a smaller --count are the first of a
larger one.

Each runs against the tests that call the changed function, from the nearest test files and the
fastest first, up to a limit of time, until one fails; recordings are not used. Tests that `make
test` leaves to `make test-all` come last, so that who notices a mutant says whether both do.
Which test calls what is traced once for each test file, on the unchanged copy. Numba's functions
cannot be traced: their tests are those that call any function of their module, or of the modules
that import it. Tests that fail without a change are not used.

Compiled code comes from a cache that the unchanged copy filled. For a mutant whose function Numba
compiles or inlines, the modules that import its module, however indirectly, begin without a cache,
so that no mutant passes with old code.

Survivors are printed with their change. Those that cannot be noticed are listed in
`mutation_equivalent.json`, each with its reason. With --json, finished mutants are not run again.
This is no claim of `rtradar validate`: it takes an hour, and it judges the tests.

    nice python validation/robustness/mutation.py [--count 80] [--only motion/formats] [--json FILE]
"""

from __future__ import annotations

import argparse
import ast
import itertools
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
PACKAGES = ("motion", "radar", "signal", "process", "clouds", "scatter", "rcs")
EQUIVALENT = Path(__file__).with_name("mutation_equivalent.json")

MOST_FILES, MOST_SECONDS = 4, 25.0
"""Test files for one module, nearest first, and the time for a mutant's tests of one file [s]."""

LIMIT_S, COMPILING_S, HANGING_S = 90, 180, 1200
"""A mutant whose tests take more processor time counts as noticed; one that must compile first has
more. Time by the clock is hardly limited, so that what runs beside notices no mutant [s]."""

OPERATORS = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
}
COMPARISONS = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}
OPPOSITE = {ast.Lt: ("<", ">"), ast.Gt: (">", "<"), ast.LtE: ("<=", ">="), ast.GtE: (">=", "<=")}
_PAIRS = (
    ("sin", "cos"),
    ("min", "max"),
    ("minimum", "maximum"),
    ("argmin", "argmax"),
    ("floor", "ceil"),
    ("any", "all"),
)
NAMES = {one: other for pair in _PAIRS for one, other in (pair, pair[::-1])}


@dataclass(frozen=True)
class Mutant:
    """One change: ``text`` in place of what lies between two positions of a file."""

    file: str
    function: str
    line: int
    begin: int
    end: int
    text: str
    old: str
    new: str

    @property
    def change(self) -> str:
        return f"{self.old} -> {self.new}"

    @property
    def key(self) -> str:
        """Name that stays as long as the line does, wherever it moves in its function."""
        return f"{self.file} {self.function}: {self.change}"


class _Finder(ast.NodeVisitor):
    """All mutants of one file."""

    def __init__(self, file: str, source: str) -> None:
        self._file, self._source = file, source
        self._lines = source.split("\n")
        self._begins = [0, *itertools.accumulate(len(line) + 1 for line in self._lines)]
        self._function: list[str] = []
        self.found: list[Mutant] = []
        self.visit(ast.parse(source))

    def _place(self, line: int, column: int) -> int:
        # Columns are counted in bytes.
        return self._begins[line - 1] + len(self._lines[line - 1].encode()[:column].decode())

    def _span(self, node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._place(node.lineno, node.col_offset), self._place(
            node.end_lineno, node.end_col_offset
        )

    def _add(self, begin: int, end: int, text: str) -> None:
        source = self._source
        first = source.rfind("\n", 0, begin) + 1
        last = source.find("\n", end)
        old = source[first:last].strip()
        new = (source[first:begin] + text + source[end:last]).strip()
        name = ".".join(self._function) or "<module>"
        self.found.append(
            Mutant(self._file, name, source.count("\n", 0, begin) + 1, begin, end, text, old, new)
        )

    def _operator(self, left: ast.expr, right: ast.expr, sign: str, other: str) -> None:
        """Change the sign between two expressions."""
        begin, end = self._span(left)[1], self._span(right)[0]
        at = self._source[begin:end].find(sign)
        if at >= 0:
            self._add(begin + at, begin + at + len(sign), other)

    # -- what is left alone ------------------------------------------------------------------------

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self._function.append(node.name)
        for default in [*node.args.defaults, *(value for value in node.args.kw_defaults if value)]:
            self.visit(default)
        for statement in node.body:
            self.visit(statement)
        self._function.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self._function.append(node.name)
        for statement in node.body:
            self.visit(statement)
        self._function.pop()

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Raise(self, node: ast.Raise) -> None:
        """A message."""

    def visit_Assert(self, node: ast.Assert) -> None:
        """For type checkers."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """A message."""

    # -- what is changed ---------------------------------------------------------------------------

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool):
            self._add(*self._span(node), str(not node.value))
        elif isinstance(node.value, int):
            self._add(*self._span(node), str(node.value + 1))
        elif isinstance(node.value, float) and node.value not in (0.0, float("inf")):
            self._add(*self._span(node), repr(node.value * 1.07))

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in OPERATORS:
            self._operator(node.left, node.right, *OPERATORS[type(node.op)])
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, sign, right in zip(
            [node.left, *node.comparators], node.ops, node.comparators, strict=False
        ):
            for table in (COMPARISONS, OPPOSITE):
                if type(sign) in table:
                    self._operator(left, right, *table[type(sign)])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        words = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        self._operator(node.values[0], node.values[1], *words)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        begin = self._span(node)[0]
        if isinstance(node.op, (ast.Not, ast.USub, ast.Invert)):
            self._add(begin, self._span(node.operand)[0], "")
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = (
            node.func.attr
            if isinstance(node.func, ast.Attribute)
            else node.func.id
            if isinstance(node.func, ast.Name)
            else ""
        )
        if name.startswith("warn"):
            return
        end = self._span(node.func)[1]
        if name in NAMES:
            self._add(end - len(name), end, NAMES[name])
        if name in ("arctan2", "atan2", "cross"):
            first, second = (self._span(argument) for argument in node.args[:2])
            text = self._source
            self._add(
                first[0],
                second[1],
                text[slice(*second)] + text[first[1] : second[0]] + text[slice(*first)],
            )
        if name in ("conj", "conjugate"):
            if node.args:
                self._add(*self._span(node), f"({self._source[slice(*self._span(node.args[0]))]})")
            else:
                self._add(end - len(name) - 1, self._span(node)[1], "")
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if (
            node.arg == "axis"
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, int)
        ):
            self._add(*self._span(node.value), "1" if node.value.value == 0 else "0")
        elif node.arg not in ("dtype", "strict", "stacklevel", "copy", "order"):
            self.visit(node.value)


def mutants_of(file: str) -> list[Mutant]:
    """All mutants of a file."""
    return _Finder(file, (CHECKOUT / file).read_text(encoding="utf-8")).found


def is_python(mutant: Mutant) -> bool:
    """Whether the mutant is valid Python."""
    try:
        ast.parse(changed((CHECKOUT / mutant.file).read_text(encoding="utf-8"), mutant))
    except SyntaxError:
        return False
    return True


def changed(source: str, mutant: Mutant) -> str:
    return source[: mutant.begin] + mutant.text + source[mutant.end :]


def draw(count: int, seed: int, only: str) -> list[Mutant]:
    """A number of mutants, from each package in turn."""
    chance = random.Random(seed)
    piles = []
    for package in PACKAGES:
        files = sorted(
            path.relative_to(CHECKOUT).as_posix()
            for path in (CHECKOUT / "rtradar" / package).rglob("*.py")
        )
        pile = [mutant for file in files if only in file for mutant in mutants_of(file)]
        chance.shuffle(pile)
        piles.append(pile)
    drawn: list[Mutant] = []
    while len(drawn) < count and any(piles):
        drawn += filter(is_python, [pile.pop() for pile in piles if pile])
    return drawn[:count]


class Tree:
    """A copy of the checkout, what its tests call, and its compiled code."""

    def __init__(self, folder: Path) -> None:
        self._root, self._cache, self._traces = (
            folder / "tree",
            folder / "numba",
            folder / "traces.json",
        )
        if self._root.exists():
            shutil.rmtree(self._root)
        named = subprocess.run(
            ["git", "ls-files", "-z", "-co", "--exclude-standard"],
            cwd=CHECKOUT,
            capture_output=True,
            check=True,
        )
        for name in filter(None, named.stdout.decode().split("\0")):
            if (CHECKOUT / name).is_file():
                (self._root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(CHECKOUT / name, self._root / name)
        sources = [
            path for folder in ("rtradar", "tests") for path in (self._root / folder).rglob("*.py")
        ]
        stamp = str(max(path.stat().st_mtime_ns for path in sources))
        kept = json.loads(self._traces.read_text()) if self._traces.exists() else {}
        self._traced: dict[str, dict[str, dict[str, object]]] = (
            kept.get("files", {}) if kept.get("stamp") == stamp else {}
        )
        self._stamp = stamp
        if not self._traced:
            shutil.rmtree(self._cache, ignore_errors=True)
        self._cache.mkdir(parents=True, exist_ok=True)

    @cached_property
    def imports(self) -> dict[str, set[str]]:
        """Modules of rtradar, and of the references of kernels, that each file imports, by file."""
        packages = "rtradar", "references"
        found = {}
        for path in [*self._root.glob("rtradar/**/*.py"), *self._root.glob("tests/**/*.py")]:
            names = set()
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(packages):
                    names |= {
                        node.module or "",
                        *(f"{node.module}.{alias.name}" for alias in node.names),
                    }
                elif isinstance(node, ast.Import):
                    names |= {alias.name for alias in node.names if alias.name.startswith(packages)}
            own = path.relative_to(self._root).as_posix()
            paths = {name.replace(".", "/") for name in names}
            paths |= {f"tests/kernels/{path}" for path in paths if path.startswith("references")}
            found[own] = {
                each
                for name in paths
                for each in (f"{name}.py", f"{name}/__init__.py")
                if (self._root / each).is_file()
            }
        return found

    def importers(self, file: str) -> list[set[str]]:
        """Files that import a file, then those that import these, and so on."""
        rings, known = [], {file}
        while True:
            ring = {
                name
                for name, taken in self.imports.items()
                if taken & (rings[-1] if rings else {file})
            } - known
            if not ring:
                return rings
            known |= ring
            rings.append(ring)

    def test_files(self, file: str) -> list[str]:
        """Test files that most likely notice a change: they import it, or share its names."""
        path = Path(file)
        top = ast.parse((self._root / file).read_text(encoding="utf-8")).body
        named = (
            "|".join(node.name for node in top if isinstance(node, (ast.FunctionDef, ast.ClassDef)))
            or "$^"
        )
        ranks: dict[str, float] = {}
        for distance, ring in enumerate(self.importers(file)):
            for name in ring:
                if not Path(name).name.startswith("test_"):
                    continue
                alike = Path(name).parent.name == path.parent.name or Path(name).stem.startswith(
                    f"test_{path.parent.name}"
                )
                spoken = len(
                    re.findall(rf"\b(?:{named})\b", (self._root / name).read_text(encoding="utf-8"))
                )
                ranks[name] = (
                    distance
                    - 2 * (path.stem in Path(name).stem)
                    - 1.5 * alike
                    - min(spoken, 10) / 5
                )
        return sorted(ranks, key=lambda name: (ranks[name], name))[:MOST_FILES]

    def traced(self, test_file: str) -> dict[str, dict[str, object]]:
        """Seconds and calls of each test of a file that passes."""
        if test_file not in self._traced:
            out = self._root.parent / "trace.json"
            out.unlink(missing_ok=True)
            self._pytest(
                [test_file, "-p", "validation.robustness.mutation_trace"],
                self._cache,
                1800,
                {"MUTATION_TRACE": str(out)},
            )
            found = json.loads(out.read_text()) if out.exists() else {}
            self._traced[test_file] = {
                name: about for name, about in found.items() if about.get("outcome") == "passed"
            }
            self._traces.write_text(json.dumps({"stamp": self._stamp, "files": self._traced}))
        return self._traced[test_file]

    def tests(self, mutant: Mutant, test_file: str) -> list[str]:
        """Tests of a file that are to be run: the fastest first, and slow ones after all others."""
        own = mutant.file.removeprefix("rtradar/")
        near = tuple(
            f"{name.removeprefix('rtradar/')}::"
            for name in next(iter(self.importers(mutant.file)), set())
        )
        wanted = [(f"{own}::{mutant.function}",), (f"{own}::",), near]
        if mutant.function == "<module>" or self.is_compiled(mutant):
            wanted = [(f"{own}::", *near)]
        found = self.traced(test_file)
        for prefixes in wanted:
            seconds = {
                name: float(about["seconds"])
                for name, about in found.items()
                if any(call.startswith(prefixes) for call in about["calls"])
            }
            if seconds:
                break
        ordered = sorted(seconds, key=lambda name: (bool(found[name].get("slow")), seconds[name]))
        spent = itertools.accumulate(seconds[name] for name in ordered)
        fits = max(1, sum(so_far <= MOST_SECONDS for so_far in spent))
        return ordered[:fits]

    def is_compiled(self, mutant: Mutant) -> bool:
        """Whether Numba compiles its function, or uses the constants of its module."""
        tree = ast.parse((CHECKOUT / mutant.file).read_text(encoding="utf-8"))
        by_numba = {
            node.name
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef)
            and re.search(
                r"compiled|inlined|njit|jit", " ".join(map(ast.unparse, node.decorator_list))
            )
        }
        return bool(by_numba) and (
            mutant.function == "<module>" or mutant.function.split(".")[0] in by_numba
        )

    def run(self, mutant: Mutant) -> tuple[str, str, int]:
        """Outcome, the test that noticed it, and the number of tests.

        Outcomes are ``noticed``, ``noticed slowly`` by a test that `make test` leaves out,
        ``timeout``, ``survived`` and ``untested``.
        """
        path = self._root / mutant.file
        source = path.read_text(encoding="utf-8")
        compiled = self.is_compiled(mutant)
        count = 0
        for test_file in self.test_files(mutant.file):
            tests = self.tests(mutant, test_file)
            if not tests:
                continue
            count += len(tests)
            with tempfile.TemporaryDirectory(dir=self._root.parent) as folder:
                kept, cache = Path(folder) / "source.py", Path(folder) / "numba"
                shutil.copy2(path, kept)
                shutil.copytree(self._cache, cache, copy_function=os.link)
                if compiled:
                    stems = {
                        Path(mutant.file).stem,
                        *(Path(name).stem for ring in self.importers(mutant.file) for name in ring),
                    }
                    for entry in cache.rglob("*.nb?"):
                        if entry.name.split(".")[0] in stems:
                            entry.unlink()
                try:
                    path.write_text(changed(source, mutant), encoding="utf-8")
                    status, said = self._pytest(
                        ["-x", *tests], cache, COMPILING_S if compiled else LIMIT_S, {}
                    )
                finally:
                    shutil.copy2(kept, path)
            if status is None:
                return "timeout", test_file, count
            if status != 0:
                failed = re.search(r"^(?:FAILED|ERROR) (.*)$", said, re.MULTILINE)
                slow = failed and any(
                    self.traced(test_file)[name].get("slow")
                    for name in tests
                    if failed[1].split(" - ")[0] == name
                )
                return (
                    "noticed slowly" if slow else "noticed",
                    failed[1][:200] if failed else f"status {status} of {test_file}",
                    count,
                )
        return "survived" if count else "untested", "", count

    def _pytest(
        self, arguments: list[str], cache: Path, limit_s: int, more: dict[str, str]
    ) -> tuple[int | None, str]:
        environment = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith("RTRADAR_MOCAP")
        }
        environment |= {"NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1", **more}
        environment["PYTHONPATH"] = str(self._root)
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            *arguments,
        ]
        # In a process group of its own, because tests start processes, too.
        run = subprocess.Popen(
            command,
            cwd=self._root,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s)),
        )
        try:
            said, _ = run.communicate(timeout=HANGING_S)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, 9)
            run.communicate()
            return None, ""
        return None if run.returncode == -signal.SIGKILL else run.returncode, said


def outcomes(
    mutants: list[Mutant], tree: Tree, path: Path | None
) -> Iterator[tuple[Mutant, dict[str, object]]]:
    """Outcome of each mutant; those in the file are not run again."""
    known = (
        {row["key"]: row for row in json.loads(path.read_text())["mutants"]}
        if path and path.exists()
        else {}
    )
    for mutant in mutants:
        if mutant.key not in known:
            began = time.monotonic()
            outcome, by, count = tree.run(mutant)
            result = {
                "outcome": outcome,
                "by": by,
                "tests": count,
                "seconds": round(time.monotonic() - began, 1),
            }
            known[mutant.key] = {"key": mutant.key, **asdict(mutant), **result}
            if path:
                path.write_text(json.dumps({"mutants": list(known.values())}, indent=1) + "\n")
        yield mutant, known[mutant.key]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=80)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="only files whose path contains this text")
    parser.add_argument(
        "--json", type=Path, help="file of the outcomes; those in it are not found again"
    )
    parser.add_argument("--list", action="store_true", help="print the mutants, run nothing")
    parser.add_argument(
        "--folder",
        type=Path,
        help="folder of the copy and its compiled code, to use again (default: a temporary one)",
    )
    options = parser.parse_args()
    mutants = draw(options.count, options.seed, options.only)
    if options.list:
        print(
            "\n".join(
                f"{mutant.file}:{mutant.line} {mutant.function}: {mutant.change}"
                for mutant in mutants
            )
        )
        return 0
    reasons = {each["key"]: each["reason"] for each in json.loads(EQUIVALENT.read_text())}
    survivors, slowly = [], 0
    with tempfile.TemporaryDirectory() as temporary:
        tree = Tree((options.folder or Path(temporary)).resolve())
        for number, (mutant, result) in enumerate(outcomes(mutants, tree, options.json), 1):
            outcome = (
                f"{result['outcome']}: equivalent"
                if mutant.key in reasons and result["outcome"] == "survived"
                else result["outcome"]
            )
            slowly += outcome == "noticed slowly"
            print(
                f"{number:3d} {outcome:22s} {result['seconds']:6.1f} s {result['tests']:4d} tests  "
                f"{mutant.file}:{mutant.line}",
                flush=True,
            )
            if outcome in ("survived", "untested"):
                survivors.append(mutant)
                print(
                    f"    in {mutant.function}\n    - {mutant.old}\n    + {mutant.new}", flush=True
                )
    print(
        f"{len(mutants)} mutants, {len(survivors)} that no test notices and no reason excuses, "
        f"{slowly} that make test-all notices and make test does not"
    )
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
