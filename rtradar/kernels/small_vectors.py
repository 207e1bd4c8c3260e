"""Vectors of three and their matrices in compiled loops, where NumPy's take seconds to compile."""

from __future__ import annotations

import math

from rtradar.kernels.jit import inlined


@inlined()
def dot(a, b):
    """Product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined()
def apply(matrix, vector, out):
    """Fill ``out`` with the matrix times the vector."""
    x, y, z = vector[0], vector[1], vector[2]
    for i in range(3):
        out[i] = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z


@inlined()
def apply_transposed(matrix, vector, out):
    """Fill ``out`` with the transpose of the matrix times the vector."""
    x, y, z = vector[0], vector[1], vector[2]
    for i in range(3):
        out[i] = matrix[0, i] * x + matrix[1, i] * y + matrix[2, i] * z


@inlined()
def subtract(a, b, out):
    """Fill ``out`` with a - b."""
    for i in range(3):
        out[i] = a[i] - b[i]


@inlined()
def normalize(vector):
    """Make a unit vector of it; its length is returned."""
    length = math.sqrt(dot(vector, vector))
    for i in range(3):
        vector[i] /= length
    return length
