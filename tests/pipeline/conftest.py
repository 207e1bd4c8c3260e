"""Fixtures that tests of the whole chain share."""

import pytest

import rtradar as rt


@pytest.fixture(scope="session")
def kick() -> rt.Motion:
    """One second of a synthetic kick."""
    return rt.synthetic_motion("kick", seed=1, duration_s=1.0)
