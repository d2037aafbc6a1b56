# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Layouts as pages of elements and connections, the truck of the example, the file of defaults."""

import inspect
from pathlib import Path
import re
import textwrap

from drivelines import drive, example
import pytest
import yaml

from dm_ros import Driveline
from dm_ros.driveline.layouts import four_wheels, half_shafts, INPUT, rwd

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / 'config' / 'driveline_awd.yaml'
PAGE = (ROOT / 'doc' / 'driveline.md').read_text()


def flat(tree, prefix=''):
    """Yield (full name, value)."""
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f'{prefix}{name}.')
        else:
            yield prefix + name, value


def test_the_file_of_defaults_is_what_the_tables_say():
    values = dict(flat(yaml.safe_load(CONFIG.read_text())['/**']['ros__parameters']))
    assert values == dict(Driveline('awd').parameters)
    assert {type(value) for value in values.values()} == {int, float}


def test_the_file_of_defaults_tells_unit_and_meaning_of_each_value():
    car = Driveline('awd')
    words = ' '.join(line.partition('#')[2].strip() for line in CONFIG.read_text().splitlines())
    words = ' '.join(words.split())
    for name, row in car.parameter_rows.items():
        unit = '' if row.unit == '1' else f', {row.unit}'
        assert f'{unit}: {row.description}' in words, name


def test_every_value_of_a_vehicle_is_marked_as_assumed():
    rows = Driveline('awd').parameter_rows
    own = [row for name, row in rows.items() if not name.startswith(
        ('driveline.centre.', 'driveline.front.', 'driveline.rear.', 'driveline.max_parts',
         'driveline.jacobian_ticks', 'driveline.tolerance'))]
    assert len(own) == 37 and all('(assumed)' in row.description for row in own)


def test_the_layout_on_the_page_is_that_of_the_code():
    code = inspect.getsource(rwd).replace(f'    """{rwd.__doc__}"""\n', '')
    assert f'\n\n{textwrap.indent(code, "    ")}\n' in PAGE


def test_the_page_names_inputs_and_snapshot_as_they_are():
    inputs = [name for name in inspect.signature(Driveline.step).parameters if name != 'self']
    assert re.findall(r'^\| `(\w+)` \| (?:N|rad|1|m/s)', PAGE, re.MULTILINE) == inputs
    fields = Driveline().snapshot()._fields
    assert all(f'`{field}`' in PAGE for field in fields if field != 'time')


def test_a_truck_shares_its_pull_among_both_driven_axles():
    truck, snapshot = example('driveline_truck').pull_away(seconds=2.0)
    assert truck.wheels == ('front_left', 'front_right', 'first_left', 'first_right',
                            'second_left', 'second_right')
    forces = [force for force, _ in snapshot.wheel_force]
    assert forces[2:] == pytest.approx([forces[2]] * 4, rel=1e-5)
    assert forces[0] < 0.0 < forces[2]
    assert sum(snapshot.wheel_load) == pytest.approx(18_000 * 9.81, rel=1e-9)
    energy = truck.energy
    assert abs(energy.numerical) < 1e-4 * energy.input


def test_a_truck_with_one_axle_on_ice_spins_that_axle():
    truck, snapshot = example('driveline_truck').pull_away(seconds=2.0, first_grip=0.1)
    speeds = dict(zip(truck.shafts, snapshot.velocity))
    assert speeds['first_left'] > 5 * speeds['second_left'] > 0.0
    # the symmetric differential between them holds both axles to the pull of the weaker one
    torque = dict(zip(truck.connections, snapshot.torque))
    assert torque['link'] == pytest.approx(torque['through'], rel=0.35)


def test_the_truck_example_prints_what_its_wheels_do(capsys):
    assert example('driveline_truck').main(['--first-grip', '0.5']) == 0
    assert 'second_right' in capsys.readouterr().out


def transfer_case(car):
    """Drive both axles by a rigid transfer case, an inertia with three connections."""
    front_wheels, rear_wheels = four_wheels(car)
    case = car.inertia('case', 0.02)
    front, rear = car.axle('front'), car.axle('rear')
    car.connect('input', car.input(), case, INPUT)
    car.connect('front_propeller', case, front.pinion, INPUT)
    car.connect('rear_propeller', case, rear.pinion, INPUT)
    half_shafts(car, front, front_wheels)
    half_shafts(car, rear, rear_wheels)


def test_a_rigid_transfer_case_holds_both_axles_together():
    def pinions(layout):
        car = Driveline(layout)
        *_, last = drive(car, {'torque': 300.0, 'contact': (0.0, 0.0, 1.0, 1.0)}, [], 1.0)
        speeds = dict(zip(car.shafts, last.velocity))
        return speeds['front_axle_pinion'], speeds['rear_axle_pinion']
    assert pinions(transfer_case)[0] == pytest.approx(pinions(transfer_case)[1], rel=0.02)
    front, rear = pinions('awd')
    assert front > 5 * rear


def test_the_torque_acts_on_the_input_whatever_was_added_before_it():
    car = Driveline(transfer_case)
    assert car.shafts[:2] == ('input', 'case')
    snapshot = car.step(torque=18.0)
    assert snapshot.velocity[0] == pytest.approx(18.0 / 1.8 * car.dt, rel=0.1)
    assert car.energy.input == pytest.approx(18.0 * snapshot.position[0], rel=1e-12)


def test_parameters_cannot_be_changed_while_it_runs():
    car = Driveline()
    with pytest.raises(TypeError):
        car.parameters['driveline.mass'] = 1.0
