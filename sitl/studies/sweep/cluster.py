"""Dask's workers: a cluster for a while, and what it makes of batches as they come back."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterable, Iterator
from typing import Any

from sitl_bridge.vehicle.files import DescriptionError


@contextlib.contextmanager
def cluster(workers: int | None = None, scheduler: str | None = None, needed_by: str = "") -> Iterator[Any]:
    """A client of the scheduler at an address, or of a local cluster that ends with it.

    workers: processes of the local cluster; None: one for each core. Raises DescriptionError without Dask.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise DescriptionError(
            needed_by or "sitl sweep",
            ["needs Dask: pip install 'sitl-bridge[study]' (or: pip install 'dask[distributed]')"],
        ) from None
    if scheduler is not None:
        with Client(scheduler, timeout=10) as client:
            yield client
        return
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            host="127.0.0.1",
            silence_logs=50,
        ) as local,
        Client(local) as client,
    ):
        yield client


def as_they_come(
    client: Any, function: Callable[..., Any], batches: Iterable[Any], *more: Any
) -> Generator[Any, None, None]:
    """What function(batch, *more) returns in the workers, as each is ready.

    A batch whose worker dies is flown again by another one. What is left when the caller stops is cancelled.
    """
    from distributed import as_completed

    futures = [client.submit(function, batch, *more, pure=False) for batch in batches]
    try:
        for future in as_completed(futures):
            yield future.result()
    finally:
        client.cancel(futures)
