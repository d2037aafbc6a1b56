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

"""A vehicle differential in software, in the loop: the library, without ROS."""

from importlib import import_module

# loaded when they are asked for: a tool shall answer to signals before it loads numpy and scipy
HOMES = {
    'SelfLockingParameters': 'dm_ros.parameters',
    'Simulation': 'dm_ros.simulation',
    'Snapshot': 'dm_ros.simulation',
    'SymmetricParameters': 'dm_ros.parameters',
    'VARIANTS': 'dm_ros.simulation',
}
__all__ = sorted(HOMES)


def __getattr__(name):
    if name not in HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(HOMES[name]), name)
