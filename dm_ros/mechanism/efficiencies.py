# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What stands for the efficiencies in the equations of direct flow, under either law of losses."""

from typing import NamedTuple

from dm_ros.mechanism.power_flow import DIRECT


class Efficiencies(NamedTuple):
    """
    The factors of the direct-flow equations, in which N, the moment within, stands for M.

    Under the paper's law they are its constants. Under the passive law each follows the power
    through its own element, see ``passive``: a mesh gives its efficiency one way and the inverse
    of it the other way, a bearing counts the load that brakes its shaft.
    """

    mesh_F: float          # what the final drive gives over what it takes: eta_FG
    mesh_1: float          # what each side mesh gives over what it takes: eta_1G, eta_2G
    mesh_2: float
    carrier_mesh: float    # of the carrier bearing below M_1 + M_2: eta_0B
    carrier_drag: float    # of the carrier bearing below drag and friction: eta_0B
    carrier_input: float   # above eta_FG M_F, or T_0: 1
    pinion_mesh: float     # of the pinion bearing below M_F: eta_3B
    pinion_drag: float     # of the pinion bearing below L_3: eta_3B
    pinion_input: float    # above T_3: 1


def of_flow(p, flow):
    """Return ``Efficiencies`` for DIRECT flow under the paper's law; other flows as they are."""
    if flow == DIRECT:
        return Efficiencies(getattr(p, 'eta_FG', 1.0), p.eta_1G, p.eta_2G, p.eta_0B, p.eta_0B, 1.0,
                            getattr(p, 'eta_3B', 1.0), getattr(p, 'eta_3B', 1.0), 1.0)
    return flow
