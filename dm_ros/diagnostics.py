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

"""What the node says of itself: conditions that are logged at their ends, and /diagnostics."""

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue


class Condition:
    """Something that should not be: counted, logged when it begins and when it has ended."""

    def __init__(self, what, logger):
        """:param what: in words, such as ``ticks are missed``; logger: of the node."""
        self.what = what
        self.count = 0
        self.reason = ''
        self.active = False
        self._logger = logger
        self._settled = 0

    def happened(self, reason, times=1):
        """Count it, and log it if it begins now."""
        self.count += times
        self.reason = reason
        if not self.active:
            self.active = True
            self._logger.warning(f'{self.what}: {reason}')

    def settle(self):
        """Log its end if it did not happen since the last call; to be called at 1 Hz."""
        if self.active and self.count == self._settled:
            self.active = False
            self._logger.info(f'over: {self.what} ({self.count} in all)')
        self._settled = self.count


def status(name, complaints, fine, values):
    """
    Return a DiagnosticStatus.

    :param complaints: the active ``Condition`` s, if any; fine: the message if there is none.
    :param values: mapping from key to value.
    """
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if complaints else DiagnosticStatus.OK,
        name=name,
        message='; '.join(condition.what for condition in complaints) or fine,
        hardware_id='dm_ros',
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def lateness_values(lateness):
    """Return p50, p99 and the largest of sorted latenesses in ns, in words in microseconds."""
    def at(share):
        return f'{lateness[int(share * (len(lateness) - 1))] / 1e3:.1f}' if lateness else 'none'
    return {'lateness p50 [us]': at(0.5), 'lateness p99 [us]': at(0.99),
            'lateness max [us]': at(1.0)}
