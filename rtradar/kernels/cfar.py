"""Mask of the order-statistic CFAR on a map (range, velocity), for rows from begin to end.

The training cells of a cell are a square ring: half-width ``outer`` without half-width ``guard``,
cut off at the edges of the map.
"""

from __future__ import annotations

import numpy as np

from rtradar.kernels.jit import compiled


@compiled()
def os_cfar_rows(begin, end, cells, thresholds, ranks, counts, guard, outer, mask):
    """Mark the cells above whose threshold fewer than ``counts - ranks + 1`` training cells lie.

    The threshold is the cell over its multiplier: at least ``rank`` training cells must lie below.
    Counting needs no sorting, and stops after the first rows that settle the question. For most
    cells, which hold noise, these are few, and they are counted for a whole row side by side.
    """
    n_range, n_velocity = cells.shape
    inside = max(n_velocity - 2 * outer, 0)  # cells with all their neighbours in the row
    below_first = np.empty(inside, dtype=np.int32)
    for i in range(begin, end):
        top, bottom = max(i - outer, 0), min(i + outer, n_range - 1)
        seen_first = 0
        below_first[:] = 0
        limits = thresholds[i, outer : outer + inside]
        # Whole rows of the ring, for all inner cells of this row together.
        for a in range(top, bottom + 1):
            if i - guard <= a <= i + guard or inside == 0:
                continue
            if seen_first > counts[i, outer] - ranks[i, outer]:
                break
            for shift in range(2 * outer + 1):
                neighbours = cells[a, shift : shift + inside]
                for j in range(inside):
                    below_first[j] += neighbours[j] < limits[j]
            seen_first += 2 * outer + 1
        for j in range(n_velocity):
            if (
                outer <= j < outer + inside
                and seen_first - below_first[j - outer] > counts[i, j] - ranks[i, j]
            ):
                mask[i, j] = False
                continue
            # The others one by one, until it is settled.
            left, right = max(j - outer, 0), min(j + outer, n_velocity - 1)
            inner_left, inner_right = max(j - guard, 0), min(j + guard, n_velocity - 1)
            threshold = thresholds[i, j]
            missing = ranks[i, j]  # cells below the threshold that are still wanted
            spare = counts[i, j] - missing  # cells that may lie at or above it
            for a in range(top, bottom + 1):
                below = 0
                seen = right - left + 1
                if a < i - guard or a > i + guard:
                    for b in range(left, right + 1):
                        below += cells[a, b] < threshold
                else:
                    for b in range(left, inner_left):
                        below += cells[a, b] < threshold
                    for b in range(inner_right + 1, right + 1):
                        below += cells[a, b] < threshold
                    seen -= inner_right - inner_left + 1
                missing -= below
                spare -= seen - below
                if missing <= 0 or spare < 0:
                    break
            mask[i, j] = missing <= 0
