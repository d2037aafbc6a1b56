# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A progress bar for the tools."""

from tqdm import tqdm


def progress(iterable=None, total=None, unit='tick'):
    """Return a bar on stderr; it shows on a terminal alone, after a second, for a known total."""
    return tqdm(iterable, total=total, unit=unit, unit_scale=True, delay=1.0, leave=False,
                dynamic_ncols=True, disable=True if total is None else None)
