# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the driveline share: states, whole equations, and the runs of scenarios."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from driveline import yardstick
from driveline.scenarios import WHEELS
import numpy as np

from dm_ros import Driveline
from dm_ros.driveline.assembly import Assembly
from dm_ros.driveline.equations import Equations
from dm_ros.driveline.layouts import LAYOUTS
from dm_ros.driveline.road import Given

EXAMPLES = Path(__file__).parents[1] / 'examples'
NONE, ALL = (0.0,) * 4, (1.0,) * 4
GAPS = {'driveline.shaft.half.gap': 0.035, 'driveline.shaft.input.gap': 0.02}


def example(name):
    """Return the module of a file in examples/."""
    spec = spec_from_file_location(name, EXAMPLES / f'{name}.py')
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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


def drive(car, held, changes, duration):
    """Yield the snapshot of each tick; changes: as those of a ``Scenario``."""
    inputs, left = dict(held), list(changes)
    for tick in range(round(duration / car.dt)):
        while left and round(left[0][0] / car.dt) <= tick:
            inputs |= left.pop(0)[1]
        yield car.step(**inputs)


def run_of(scenario, dt=0.001, parameters=()):
    """Return the car of a ``Scenario``, its snapshot at the start, and those of its ticks."""
    car = Driveline(scenario.layout, scenario.planar, dt,
                    {**scenario.parameters, **dict(parameters)})
    _, first = scenario.changes[0]
    car.reset(scenario.speed, first.get('grade', 0.0))
    return car, [car.snapshot(), *drive(car, {}, scenario.changes, scenario.duration)]


def until(scenario, end):
    """Return the first part of a ``Scenario``."""
    return scenario._replace(duration=end, changes=[
        (time, values) for time, values in scenario.changes if time < end])


def distances(scenario):
    """Return how far body, wheels, and input and carriers come from the yardstick in any tick."""
    run, (car, snapshots) = yardstick.run_of(scenario), run_of(scenario)
    assert len(snapshots) == len(run.times)

    def distance(names, of):
        return max(np.abs(np.array([of(snapshot)[n] for snapshot in snapshots])
                          - run.states[name]).max() for name, n in names.items())
    velocity = {name: n for n, name in enumerate(car.shafts)}
    body = ('v_x', 'v_y', 'r') if scenario.planar else ('v_x',)
    others = {'input': velocity['input'], **{
        f'{name}.omega_0': velocity[differential.shafts[0]]
        for name, differential in car.mechanisms.items()}}
    return np.array([
        distance({name: n for n, name in enumerate(body)}, lambda snapshot: snapshot.twist_body),
        distance({f'{wheel}.omega': velocity[wheel] for wheel in WHEELS},
                 lambda snapshot: snapshot.velocity),
        distance(others, lambda snapshot: snapshot.velocity)])
