# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the driveline share: states, whole equations, and the runs of scenarios."""

from importlib.util import module_from_spec, spec_from_file_location
import math
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from dm_ros import Driveline
from dm_ros.driveline.assembly import Assembly
from dm_ros.driveline.equations import Equations
from dm_ros.driveline.layouts import LAYOUTS
from dm_ros.driveline.road import Given

EXAMPLES = Path(__file__).parents[1] / 'examples'
DIFFERENTIALS = {'fwd': ('front',), 'rwd': ('rear',), 'awd': ('centre', 'front', 'rear')}
NONE, ALL = (0.0,) * 4, (1.0,) * 4
GAPS = {'driveline.shaft.half.gap': 0.035, 'driveline.shaft.input.gap': 0.02}


def example(name):
    """Return the module of a file in examples/."""
    spec = spec_from_file_location(name, EXAMPLES / f'{name}.py')
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def sign_speed(layout, value=0.1):
    """Return the parameters that give ``mesh_sign_speed`` to all differentials."""
    return {f'driveline.{name}.mesh_sign_speed': value for name in DIFFERENTIALS[layout]}


class System:
    """The equations of a layout, and what is held."""

    def __init__(self, layout='awd', planar=True, parameters=None, given=None, forces=()):
        self.assembly = Assembly(parameters or {}, 0.001)
        LAYOUTS.get(layout, layout)(self.assembly)
        self.assembly.finish()
        self.equations = Equations(self.assembly, planar)
        self.layout = self.equations.layout
        self.given = given
        self.friction = [d.friction(dict(forces).get(d.name, ()))
                         for d in self.assembly.differentials]

    def at(self, x):
        """Return the ``Point`` at a state."""
        return self.equations.at(np.array(x, float), self.friction, self.given)

    def rates(self, x):
        """Return dx/dt."""
        return self.at(x).rates

    def jacobian(self, x):
        """Return df/dx in closed form."""
        return self.equations.jacobian(self.at(x), self.given)

    def books(self, x):
        """Return the energy, what changes of load add to it, and all losses."""
        point = self.at(x)
        energy, lost = self.equations.train.books(point.x, point.train)
        more, parametric, others = self.equations.road.books(point.x, point.road, self.given)
        return energy + more, parametric, np.array(lost + others)


def random_given(rng, wheels=4, planar=True):
    """Return random inputs."""
    return Given(rng.normal(0, 300), tuple(rng.uniform(0, 800, wheels).tolist()),
                 rng.normal(0, 0.1) * planar, rng.normal(0, 0.1),
                 tuple(rng.uniform(0.1, 1.2, wheels).tolist()),
                 tuple(rng.uniform(0.5, 1.2, wheels).tolist()), rng.normal(0, 5))


def random_state(rng, layout, scale=1.0):
    """Return a random state: of a car that moves with some metres a second and slips."""
    spread = {'omega': 30.0, 'omega_0': 30.0, 's': 5.0, 'phi': 0.03, 'y': 0.5, 'kappa': 0.05,
              'alpha': 0.05, 'v_x': 10.0, 'v_y': 1.0, 'r': 0.5, 'A_x': 2.0, 'A_y': 2.0}
    x = np.array([spread[name.partition('.')[0]] * rng.normal() for name in layout.names])
    x[layout.pads] = rng.uniform(-0.99, 0.99, layout.pads.stop - layout.pads.start)
    return scale * x


def ramp(name, begin, end, steps, t_0, t_1):
    """Return [(time, name, value)] of a ramp in steps."""
    def between(a, b, share):
        return a + (b - a) * share
    values = [tuple(between(a, b, (i + 1) / steps) for a, b in zip(begin, end))
              if isinstance(begin, tuple) else between(begin, end, (i + 1) / steps)
              for i in range(steps)]
    return [(t_0 + (t_1 - t_0) * i / steps, name, value) for i, value in enumerate(values)]


def lane_change():
    """Return the steering of the double lane change, [(time, name, value)]."""
    events = []
    for i in range(100):
        t = 0.3 + 0.03 * i
        s = 2 * math.pi * (t - 0.285) / 3
        inside = 0.0 <= s <= 2 * math.pi
        events.append((t, 'steer', 0.035 * math.sin(2 * s) if inside else 0.0))
    return [*events, (3.3, 'steer', 0.0)]


# of each scenario: layout, planar, parameters, speed, grade, what is held, events, duration
SCENARIOS = {
    'hill_axle_ice': (
        'awd', False, {}, 0.0, 0.12, {'grip': (0.15, 0.15, 1.0, 1.0), 'brakes': (800.0,) * 4},
        [*ramp('torque', 0.0, 500.0, 25, 0.5, 1.0),
         *ramp('brakes', (800.0,) * 4, NONE, 10, 1.0, 1.2)], 3.0),
    'lift_front': (
        'awd', False, {}, 0.0, 0.0, {'contact': (0.0, 0.0, 1.0, 1.0)},
        ramp('torque', 0.0, 400.0, 15, 0.2, 0.5), 2.0),
    'stop_hold': (
        'awd', False, {}, 10.0, -0.15, {},
        ramp('brakes', NONE, (900.0, 900.0, 700.0, 700.0), 10, 0.2, 0.4), 14.0),
    'tip': (
        'rwd', False, {**GAPS, 'driveline.shaft.half.stiffness': 8000.0,
                       'driveline.shaft.half.damping': 20.0}, 8.0, 0.0, {'torque': -40.0},
        [*ramp('torque', -40.0, 400.0, 6, 0.5, 0.56),
         *ramp('torque', 400.0, -60.0, 6, 1.7, 1.76)], 3.0),
    'lane': ('awd', True, {}, 22.0, 0.0, {'torque': 60.0}, lane_change(), 4.5),
}


def drive(car, held, events, duration):
    """Yield the snapshot of each tick."""
    inputs, events = dict(held), sorted(events, key=lambda event: event[0])
    for tick in range(round(duration / car.dt)):
        while events and round(events[0][0] / car.dt) <= tick:
            _, name, value = events.pop(0)
            inputs[name] = value
        yield car.step(**inputs)


def scenario(name, dt=0.001, duration=None, parameters=()):
    """Return the car of a scenario and the snapshots of its ticks."""
    layout, planar, own, speed, grade, held, events, end = SCENARIOS[name]
    car = Driveline(layout, planar, dt, {**sign_speed(layout), **own, **dict(parameters)})
    car.reset(speed, grade)
    held = {**held, 'grade': grade} if grade else held
    return car, list(drive(car, held, events, duration or end))


def by_radau(name, end):
    """Return state names, x (n, times) of a stiff solver, rtol 1e-8, and the times."""
    layout, planar, own, speed, grade, held, events, _ = SCENARIOS[name]
    system = System(layout, planar, {**sign_speed(layout), **own})
    inputs = {'torque': 0.0, 'brakes': (0.0,) * 4, 'steer': 0.0, 'grade': grade,
              'grip': (1.0,) * 4, 'contact': (1.0,) * 4, 'wind': 0.0, **held}
    events = sorted(((round(t, 9), what, value) for t, what, value in events if t < end),
                    key=lambda event: event[0])
    edges = sorted({0.0, end, *[t for t, _, _ in events]})
    x, times, path = system.equations.rolling(speed, grade), [], []
    for begin, stop in zip(edges, edges[1:]):
        for _, what, value in (event for event in events if event[0] == begin):
            inputs[what] = value
        system.given = Given(**inputs)
        ticks = np.arange(round(begin * 1000) + 1, round(stop * 1000) + 1) / 1000.0
        solution = solve_ivp(lambda _, x: system.rates(x), (begin, stop), x, 'Radau', ticks,
                             rtol=1e-8, atol=1e-10 * system.layout.scale)
        assert solution.success
        x = solution.y[:, -1]
        times.extend(solution.t)
        path.append(solution.y)
    return system.layout, np.hstack(path), np.array(times)


def distances(name, end):
    """Return how far body, wheels, and input and carriers come from a stiff solver."""
    layout, exact, times = by_radau(name, end)
    layout_name, planar, own, speed, grade, held, events, _ = SCENARIOS[name]
    car = Driveline(layout_name, planar, 0.001, {**sign_speed(layout_name), **own})
    car.reset(speed, grade)
    run = list(drive(car, {**held, 'grade': grade}, events, end))
    assert len(run) == len(times)
    carriers = [n for n, shaft in enumerate(car.shafts) if shaft.endswith('carrier')]
    return np.array([np.abs(np.array(found).T - exact[place]).max() for found, place in (
        ([snapshot.twist_body[:1 + 2 * planar] for snapshot in run], layout.body),
        ([snapshot.velocity[-4:] for snapshot in run], layout.wheels),
        ([[snapshot.velocity[n] for n in (0, *carriers)] for snapshot in run],
         [0, *layout.differentials]))])
