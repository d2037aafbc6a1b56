# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The chunks of a sweep on a cluster of dask.distributed that is there already."""

from importlib import import_module

from dm_ros.tools.sweeping.study import Computation

PATIENCE = 30.0   # s, until the scheduler must have answered


def computed(study, columns):
    """Return the table of a chunk; it runs on a worker, in one of its threads."""
    return Computation(study, columns, threads=1).table


def same(study):
    """Return a study; as a task, it can be made again where the worker that had it died."""
    return study


def on_cluster(address, study, numbers, columns_of):
    """
    Yield (number, table) of chunks as they are done on a cluster.

    :param numbers: of the chunks; columns_of: function of a number, ``{full name: values}``.
    :raises ValueError: where there is no dask.distributed, no scheduler, or no way to go on.
    """
    try:
        from distributed import as_completed, Client
    except ImportError:
        raise ValueError('--scheduler needs dask.distributed: pip install "dm_ros[cluster]"'
                         ) from None
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise ValueError(f'--scheduler: {address}: {error}') from None
    with client:
        if study.function:
            path = getattr(import_module(study.function.partition(':')[0]), '__file__', None)
            if path and '.' not in study.function.partition(':')[0]:
                client.upload_file(path)   # to workers that come later, too
        shared = client.submit(same, study, pure=False)
        left, of = iter(numbers), {}
        pending = as_completed()

        def submit():
            for number in left:
                future = client.submit(computed, shared, columns_of(number), pure=False)
                of[future.key] = number
                pending.add(future)
                return

        def fill():
            # as many as keep the workers busy, no more: the tables wait in their memory
            threads = sum(client.nthreads().values())
            while len(of) < 2 * max(threads, 1):
                before = len(of)
                submit()
                if len(of) == before:
                    return

        fill()
        for future in pending:
            number = of.pop(future.key)
            if future.status == 'error':
                error = future.exception()
                raise ValueError(f'--scheduler: {error}') from None
            yield number, future.result()
            future.release()
            fill()
