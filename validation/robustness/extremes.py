"""Extremes: each gives the right finite answer, or a clear refusal or warning; never NaN or a hang.

A case states what is expected, and returns what it found or fails. What is right follows from
closed forms in the cases: a sphere seen from the distance R from its surface has |F| D^2 / R^2
sqrt(pi) / (1/a + 1/R), with D the distance of its centre, and along a symmetry axis an ellipsoid
has the same with both of its radii of curvature. The tests run the same cases.

    python validation/robustness/extremes.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys

import extreme_runs
import extreme_targets
from extreme_cases import Case

from rtradar.validate.rows import Row, judged, main

CASES = [*extreme_targets.CASES, *extreme_runs.CASES]


def outcome(one: Case) -> tuple[bool, str]:
    try:
        return True, one.run()
    except AssertionError as wrong:
        return False, f"WRONG: {wrong}"
    except Exception as error:
        return False, f"{type(error).__name__}: {error}"


def measure(quick: bool) -> list[Row]:
    rows = []
    print(f"{'case':62}  {'expected':62}  got")
    for one in CASES:
        if quick and one.slow:
            continue
        good, got = outcome(one)
        print(f"{one.name:62}  {one.expected:62}  {got}", flush=True)
        quantity = one.expected if good else f"{one.expected}; got: {got}"
        says = "extremes: neither the right finite answer nor a refusal or warning (1: so)"
        rows.append(judged(one.name, quantity, "", 0.0 if good else 1.0, 0.0, says=says))
    return rows


if __name__ == "__main__":
    sys.exit(main("Extremes: the right finite answer, a refusal or a warning.", measure))
