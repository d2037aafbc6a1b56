# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A car on a hill with one wheel on ice, and two controllers: by its brakes and by clutches.

Nothing here knows ROS: ``Car`` turns shaft speeds into torques, ``BrakeLock`` turns wheel speeds
into brake demands, ``LimitedSlip`` turns the slip of a clutch into a force on it. ``car_nodes``
and ``limited_slip`` wrap each into an rclpy node. All numbers are those of a front-driven
middle-class car in first gear.
"""

from dataclasses import dataclass
import math

from dm_ros.mechanism.variants import variant_named

ASPHALT, ICE = 0.95, 0.12   # greatest friction coefficients of a tyre
GRAVITY = 9.81              # m/s^2


@dataclass(frozen=True)
class CarParameters:
    """What the car and its road are made of."""

    mass: float = 1400.0             # kg
    wheel_load: float = 3800.0       # N, on each driven wheel
    wheel_radius: float = 0.31       # m
    wheel_inertia: float = 1.0       # kg m^2, wheel, tyre, disc and half shaft
    engine_inertia: float = 1.7      # kg m^2 at the pinion, 0.15 times the first gear squared
    engine_torque: float = 250.0     # N m at the pinion, pedal down
    pedal_time: float = 0.5          # s, until the pedal is down
    governed_speed: float = 180.0    # rad/s of the pinion, where the engine gives no torque
    governed_range: float = 20.0     # rad/s, over which the governor takes it away
    grade: float = 0.04              # of the hill
    rolling_resistance: float = 0.012
    grip: tuple = (ICE, ASPHALT)     # under the left and the right wheel
    tyre_stiffness: float = 8.0      # B of the tyre curve
    tyre_shape: float = 1.5          # C of the tyre curve
    creep_speed: float = 3.0         # m/s, keeps the slip of a car at rest finite
    brake_lag: float = 0.03          # s, until the brake has 63 % of what is demanded
    brake_soft_speed: float = 1.0    # rad/s, below which the brake no longer grips fully


def with_wheels_and_engine(variant, p):
    """
    Return the mechanism parameters with wheels and engine attached to their shafts.

    This is what keeps the exchange of torques stable, see doc/coupling.md.
    """
    mechanism = variant_named(variant).mechanism
    own, (driven, *wheels) = mechanism.parameters().named(), mechanism.inputs
    attached = {driven: p.engine_inertia, **dict.fromkeys(wheels, p.wheel_inertia)}
    return {(name := f'{mechanism.name}.inertia.{shaft}'): own[name] + inertia
            for shaft, inertia in attached.items()}


class Car:
    """
    Engine, tyres, brakes and the way of the car, at the same tick as the differential.

    The final drive is a part of the differential.
    """

    def __init__(self, dt, parameters=None):
        """:param dt: length of a tick, s."""
        self.dt, self.p = dt, parameters or CarParameters()
        self._brake_part = 1.0 - math.exp(-dt / self.p.brake_lag)
        self.restart()

    def restart(self):
        """Go back to the start, at rest."""
        self.ticks, self.speed, self.brakes = 0, 0.0, (0.0, 0.0)
        self.history = []   # of (s, m/s, N m, N m): time, car, left and right brake

    def torques(self, pinion_speed, wheel_speeds, brake_demands):
        """
        Advance the car by a tick; return the torques of the differential in it, N m.

        :param pinion_speed: rad/s.
        :param wheel_speeds: rad/s, left and right.
        :param brake_demands: N m, left and right.
        :return: torques on the pinion, the left and the right shaft.
        """
        p, time = self.p, self.ticks * self.dt
        self.brakes = tuple(held + self._brake_part * (demand - held)
                            for held, demand in zip(self.brakes, brake_demands))
        self.history.append((time, self.speed, *self.brakes))
        forces = [self.tyre_force(speed, grip) for speed, grip in zip(wheel_speeds, p.grip)]
        left, right = (
            -p.wheel_radius * force - brake * math.tanh(speed / p.brake_soft_speed)
            for force, brake, speed in zip(forces, self.brakes, wheel_speeds))
        pinion = self.engine_torque(time, pinion_speed)
        resistance = p.mass * GRAVITY * (p.grade + p.rolling_resistance)
        # the driver does not let it roll back
        self.speed = max(0.0, self.speed + self.dt * (sum(forces) - resistance) / p.mass)
        self.ticks += 1
        return pinion, left, right

    def tyre_force(self, wheel_speed, grip):
        """Return the force of a tyre on the road, N, by a Magic Formula of three terms."""
        p = self.p
        slip = (p.wheel_radius * wheel_speed - self.speed) / (self.speed + p.creep_speed)
        return p.wheel_load * grip * math.sin(p.tyre_shape * math.atan(p.tyre_stiffness * slip))

    def engine_torque(self, time, speed):
        """Return the torque of the engine on the pinion, N m."""
        p = self.p
        pedal = min(1.0, time / p.pedal_time)
        governor = min(1.0, max(0.0, (p.governed_speed - speed) / p.governed_range))
        return p.engine_torque * pedal * governor


class BrakeLock:
    """
    An electronic differential lock: brakes the wheel that outruns the other one.

    A PI controller for each wheel; it knows the speeds of the wheels and nothing else.
    """

    THRESHOLD = 3.0   # rad/s, by which wheels may differ, as in a bend
    GAIN = 80.0       # N m s/rad
    RESET_TIME = 0.2  # s, of the integral
    LIMIT = 1200.0    # N m, what the brake can do

    def __init__(self, dt):
        """:param dt: length of a tick, s."""
        self.dt = dt
        self.restart()

    def restart(self):
        """Forget the integrals."""
        self._integrals = (0.0, 0.0)

    def brakes(self, wheel_speeds):
        """Return the demands on the left and the right brake, N m, from the speeds, rad/s."""
        left, right = wheel_speeds
        errors = (left - right - self.THRESHOLD, right - left - self.THRESHOLD)
        self._integrals = tuple(
            self._limited(integral + self.GAIN / self.RESET_TIME * error * self.dt)
            for integral, error in zip(self._integrals, errors))
        return tuple(self._limited(self.GAIN * error + integral)
                     for integral, error in zip(self._integrals, errors))

    def _limited(self, torque):
        return min(max(torque, 0.0), self.LIMIT)


@dataclass(frozen=True)
class LimitedSlip:
    """
    An electronic limited slip: presses a clutch of the differential the harder, the more it slips.

    It is proportional beyond a dead band and has no memory, so it suits any rate, and a clutch
    that does not slip is open.
    """

    threshold: float = 1.5    # rad/s, by which a wheel may differ from the carrier, as in a bend
    gain: float = 8000.0      # N s/rad
    limit: float = 15_000.0   # N, what the actuator can do

    def force(self, slip):
        """Return the axial force on a clutch, N, at its slip, rad/s; 0 if nobody knows that."""
        if not math.isfinite(slip):
            return 0.0
        return max(0.0, min(self.limit, self.gain * (abs(slip) - self.threshold)))
