"""Dask's workers: a cluster for a while, and what it makes of batches as they come back."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from typing import Any

from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.files import DescriptionError

LOOK_INTERVAL = 0.02
"""s, between two looks at what is ready."""


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
            dashboard_address="127.0.0.1:0",
            host="127.0.0.1",
            silence_logs=50,
        ) as local,
        Client(local) as client,
    ):
        yield client


def as_they_come(
    client: Any,
    function: Callable[..., list[Any]],
    batches: Iterable[Sequence[Any]],
    *more: Any,
    lost: Callable[[Any], Any],
    stop: StopRequest | None = None,
) -> Generator[list[Any], None, None]:
    """What function(batch, *more) returns in the workers, a list of an element each, as it is ready.

    A batch whose worker dies goes to another one. If workers die of it again and again, its elements are
    tried in the end, one at a time with nothing else in the cluster; of one that still kills its workers
    comes lost(element). Ends when all is there, or soon after a request to stop; what is left then is
    cancelled.
    """
    suspects: list[Any] = []
    for batch, found in _results(client, function, batches, more, stop):
        if found is None:
            suspects += batch
        else:
            yield found
    for suspect in suspects:
        for _, found in _results(client, function, [[suspect]], more, stop):
            yield [lost(suspect)] if found is None else found


def _results(
    client: Any,
    function: Callable[..., list[Any]],
    batches: Iterable[Sequence[Any]],
    more: tuple[Any, ...],
    stop: StopRequest | None,
) -> Generator[tuple[Sequence[Any], list[Any] | None], None, None]:
    """Each batch with what became of it; None: its workers died."""
    from distributed import KilledWorker, as_completed

    of = {client.submit(function, batch, *more, pure=False): batch for batch in batches}
    coming = as_completed(of)
    try:
        while coming.count() and not stop:
            if not (done := coming.next_batch(block=False)):
                time.sleep(LOOK_INTERVAL)
            for future in done:
                batch = of.pop(future)
                try:
                    yield batch, future.result()
                except KilledWorker:
                    yield batch, None
    finally:
        client.cancel(list(of))
