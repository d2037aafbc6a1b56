# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A second model of the driveline on its wheels, to hold the product to.

It is written from the same equations, shares no line with the package, and is made to be read:
a state is a mapping of names to numbers, ``rhs`` gives its derivatives, and scipy's implicit
Runge-Kutta method integrates them, between two changes of an input with small tolerances. It
takes thousands of evaluations for what the product does in one, and so is for tests alone.

SI throughout. Wheels are in the order front left, front right, rear left, rear right; x points
forward, y to the left.
"""

from functools import cache
from math import atan, cos, hypot, sin, sqrt, tan
from typing import NamedTuple

from driveline.scenarios import DEFAULT_INPUTS, DIFFERENTIALS, SCENARIOS, WHEELS
from driveline.second_differential import AXLE, CENTRE, Differential, plus, sign
import numpy as np
from scipy.integrate import quad, solve_ivp

G = 9.81
AXLE_OF = {'front_left': 'front', 'front_right': 'front', 'rear_left': 'rear',
           'rear_right': 'rear'}
DRIVEN_AXLES = {'fwd': ('front',), 'rwd': ('rear',), 'awd': ('front', 'rear')}

CAR = {
    'mass': 1600.0, 'yaw_inertia': 2500.0, 'front_distance': 1.25, 'rear_distance': 1.40,
    'track': 1.55, 'height': 0.55, 'load_time': 0.05, 'roll_share': 0.55, 'wheel_radius': 0.32,
    'wheel_inertia': 1.0, 'input_inertia': 1.8, 'drag_area': 0.70, 'air': 1.2,
    'rolling_resistance': 0.012,
    'tyre.stiffness': 20.0, 'tyre.cornering_stiffness': 12.0, 'tyre.deflection_length': 0.02,
    'tyre.shape': 1.4, 'tyre.load_sensitivity': 0.10, 'tyre.load_reference': 3900.0,
    'tyre.damping': 2.0, 'tyre.low_speed': 0.25,
    'brake.pad_twist': 0.004, 'brake.damping': 4.0, 'brake.low_speed': 0.25,
    'shaft.input.stiffness': 3e4, 'shaft.input.damping': 20.0, 'shaft.input.gap': 0.0,
    'shaft.front_propeller.stiffness': 2e4, 'shaft.front_propeller.damping': 15.0,
    'shaft.front_propeller.gap': 0.0,
    'shaft.rear_propeller.stiffness': 1.5e4, 'shaft.rear_propeller.damping': 15.0,
    'shaft.rear_propeller.gap': 0.0,
    'shaft.half.stiffness': 1e4, 'shaft.half.damping': 25.0, 'shaft.half.gap': 0.0}


class Car:
    """
    A car of one layout with given parameters.

    :param parameters: those that are not the defaults, by full name, such as
        ``driveline.shaft.half.gap``.
    """

    def __init__(self, layout, planar, parameters):
        self.layout, self.planar = layout, planar
        tables = {'centre': dict(CENTRE), 'front': dict(AXLE), 'rear': dict(AXLE)}
        self.values = dict(CAR)
        for full_name, value in parameters.items():
            name = full_name.removeprefix('driveline.')
            head, _, tail = name.partition('.')
            table, key = (tables[head], tail) if head in tables else (self.values, name)
            if key not in table:
                raise KeyError(full_name)
            table[key] = value
        self.differentials = {
            name: Differential(tables[name],
                               ('front', 'rear') if name == 'centre' else ('left', 'right'),
                               is_axle=name != 'centre')
            for name in DIFFERENTIALS[layout]}
        self.driven = [w for w in WHEELS if AXLE_OF[w] in DRIVEN_AXLES[layout]]
        self.shafts = ['input']
        if layout == 'awd':
            self.shafts += ['front_propeller', 'rear_propeller']
        self.shafts += [f'{wheel}_half' for wheel in self.driven]
        self.names = self._names()

    def _names(self):
        names = ['input']
        for name in self.differentials:
            names += [f'{name}.omega_0', f'{name}.s']
        names += [f'{shaft}.twist' for shaft in self.shafts]
        for kind in ('omega', 'pad', 'kappa') + (('alpha',) if self.planar else ()):
            names += [f'{wheel}.{kind}' for wheel in WHEELS]
        return names + (['v_x', 'v_y', 'r', 'A_x', 'A_y'] if self.planar else ['v_x', 'A_x'])

    def rolling(self, speed, grade):
        """Return the state of a car that rolls freely."""
        state = dict.fromkeys(self.names, 0.0)
        wheel_speed = speed / self.values['wheel_radius']
        for wheel in WHEELS:
            state[f'{wheel}.omega'] = wheel_speed
            state[f'{wheel}.pad'] = sign(speed)
        for name, differential in self.differentials.items():
            if name != 'centre':
                state[f'{name}.omega_0'] = wheel_speed
                state['input'] = differential.input_speed(wheel_speed)
        if self.layout == 'awd':
            state['centre.omega_0'] = state['input']
        state['v_x'] = speed
        state['A_x'] = G * grade / sqrt(1.0 + grade * grade)
        return state

    # ---- shafts -----------------------------------------------------------------------------

    def shaft_ends(self, state):
        """Return {shaft: (speed of end a, speed of end b)}, a nearer to the input."""
        ends = {}
        for name, differential in self.differentials.items():
            outputs = differential.outputs(state[f'{name}.omega_0'], state[f'{name}.s'])
            into = differential.input_speed(state[f'{name}.omega_0'])
            if name == 'centre':
                ends['input'] = (state['input'], into)
                for axle, speed in zip(('front', 'rear'), outputs):
                    ends[f'{axle}_propeller'] = (speed, None)
                continue
            before = f'{name}_propeller' if self.layout == 'awd' else 'input'
            begin = ends[before][0] if before in ends else state['input']
            ends[before] = (begin, into)
            for side, speed in zip(('left', 'right'), outputs):
                wheel = f'{name}_{side}'
                ends[f'{wheel}_half'] = (speed, state[f'{wheel}.omega'])
        return ends

    def shaft_values(self, shaft):
        kind = 'half' if shaft.endswith('_half') else shaft
        return [self.values[f'shaft.{kind}.{name}'] for name in ('stiffness', 'damping', 'gap')]

    def shaft_torque(self, shaft, twist, rate):
        """Return (torque on end b, its damping part, elastic energy)."""
        stiffness, damping, gap = self.shaft_values(shaft)
        if gap == 0.0:
            return stiffness * twist + damping * rate, damping * rate, stiffness * twist**2 / 2.0
        beyond = sign(twist) * plus(abs(twist) - gap / 2.0)
        contact = stiffness * beyond
        damped = max(-abs(contact), min(abs(contact), damping * rate))
        return contact + damped, damped, stiffness * beyond**2 / 2.0

    # ---- tyres ------------------------------------------------------------------------------

    def loads(self, state, inputs):
        """Return the four wheel loads."""
        v = self.values
        length = v['front_distance'] + v['rear_distance']
        along = 1.0 / sqrt(1.0 + inputs['grade']**2)
        whole = v['mass'] * G * along
        front = v['mass'] * (G * along * v['rear_distance']
                             - state['A_x'] * v['height']) / length
        front = max(0.0, min(whole, front))
        moved = v['mass'] * state.get('A_y', 0.0) * v['height'] / v['track']
        result = []
        for share, load in ((v['roll_share'], front), (1.0 - v['roll_share'], whole - front)):
            to_right = max(-load / 2.0, min(load / 2.0, share * moved))
            result += [load / 2.0 - to_right, load / 2.0 + to_right]
        return [load * contact for load, contact in zip(result, inputs['contact'])]

    def friction(self, load, grip):
        v = self.values
        over = load / v['tyre.load_reference'] - 1.0
        return grip * max(0.2, 1.0 - v['tyre.load_sensitivity'] * over)

    def wheel_place(self, wheel, inputs):
        """Return (x, y, steer angle) of a wheel."""
        v = self.values
        y = v['track'] / 2.0 * (1.0 if wheel.endswith('left') else -1.0)
        if AXLE_OF[wheel] == 'rear':
            return -v['rear_distance'], y, 0.0
        length = v['front_distance'] + v['rear_distance']
        steer = tan(inputs['steer'])
        return v['front_distance'], y, atan(steer / (1.0 - y * steer / length))

    def tyre(self, wheel, state, inputs, load):
        """Return everything about one contact."""
        v = self.values
        x, y, angle = self.wheel_place(wheel, inputs)
        v_y, r = state.get('v_y', 0.0), state.get('r', 0.0)
        at_x, at_y = state['v_x'] - r * y, v_y + r * x
        V_lx = cos(angle) * at_x + sin(angle) * at_y
        V_ly = -sin(angle) * at_x + cos(angle) * at_y
        tread = v['wheel_radius'] * state[f'{wheel}.omega']
        V_sx, V_sy = tread - V_lx, -V_ly
        if not self.planar:
            V_sy = 0.0
        V_r = (abs(V_lx) + abs(tread) + hypot(V_sx, V_sy)) / 2.0
        kappa, alpha = state[f'{wheel}.kappa'], state.get(f'{wheel}.alpha', 0.0)
        mu = self.friction(load, inputs['grip'][WHEELS.index(wheel)])
        p_x = v['tyre.stiffness'] * kappa / mu
        p_y = v['tyre.cornering_stiffness'] * alpha / mu
        rho = hypot(p_x, p_y)
        shape = v['tyre.shape']
        f = sin(shape * atan(rho / shape))
        per_rho = f / rho if rho > 1e-12 else 1.0
        slow = 1.0 + (V_r / v['tyre.low_speed'])**2
        damping = v['tyre.damping'] / slow**2 * (1.0 - f * f)
        F_x = mu * load * (per_rho * p_x + damping * V_sx)
        F_y = mu * load * (per_rho * p_y + damping * V_sy)
        ell = v['tyre.deflection_length']
        spring_x, spring_y = mu * load * per_rho * p_x, mu * load * per_rho * p_y
        return {
            'F_x': F_x, 'F_y': F_y, 'x': x, 'y': y,
            'F_bx': cos(angle) * F_x - sin(angle) * F_y,
            'F_by': sin(angle) * F_x + cos(angle) * F_y,
            'dkappa': (V_sx - V_r * kappa) / (ell * v['tyre.stiffness']),
            'dalpha': (V_sy - V_r * alpha) / (ell * v['tyre.cornering_stiffness']),
            'loss': (V_r * (spring_x * kappa + spring_y * alpha)
                     + mu * load * damping * (V_sx**2 + V_sy**2))}

    def tyre_energy(self, kappa, alpha, load, grip):
        v = self.values
        mu = self.friction(load, grip)
        rho = hypot(v['tyre.stiffness'] * kappa, v['tyre.cornering_stiffness'] * alpha) / mu
        return mu**2 * load * v['tyre.deflection_length'] * stored(v['tyre.shape'], rho)

    # ---- brakes -----------------------------------------------------------------------------

    def brake(self, pad, omega, capacity):
        """Return (torque against the wheel, rate of the pad, loss)."""
        v = self.values
        share = 0.0
        if omega * pad > 0.0 and abs(pad) >= 0.7:
            z = min(1.0, (abs(pad) - 0.7) / 0.3)
            share = z * z * (3.0 - 2.0 * z)
        damped = (v['brake.damping'] / (1.0 + (omega / v['brake.low_speed'])**2)
                  * (1.0 - pad * pad) * omega)
        rate = (omega - share * abs(omega) * pad) / v['brake.pad_twist']
        loss = capacity * (share * abs(omega) * pad * pad + damped * omega)
        return capacity * (pad + damped), rate, loss

    def capacity(self, wheel, inputs, load):
        return (inputs['brakes'][WHEELS.index(wheel)]
                + self.values['rolling_resistance'] * load * self.values['wheel_radius'])

    # ---- all together -----------------------------------------------------------------------

    def evaluate(self, state, inputs):
        """Return (derivatives by name, everything else that is worth a look)."""
        v = self.values
        derivatives = {}
        ends = self.shaft_ends(state)
        torques, shaft_loss = {}, 0.0
        for shaft, (a, b) in ends.items():
            derivatives[f'{shaft}.twist'] = a - b
            torques[shaft], damped, _ = self.shaft_torque(shaft, state[f'{shaft}.twist'], a - b)
            shaft_loss += damped * (a - b)
        derivatives['input'] = (inputs['torque'] - torques['input']) / v['input_inertia']

        solutions, losses = {}, {'shafts': shaft_loss}
        for name, differential in self.differentials.items():
            if name == 'centre':
                before, after = 'input', ('front_propeller', 'rear_propeller')
            else:
                before = f'{name}_propeller' if self.layout == 'awd' else 'input'
                after = (f'{name}_left_half', f'{name}_right_half')
            forces = [inputs['clutch_forces'].get(f'{name}_{shaft}', 0.0)
                      for shaft in differential.shafts]
            solution = differential.solve(
                state[f'{name}.omega_0'], state[f'{name}.s'], torques[before],
                [-torques[shaft] for shaft in after], forces)
            derivatives[f'{name}.omega_0'], derivatives[f'{name}.s'] = solution.e_0, solution.ds
            solutions[name] = solution
            for kind, loss in solution.losses.items():
                losses[f'{name}_{kind}'] = loss

        loads = self.loads(state, inputs)
        tyres = {wheel: self.tyre(wheel, state, inputs, load)
                 for wheel, load in zip(WHEELS, loads)}
        losses['brakes'] = 0.0
        for wheel, load in zip(WHEELS, loads):
            tyre, omega = tyres[wheel], state[f'{wheel}.omega']
            braked, derivatives[f'{wheel}.pad'], loss = self.brake(
                state[f'{wheel}.pad'], omega, self.capacity(wheel, inputs, load))
            losses['brakes'] += loss
            driving = torques.get(f'{wheel}_half', 0.0)
            derivatives[f'{wheel}.omega'] = (
                driving - v['wheel_radius'] * tyre['F_x'] - braked) / v['wheel_inertia']
            derivatives[f'{wheel}.kappa'] = tyre['dkappa']
            if self.planar:
                derivatives[f'{wheel}.alpha'] = tyre['dalpha']
        losses['tyres'] = sum(tyre['loss'] for tyre in tyres.values())

        v_x, v_y, r = state['v_x'], state.get('v_y', 0.0), state.get('r', 0.0)
        mass = v['mass']
        through_air = v_x + inputs['wind']
        drag = v['air'] * v['drag_area'] * through_air * abs(through_air) / 2.0
        uphill = mass * G * inputs['grade'] / sqrt(1.0 + inputs['grade']**2)
        force_x = sum(tyre['F_bx'] for tyre in tyres.values()) - drag
        force_y = sum(tyre['F_by'] for tyre in tyres.values())
        derivatives['v_x'] = (force_x - uphill) / mass + r * v_y
        derivatives['A_x'] = (force_x / mass - state['A_x']) / v['load_time']
        if self.planar:
            derivatives['v_y'] = force_y / mass - r * v_x
            derivatives['r'] = sum(t['x'] * t['F_by'] - t['y'] * t['F_bx']
                                   for t in tyres.values()) / v['yaw_inertia']
            derivatives['A_y'] = (force_y / mass - state['A_y']) / v['load_time']
        losses['air'] = drag * through_air
        work = {'input': inputs['torque'] * state['input'], 'slope': -uphill * v_x,
                'wind': drag * inputs['wind']}
        return derivatives, {'torques': torques, 'solutions': solutions, 'loads': loads,
                             'tyres': tyres, 'losses': losses, 'work': work}

    def energy(self, state, inputs, loads=None):
        """
        Return the energy: kinetic, of shafts, of brake pads and rolling resistance, of tyres.

        :param loads: the wheel loads; those of the state when left out.
        """
        v = self.values
        loads = self.loads(state, inputs) if loads is None else loads
        energy = v['mass'] * (state['v_x']**2 + state.get('v_y', 0.0)**2) / 2.0
        energy += v['yaw_inertia'] * state.get('r', 0.0)**2 / 2.0
        energy += v['input_inertia'] * state['input']**2 / 2.0
        for name, differential in self.differentials.items():
            energy += differential.energy(state[f'{name}.omega_0'], state[f'{name}.s'])
        for shaft in self.shafts:
            energy += self.shaft_torque(shaft, state[f'{shaft}.twist'], 0.0)[2]
        energy += sum(v['wheel_inertia'] * state[f'{w}.omega']**2 / 2.0 for w in WHEELS)
        return energy + self.contact_energy(state, inputs, loads)

    def contact_energy(self, state, inputs, loads):
        """Return the part of the energy that depends on the loads: of the pads and tyres."""
        energy = 0.0
        for wheel, load, grip in zip(WHEELS, loads, inputs['grip']):
            energy += (self.capacity(wheel, inputs, load) * self.values['brake.pad_twist']
                       * state[f'{wheel}.pad']**2 / 2.0)
            energy += self.tyre_energy(state[f'{wheel}.kappa'],
                                       state.get(f'{wheel}.alpha', 0.0), load, grip)
        return energy

    def parametric(self, state, inputs, derivatives):
        """Return the power by which changing loads change the stored energy."""
        h = 1e-5
        values = []
        for step in (h, -h):
            there = {name: state[name] + step * derivatives[name]
                     for name in ('A_x', 'A_y') if name in state}
            values.append(self.contact_energy(state, inputs, self.loads(there, inputs)))
        return (values[0] - values[1]) / (2.0 * h)


def stored(shape, rho):
    """Return the integral of the magic formula from 0 to rho."""
    # with rho = C tan(u) the integrand is smooth and has no long tail
    return quad(lambda u: shape * sin(shape * u) / cos(u)**2, 0.0, atan(rho / shape),
                epsabs=1e-13, epsrel=1e-12)[0]


def rhs(t, state, inputs, car):
    """
    Return the derivatives of a state, by name.

    :param t: not used, the equations do not change with time.
    """
    return car.evaluate(state, inputs)[0]


class Run(NamedTuple):
    """What came out: ``times`` in s, ``states`` an array of each state by its name."""

    car: Car
    times: np.ndarray
    states: dict
    inputs: list        # in force from each time on; a change acts from its time
    pieces: list        # (begin, end, inputs, solution with dense output)
    evaluations: int

    def state(self, index):
        """Return the state at one of the times, by name."""
        return {name: float(values[index]) for name, values in self.states.items()}

    def looks(self):
        """Yield all that ``Car.evaluate`` says beside the derivatives, at each of the times."""
        for index, inputs in enumerate(self.inputs):
            yield self.car.evaluate(self.state(index), inputs)[1]


# Sizes with which the difference quotients of the Jacobian and the tolerances are taken.
SCALES = {'twist': 1e-2, 'kappa': 0.1, 'alpha': 0.1}


def scale(name):
    """Return what counts as a large value of a state."""
    return SCALES.get(name.rpartition('.')[2], 1.0)


def integrate(car, state, changes, duration, rtol=1e-8, atol=1e-10, method='Radau'):
    """
    Return a ``Run`` on the grid of 1 ms.

    ``position`` is added to the states: the way along the car's own x axis.

    :param state: by name, at the time 0.
    :param atol: relative to the size of a state.
    """
    names = [*car.names, 'position']
    scales = np.array([scale(name) for name in names])
    y = np.array([state.get(name, 0.0) for name in names])
    inputs = dict(DEFAULT_INPUTS)
    bounds = [time for time, _ in changes] + [duration]
    times, rows, in_force, pieces, count = [], [], [], [], 0
    for (begin, values), end in zip(changes, bounds[1:]):
        inputs = {**inputs, **values}

        def slope(t, y, inputs=inputs):
            by_name = dict(zip(names, y.tolist()))
            derivatives = rhs(t, by_name, inputs, car)
            derivatives['position'] = by_name['v_x']
            return np.array([derivatives[name] for name in names])

        def jacobian(t, y, slope=slope):
            at = slope(t, y)
            result = np.zeros((len(y), len(y)))
            for i in range(len(y) - 1):   # nothing depends on the position
                moved = y.copy()
                moved[i] += 1e-7 * scales[i]
                result[:, i] = (slope(t, moved) - at) / (moved[i] - y[i])
            return result

        grid = np.arange(round(begin * 1000), round(end * 1000)) / 1000.0
        solution = solve_ivp(slope, (begin, end), y, method=method, dense_output=True, rtol=rtol,
                             atol=atol * scales, jac=jacobian)
        if not solution.success:
            raise ArithmeticError(solution.message)
        times += grid.tolist()
        rows += solution.sol(grid).T.tolist()
        in_force += [inputs] * len(grid)
        pieces.append((begin, end, inputs, solution))
        count += solution.nfev + solution.njev * len(y)
        y = solution.y[:, -1]
    times.append(duration)
    rows.append(y.tolist())
    in_force.append(inputs)
    return Run(car, np.array(times), dict(zip(names, np.array(rows).T)), in_force, pieces, count)


def run_of(scenario, **tolerances):
    """Return the ``Run`` of a ``Scenario``."""
    car = Car(scenario.layout, scenario.planar, scenario.parameters)
    first = {**DEFAULT_INPUTS, **scenario.changes[0][1]}
    return integrate(car, car.rolling(scenario.speed, first['grade']), scenario.changes,
                     scenario.duration, **tolerances)


@cache
def run(name, **tolerances):
    """Return the ``Run`` of one of the scenarios, by its name."""
    return run_of(SCENARIOS[name], **tolerances)


def books(run):
    """
    Return (work, losses, parametric, change) of a run in J: work and losses by kind.

    ``change`` is that of the energy while inputs were held: where an input changes the stored
    energy at once, as a brake pressure does, that jump is in none of the four.
    """
    names = [*run.car.names, 'position']
    nodes, weights = np.polynomial.legendre.leggauss(3)
    work, losses, parametric, change = {}, {}, 0.0, 0.0
    for begin, end, inputs, solution in run.pieces:
        def at(time, solution=solution):
            return dict(zip(names, solution.sol(time).tolist()))
        change += run.car.energy(at(end), inputs) - run.car.energy(at(begin), inputs)
        for start, stop in zip(solution.t[:-1], solution.t[1:]):
            for node, weight in zip(nodes, weights):
                state = at((start + stop + node * (stop - start)) / 2.0)
                derivatives, look = run.car.evaluate(state, inputs)
                share = weight * (stop - start) / 2.0
                parametric += share * run.car.parametric(state, inputs, derivatives)
                for sums, powers in ((work, look['work']), (losses, look['losses'])):
                    for kind, power in powers.items():
                        sums[kind] = sums.get(kind, 0.0) + share * power
    return work, losses, parametric, change
