"""Readers of files, fuzzed by coverage (Atheris, libFuzzer): only our own errors may occur.

Findings are any exception but `InputError`, any warning but a `ValidityWarning`, more than 4 s of
processor time for a file of some kilobytes, more than 2 GB of memory, and the end of the process.
Each is kept once for each line that it comes from, with the file that causes it. Every reader has a
process of its own; what it has learned is kept in ``--corpus`` for another time.

    pip install -c constraints.txt --editable '.[fuzz,campaign,learn]'
    python validation/robustness/fuzz_readers.py --minutes 30 [--only bvh,scene] [--corpus DIR]
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from typing import Any, NoReturn

LIMIT_S = 4.0
LIMIT_BYTES = 2 << 30
PARTS = (
    "fuzz_exchange",
    "fuzz_markers",
    "fuzz_runs",
    "fuzz_targets",
)  # modules of the targets; each is imported only for its own
EVERY = 200  # inputs between two reports of a process, which may end without a word


class TooSlowError(BaseException):
    """One file took too long."""


def _stop(*_: object) -> NoReturn:
    raise TooSlowError


def homes(names: list[str]) -> dict[str, str]:
    """Module of each reader's target by the reader's name; all of them if none is named."""
    found: dict[str, str] = {}
    for part in PARTS:
        if not names or not set(names) <= set(found):
            found |= dict.fromkeys(importlib.import_module(part).TARGETS, part)
    unknown = [name for name in names if name not in found]
    if unknown:
        sys.exit(f"there is no reader '{', '.join(unknown)}'; the readers are {', '.join(found)}")
    return {name: found[name] for name in names or found}


def fuzz(name: str, part: str, seconds: int, corpus: Path, report: Path) -> NoReturn:
    """Fuzz one reader, in this process, to its end."""
    os.environ["NUMBA_DISABLE_JIT"] = "1"  # compiled code has no branches that could be watched
    import atheris

    with atheris.instrument_imports(include=["rtradar", "tomllib"]):
        from rtradar.errors import InputError, ValidityWarning

        target = importlib.import_module(part).TARGETS[name]
    folder = corpus / name.replace(" ", "-").replace("+", "-")
    folder.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(target.seeds()):
        (folder / f"seed-{number}").write_bytes(seed)
    words = corpus / f"{folder.name}.dict"
    words.write_text(
        "# words\n"
        + "".join(f'"{_escaped(word)}"\n' for word in dict.fromkeys(target.words.split()))
    )
    work = Path(tempfile.mkdtemp(prefix="rtradar-fuzz-"))
    found: dict[str, dict[str, str]] = {}
    state = {"inputs": 0, "taken": 0, "slowest_s": 0.0}
    began = time.monotonic()

    def tell() -> None:
        report.write_text(
            json.dumps({**state, "seconds": time.monotonic() - began, "found": found})
        )

    def one(data: bytes) -> None:
        state["inputs"] += 1
        clock = time.process_time()
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT_S)
            target.read(work, data)
            state["taken"] += 1
        except InputError as error:
            if len(str(error).splitlines()) != 1:
                _keep(found, folder, error, data)
        except BaseException as error:  # whatever it is
            _keep(found, folder, error, data)
            tell()
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        state["slowest_s"] = max(state["slowest_s"], time.process_time() - clock)
        if state["inputs"] % EVERY == 0:
            tell()

    signal.signal(signal.SIGVTALRM, _stop)
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ValidityWarning)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + LIMIT_BYTES, resource.RLIM_INFINITY))
    options = [
        f"-max_total_time={seconds}",
        f"-max_len={target.most_bytes}",
        f"-dict={words}",
        "-timeout=120",
        "-rss_limit_mb=0",
    ]
    atheris.Setup(
        [sys.argv[0], *options, "-verbosity=0", f"-artifact_prefix={folder}-end-", str(folder)], one
    )
    tell()
    atheris.Fuzz()
    raise SystemExit(0)


def _escaped(word: str) -> str:
    return "".join(
        letter if letter.isascii() and letter.isalnum() else f"\\x{ord(letter):02x}"
        for letter in word
    )


def _keep(
    found: dict[str, dict[str, str]], folder: Path, error: BaseException, data: bytes
) -> None:
    """Keep one of each kind, by its type and the last line of rtradar that it went through."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if "/rtradar/" in frame.filename
    ]
    where = (
        f"{frames[-1].filename.split('/rtradar/')[-1]}:{frames[-1].lineno}"
        if frames
        else "the target"
    )
    key = f"{type(error).__name__} at {where}"
    if key not in found:
        file = folder.parent / f"found-{folder.name}-{len(found)}"
        file.write_bytes(data)
        found[key] = {"message": " ".join(str(error).split())[:200], "file": str(file)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--minutes", type=float, default=18.0, help="time for all readers together (default: 18)"
    )
    parser.add_argument("--only", metavar="A,B,...", help="these readers")
    parser.add_argument(
        "--corpus",
        type=Path,
        metavar="DIR",
        help="folder for what is learned and found (default: a new one)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the findings to this file")
    parser.add_argument("--reader", help=argparse.SUPPRESS)
    parser.add_argument("--part", help=argparse.SUPPRESS)
    parser.add_argument("--seconds", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    corpus = (options.corpus or Path(tempfile.mkdtemp(prefix="rtradar-corpus-"))).resolve()
    if options.reader:
        fuzz(options.reader, options.part, options.seconds, corpus, options.json)
    readers = homes(options.only.split(",") if options.only else [])
    each = max(1, round(options.minutes * 60 / len(readers)))
    results: dict[str, Any] = {}
    print(f"{'reader':18} {'inputs':>9} {'taken':>8} {'minutes':>8} {'slowest':>8}  found")
    for name, part in readers.items():
        report = corpus / "report.json"
        report.unlink(missing_ok=True)
        corpus.mkdir(parents=True, exist_ok=True)
        own = [sys.executable, __file__, "--reader", name, "--part", part, "--seconds", str(each)]
        own += ["--corpus", str(corpus), "--json", str(report)]
        done = subprocess.run(own, capture_output=True, text=True, errors="replace", check=False)
        if not report.exists():
            sys.exit(f"{name}: {done.stderr.strip() or done.stdout.strip()}")
        result = results[name] = json.loads(report.read_text())
        if done.returncode:
            result["found"][f"the process ended with {done.returncode}"] = {
                "message": done.stderr[-300:],
                "file": "",
            }
        minutes, slowest = result["seconds"] / 60, result["slowest_s"]
        print(
            f"{name:18} {result['inputs']:9d} {result['taken']:8d} {minutes:8.2f} {slowest:6.2f} s"
            f"  {len(result['found'])}"
        )
        for what, finding in result["found"].items():
            print(f"    {what}: {finding['message']}  {finding['file']}")
        sys.stdout.flush()
    inputs, hours = (
        sum(one["inputs"] for one in results.values()),
        sum(one["seconds"] for one in results.values()) / 3600,
    )
    found = sum(len(one["found"]) for one in results.values())
    print(f"{inputs} inputs in {hours:.2f} h: {found} found; see {corpus}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
