# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The energy books of a differential, see ``dm_ros.motion.energy``."""

from dm_ros.motion.energy import (
    AuditedSimulation,
    AuditedSnapshot,
    Energy,
    rated_efficiency,
    Returned,
)

__all__ = ['AuditedSimulation', 'AuditedSnapshot', 'Energy', 'rated_efficiency', 'Returned']
