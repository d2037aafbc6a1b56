# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A car on a hill with one wheel on ice, and two controllers: by its brakes and by clutches.

Nothing here knows ROS: ``Car`` turns shaft speeds into torques, ``CarOnHalfShafts`` turns shaft
torques into wheel speeds, ``BrakeLock`` turns wheel speeds into brake demands, ``LimitedSlip``
turns the slip of a clutch into a force on it. ``car_nodes`` and ``limited_slip`` wrap each into an
rclpy node. All numbers are those of a front-driven middle-class car in first gear.
"""

from dataclasses import dataclass
import math
from typing import NamedTuple

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
    # as a steel bar, 27 mm thick and 0.4 m long, has: pi D^4 G / (32 l) with G = 80 GPa
    half_shaft_stiffness: float = 1e4   # N m/rad
    half_shaft_damping: float = 100.0   # N m s/rad, assumed
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


def with_engine(variant, p):
    """Return the mechanism parameters with the engine attached to its shaft."""
    return _with_inertias(variant, lambda driven, wheels: {driven: p.engine_inertia})


def with_wheels_and_engine(variant, p):
    """
    Return the mechanism parameters with wheels and engine attached to their shafts.

    This is what keeps the exchange of torques stable, see doc/coupling.md.
    """
    return _with_inertias(variant, lambda driven, wheels: {
        driven: p.engine_inertia, **dict.fromkeys(wheels, p.wheel_inertia)})


def _with_inertias(variant, attached):
    mechanism = variant_named(variant).mechanism
    own, (driven, *wheels) = mechanism.parameters().named(), mechanism.inputs
    return {(name := f'{mechanism.name}.inertia.{shaft}'): own[name] + inertia
            for shaft, inertia in attached(driven, wheels).items()}


def speed_ports(variant, p):
    """Return the speed ports of the wheels, as ``Simulation`` takes them."""
    wheels = variant_named(variant).mechanism.inputs[1:]
    return dict.fromkeys(wheels, (p.half_shaft_stiffness, p.half_shaft_damping))


class Moment(NamedTuple):
    """The car at the start of a tick; wheels and tyres are left and right."""

    time: float          # s
    speed: float         # m/s
    left_brake: float    # N m
    right_brake: float
    left_wheel: float    # rad/s
    right_wheel: float
    left_tyre: float     # N m, with which the tyre drives the car
    right_tyre: float


class Car:
    """
    Engine, tyres, brakes and the way of the car, at the same tick as the differential.

    The wheels turn with the shafts of the differential, which has their inertia; what the car
    gives is torques. The final drive is a part of the differential.
    """

    gives_speeds = False   # of the wheels, instead of torques

    def __init__(self, dt, parameters=None):
        """:param dt: length of a tick, s."""
        self.dt, self.p = dt, parameters or CarParameters()
        self._brake_part = 1.0 - math.exp(-dt / self.p.brake_lag)
        self.restart()

    def restart(self):
        """Go back to the start, at rest."""
        self.ticks, self.speed, self.brakes = 0, 0.0, (0.0, 0.0)
        self.pinion_speed, self.wheels = 0.0, (0.0, 0.0)
        self.history = []   # of Moment, one a tick

    def see(self, speeds, torques):
        """
        Take what the differential says at the end of a tick, or at the start.

        :param speeds: of the pinion, the left and the right shaft, rad/s.
        :param torques: mean torques on the same in this tick, N m.
        """
        self.pinion_speed, *self.wheels = speeds

    def answer(self, brake_demands):
        """
        Return what goes in on the pinion, the left and the right shaft in the next tick.

        :param brake_demands: N m, left and right.
        """
        time, forces = self._begin(brake_demands)
        left, right = self._torques(self.wheels, forces)
        # the driver does not let it roll back
        self.speed = max(0.0, self.speed + self.dt * self._acceleration(forces))
        return self.engine_torque(time, self.pinion_speed), left, right

    def _begin(self, brake_demands):
        """Begin a tick; return its time, s, and the forces of the tyres at its start, N."""
        time = self.ticks * self.dt
        self.ticks += 1
        self.brakes = tuple(held + self._brake_part * (demand - held)
                            for held, demand in zip(self.brakes, brake_demands))
        forces = self._forces(self.wheels, self.speed)
        self.history.append(Moment(time, self.speed, *self.brakes, *self.wheels,
                                   *(self.p.wheel_radius * force for force in forces)))
        return time, forces

    def _forces(self, wheels, speed):
        return [self.tyre_force(wheel, speed, grip) for wheel, grip in zip(wheels, self.p.grip)]

    def _torques(self, wheels, forces):
        """Return the torques of tyre and brake on the wheels, N m."""
        p = self.p
        return [-p.wheel_radius * force - brake * math.tanh(wheel / p.brake_soft_speed)
                for force, brake, wheel in zip(forces, self.brakes, wheels)]

    def _acceleration(self, forces):
        """Return that of the car, m/s^2."""
        p = self.p
        resistance = p.mass * GRAVITY * (p.grade + p.rolling_resistance)
        return (sum(forces) - resistance) / p.mass

    def tyre_force(self, wheel_speed, speed, grip):
        """Return the force of a tyre on the road, N, by a Magic Formula of three terms."""
        p = self.p
        slip = (p.wheel_radius * wheel_speed - speed) / (speed + p.creep_speed)
        return p.wheel_load * grip * math.sin(p.tyre_shape * math.atan(p.tyre_stiffness * slip))

    def engine_torque(self, time, speed):
        """Return the torque of the engine on the pinion, N m."""
        p = self.p
        pedal = min(1.0, time / p.pedal_time)
        governor = min(1.0, max(0.0, (p.governed_speed - speed) / p.governed_range))
        return p.engine_torque * pedal * governor


class CarOnHalfShafts(Car):
    """
    The same car, which owns its wheels: it gets the torques of half-shafts and gives wheel speeds.

    The engine still turns with the pinion and gives its torque: it hardly changes within a tick.
    """

    gives_speeds = True
    STEP = 2.5e-4   # s, at most, of the wheels in a tick: a tyre at rest takes 0.7 ms to follow

    def see(self, speeds, torques):
        """Take what the differential says, and advance to the end of the tick of the torques."""
        self.pinion_speed, *_ = speeds
        if not self.ticks:
            return   # none has passed
        count = math.ceil(self.dt / self.STEP)

        def slopes(state):
            *wheels, speed = state
            forces = self._forces(wheels, speed)
            acceleration = self._acceleration(forces)
            if speed <= 0.0:
                acceleration = max(0.0, acceleration)
            return *((outer - inner) / self.p.wheel_inertia for outer, inner in zip(
                self._torques(wheels, forces), torques[1:])), acceleration
        state = *self.wheels, self.speed
        for _ in range(count):
            *wheels, speed = runge_kutta(slopes, state, self.dt / count)
            state = *wheels, max(0.0, speed)
        *self.wheels, self.speed = state

    def answer(self, brake_demands):
        """Return the torque on the pinion, N m, and the speeds of the wheels, rad/s."""
        time, _ = self._begin(brake_demands)
        return self.engine_torque(time, self.pinion_speed), *self.wheels


def runge_kutta(slopes, x, h):
    """Return x after a step h of the classical method of Runge and Kutta."""
    def ahead(k, part):
        return [value + part * h * slope for value, slope in zip(x, k)]
    k_1 = slopes(x)
    k_2 = slopes(ahead(k_1, 0.5))
    k_3 = slopes(ahead(k_2, 0.5))
    k_4 = slopes(ahead(k_3, 1.0))
    return ahead([(a + 2.0 * (b + c) + d) / 6.0 for a, b, c, d in zip(k_1, k_2, k_3, k_4)], 1.0)


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
