# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The long tests run when they are asked for by their path, as ``make test-long`` does."""

from pathlib import Path

HERE = Path(__file__).parent


def pytest_ignore_collect(collection_path, config):
    """Leave this folder out of a run of all tests."""
    asked = [Path(config.invocation_params.dir, str(argument).split('::')[0]).resolve()
             for argument in config.args]
    return None if any(path == HERE or HERE in path.parents for path in asked) else True
