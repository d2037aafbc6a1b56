# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Wheels in a process of their own on speed ports: stable in real time, exact in lockstep."""

from pathlib import Path
import signal
import sys

from diagnostic_msgs.msg import DiagnosticArray
from processes import Forked
import pytest
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

sys.path.insert(0, str(Path(__file__).parents[2] / 'examples'))

from wheel import Wheel
from wheel_node import WheelNode

from dm_ros import Simulation

ROOT = Path(__file__).parents[2]
COMMAND = f'import sys; sys.path.insert(0, {str(ROOT / "examples")!r})\n' + \
    'import wheel_node; sys.exit(wheel_node.main())'
PORT = 1e5, 300.0   # N m/rad, N m s/rad
PARAMETERS = {f'port.{shaft}.{name}': value for shaft in ('left', 'right') for name, value in (
    ('kind', 'speed'), ('stiffness', PORT[0]), ('damping', PORT[1]))}
DRIVE = 250.0       # N m


def test_stiff_tyres_in_a_process_of_their_own_are_stable_at_200_hz_and_its_end_frees_the_shafts(
        ros):
    node = ros.differential('symmetric_ode', rate=200.0, torque_timeout=0.3, **{
        name.replace('.', '__'): value for name, value in PARAMETERS.items()})
    joints = ros.listen(JointState, '/differential/joint_states')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    drive = ros.publisher(Float64, '/differential/torque/pinion')

    def efforts():
        """Drive; return the torques of both half-shafts in the last second, (200, 2), or fewer."""
        drive.publish(Float64(data=DRIVE))
        del joints[:-200]
        return [message.effort[1:3] for message in joints]

    def steady():
        """Return whether the tyres have held the drive for a second, without a swing."""
        torques = [torque for both in efforts() for torque in both]
        return len(torques) == 400 and -450.0 < min(torques) < max(torques) < -400.0 and (
            max(torques) - min(torques) < 2.0)

    with Forked(COMMAND, '--ros-args', '-p', 'speed:=10.0') as wheels:
        ros.until(steady)
        # 1400 N m s/rad hold it
        assert 0.28 < joints[-1].velocity[1] < 0.32
        assert wheels.ended(signal.SIGINT) == 0
        assert 'Traceback' not in wheels.errors
    ros.until(lambda: not any(efforts()[-1]))

    def complaint():
        return [status.message for message in diagnostics for status in message.status
                if 'their shafts are free' in status.message]
    ros.until(complaint)
    assert node.plant.freed.count


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_dae'])
def test_in_lockstep_it_is_the_library_to_the_last_bit(differential, variant):
    shafts = Simulation(variant).outputs
    ports = {f'port.{shaft}.{name.split(".")[-1]}': value for shaft in shafts
             for name, value in PARAMETERS.items() if name.startswith('port.left')}
    vehicle = differential(variant, rate=200.0, parameters=ports)
    options = {'lockstep': True, 'shafts': list(shafts), 'speed': 10.0, 'slope': 50.0}
    vehicle.attach(WheelNode(context=vehicle.context, parameter_overrides=[
        Parameter(name, value=value) for name, value in options.items()]))
    record = vehicle.run(seconds=0.5)
    simulation = Simulation(variant, 1 / 200.0, ports=dict.fromkeys(shafts, PORT))
    wheels = [Wheel(slope=50.0, speed=10.0) for _ in shafts]
    snapshot, snapshots = simulation.snapshot(), []
    for _ in range(100):
        first, *torques = snapshot.torque
        speeds = [wheel.turn(-torque, simulation.dt) for wheel, torque in zip(wheels, torques)]
        snapshot = simulation.step((0.0, *speeds))
        snapshots.append(snapshot)
    library = type(record).of(simulation, snapshots)
    for name, values in library.columns.items():
        assert (record.columns[name] == values).all(), name
    assert max(map(abs, record.torque[shafts[0]])) > 10.0
