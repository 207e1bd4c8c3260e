"""What tests of kernels compile is forgotten after them, or the doctor would find it."""

from collections.abc import Iterator

import pytest

from rtradar.kernels import jit


@pytest.fixture(autouse=True)
def functions_of_the_package_alone() -> Iterator[None]:
    """Leave no functions but those of the package on the list of compiled ones."""
    yield
    for name in [name for name in jit._functions if not name.startswith("rtradar.")]:
        del jit._functions[name]
