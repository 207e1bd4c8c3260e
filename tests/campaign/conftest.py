"""A cluster inside this process, and data sets that are built on it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from distributed import Client, LocalCluster


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.fixture
def here(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """`build_dataset` works inside this process."""

    @contextmanager
    def same(workers: Any, scheduler: Any) -> Iterator[Client]:
        yield client

    monkeypatch.setattr("rtradar.campaign.build.dask_client", same)
