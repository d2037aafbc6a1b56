# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The result of a sweep as a file, CSV or Parquet: a row a set, written chunk by chunk."""

import numpy as np

from dm_ros.files.output import replacing
from dm_ros.tools.sweeping.study import STATUS

PARQUET = '.parquet'


def require_pyarrow(path):
    """Raise ValueError where a Parquet file is wanted and pyarrow is missing."""
    if path.endswith(PARQUET):
        try:
            import pyarrow.parquet  # noqa: F401
        except ImportError:
            raise ValueError(f'{path}: Parquet needs pyarrow: pip install "dm_ros[parquet]", or '
                             'name a .csv') from None


def write(path, names, parts):
    """
    Write the rows of a result.

    :param names: of the columns, without the last one, ``status``.
    :param parts: arrays (sets, columns), whose last column is the place in ``STATUS``.
    """
    (_write_parquet if path.endswith(PARQUET) else _write_csv)(path, names, parts)


def _write_csv(path, names, parts):
    with replacing(path, 'w') as file:
        file.write(','.join([*names, 'status']) + '\n')
        line = '%.17g,' * len(names) + '%s\n'
        for part in parts:
            for *numbers, status in part.tolist():
                file.write(line % (*numbers, STATUS[int(status)]))


def _write_parquet(path, names, parts):
    import pyarrow
    from pyarrow import parquet
    schema = pyarrow.schema([*((name, pyarrow.float64()) for name in names),
                             ('status', pyarrow.string())])
    with replacing(path, 'wb') as file, parquet.ParquetWriter(file, schema) as writer:
        for part in parts:
            columns = [pyarrow.array(np.ascontiguousarray(column)) for column in part.T[:-1]]
            status = pyarrow.array([STATUS[int(n)] for n in part[:, -1]], pyarrow.string())
            writer.write_table(pyarrow.Table.from_arrays([*columns, status], schema=schema))
