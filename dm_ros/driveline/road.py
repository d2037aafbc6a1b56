# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Wheels with brakes and tyres, and the body that they carry."""

from typing import NamedTuple

import numpy as np

from dm_ros.driveline import brake, tyre
from dm_ros.driveline.body import Body, G, slope
from dm_ros.driveline.state import places


class Given(NamedTuple):
    """What is held in a tick, as the equations need it."""

    torque: float     # N m, on the input
    brakes: tuple     # N m, capacity of each
    steer: float      # rad
    grade: float      # tangent
    grip: tuple
    contact: tuple
    wind: float       # m/s, from ahead


class RoadPoint(NamedTuple):
    """What is known of wheels and body at one state."""

    omega: list      # rad/s^2, of the wheels
    pads: list       # 1/s, dy/dt
    kappa: list      # 1/s, dkappa/dt
    alpha: list
    body: list       # m/s^2, (rad/s^2), of (v_x, v_y, r)
    force: tuple     # m/s^2, the specific force (f_x, f_y)
    A: list          # m/s^3, of the lagged one
    loads: list      # N
    tyres: list      # (mu, mu per newton, ``tyre.contact``)
    brakes: list     # (T_cap, lost/T_cap)
    drag: float      # N


class Road:
    """
    Wheels and body of an ``Assembly``.

    :param layout: of the state; planar: whether the body moves sideways and yaws too.
    """

    def __init__(self, assembly, layout, planar):
        p = self._p = assembly.vehicle
        self._layout, self._planar = layout, planar
        self.wheels = tuple(assembly.wheels)
        self._body = Body(p, self.wheels)
        self._tyre = tyre.coefficients(p)
        self._brake = p.pad, p.c_b, p.w_low
        self._carcass = tyre.Carcass(self._tyre)
        self._none = [0.0] * len(self.wheels)
        self._parts = self._lay_out_jacobian()
        self._steer = None

    def _turn(self, steer):
        """Prepare for a steering angle; it is kept until there is another."""
        self._frames = self._body.frames(steer)
        self._steer, self._rows = steer, None

    def at(self, x, load, given):
        """
        Return the ``RoadPoint`` at a state.

        :param load: torques of the shafts on the wheels, N m; given: ``Given``.
        """
        if given.steer != self._steer:
            self._turn(given.steer)
        p, k, layout = self._p, self._tyre, self._layout
        R, C_rr, I_w = p.R, p.C_rr, p.I_w
        v_x, v_y, r = self.twist(x)
        A_x, A_y = self._lagged(x)
        sine, cosine = slope(given.grade)
        loads = self._body.loads(A_x, A_y, cosine, given.contact)
        F_x = F_y = M_z = 0.0
        omegas, pads, kappas, alphas, tyres, brakes = [], [], [], [], [], []
        for (c, s, X, Y), omega, y, kappa, alpha, F_z, torque, capacity, grip in zip(
                self._frames, x[layout.wheels], x[layout.pads], x[layout.kappa],
                x[layout.alpha] or self._none, loads, load, given.brakes, given.grip):
            mu, mu_slope = tyre.friction(k, grip, F_z)
            contact = tyre.contact(k, mu, F_z, kappa, alpha, R * omega,
                                   c * v_x + s * v_y + X * r, c * v_y - s * v_x + Y * r)
            along, across, kappa_rate, alpha_rate = contact[:4]
            T_cap = capacity + C_rr * F_z * R
            share, pad_rate, lost = brake.friction(*self._brake, omega, y)
            F_x += c * along - s * across
            F_y += s * along + c * across
            M_z += X * along + Y * across
            omegas.append((torque - R * along - T_cap * share) / I_w)
            pads.append(pad_rate)
            kappas.append(kappa_rate)
            alphas.append(alpha_rate)
            tyres.append((mu, mu_slope, contact))
            brakes.append((T_cap, lost))
        drag, _ = self._body.drag(v_x, given.wind)
        f_x, f_y = (F_x - drag) / p.m, F_y / p.m
        if self._planar:
            body = [f_x - G * sine + r * v_y, f_y - r * v_x, M_z / p.I_z]
            A = [(f_x - A_x) / p.load_time, (f_y - A_y) / p.load_time]
        else:
            body, A, alphas = [f_x - G * sine], [(f_x - A_x) / p.load_time], []
        return RoadPoint(omegas, pads, kappas, alphas, body, (f_x, f_y), A, loads, tyres, brakes,
                         drag)

    def twist(self, x):
        """Return (v_x, v_y, r)."""
        body = x[self._layout.body]
        return body if self._planar else (body[0], 0.0, 0.0)

    def _lagged(self, x):
        A = x[self._layout.A]
        return A if self._planar else (A[0], 0.0)

    def rolling(self, v_x, grade):
        """Return the state (n,) of rolling with v_x, m/s, on a grade; what is not here is 0."""
        layout = self._layout
        x = [0.0] * len(layout)
        for place in places(layout.wheels):
            x[place] = v_x / self._p.R
        for place in places(layout.pads):
            x[place] = 1.0 if v_x > 0.0 else -1.0 if v_x < 0.0 else 0.0
        x[layout.body.start], x[layout.A.start] = v_x, G * slope(grade)[0]
        return x

    # -- Jacobian: what the state does to each contact, the contacts to the rates, and the rest --

    def _lay_out_jacobian(self):
        """
        Return contacts per state (3, wheels, 5, n) and rates per contact (3, wheels, 4, n).

        Both are [0] + c [1] + s [2] in the ``Frame`` of each wheel, whose X and Y are such too.
        """
        layout, p = self._layout, self._p
        n, count = len(layout), len(self.wheels)
        inner, outer = np.zeros((3, count, 5, n)), np.zeros((3, count, 4, n))
        body, A = places(layout.body), places(layout.A)
        per_force = [(body[0], 1 / p.m), (A[0], 1 / (p.m * p.load_time))]
        if self._planar:
            across = [(body[1], 1 / p.m), (A[1], 1 / (p.m * p.load_time))]
        for w, wheel in enumerate(self.wheels):
            omega, kappa = places(layout.wheels)[w], places(layout.kappa)[w]
            inner[0, w, 0, kappa], inner[0, w, 2, omega] = 1.0, p.R
            outer[0, w, 0, omega], outer[0, w, 2, kappa] = -p.R / p.I_w, 1.0
            inner[1, w, 3, body[0]], inner[2, w, 4, body[0]] = 1.0, -1.0
            for place, per in per_force:
                outer[1, w, 0, place], outer[2, w, 1, place] = per, -per
            if self._planar:
                x, y = wheel.x, wheel.y
                alpha = places(layout.alpha)[w]
                inner[0, w, 1, alpha] = outer[0, w, 3, alpha] = 1.0
                inner[1, w, 3:, body[1:]] = (0.0, 1.0), (-y, x)
                inner[2, w, 3:, body[1:]] = (1.0, 0.0), (x, y)
                for place, per in across:
                    outer[2, w, 0, place], outer[1, w, 1, place] = per, per
                outer[1, w, :2, body[2]] = -y / p.I_z, x / p.I_z
                outer[2, w, :2, body[2]] = x / p.I_z, y / p.I_z
        return inner, outer

    def own_places(self):
        """Return (row, column) of what ``slopes`` returns first."""
        layout, body = self._layout, places(self._layout.body)
        own = [entry for w, y in zip(places(layout.wheels), places(layout.pads))
               for entry in ((w, w), (w, y), (y, w), (y, y))]
        own += [(body[0], body[0]), (places(layout.A)[0], body[0])]
        if self._planar:
            own += [(body[0], body[1]), (body[0], body[2]), (body[1], body[0]),
                    (body[1], body[2])]
        return own

    def slopes(self, x, point, given):
        """
        Return the slopes at ``own_places``, and 20 of each contact, see ``tyre.slopes``.

        The latter stand between ``geometry``. What the state A does is left out.
        """
        p, k, layout = self._p, self._tyre, self._layout
        v_x, v_y, r = self.twist(x)
        own, contacts = [], []
        for (c, s, X, _), omega, y, kappa, alpha, F_z, (mu, _, contact), (T_cap, _) in zip(
                self._frames, x[layout.wheels], x[layout.pads], x[layout.kappa],
                x[layout.alpha] or self._none, point.loads, point.tyres, point.brakes):
            share_w, share_y, rate_w, rate_y = brake.slopes(*self._brake, omega, y)
            per = -T_cap / p.I_w
            own += (per * share_w, per * share_y, rate_w, rate_y)
            contacts += tyre.slopes(k, mu, F_z, kappa, alpha, p.R * omega,
                                    c * v_x + s * v_y + X * r, contact)
        _, drag_v = self._body.drag(v_x, given.wind)
        own += (-drag_v / p.m, -drag_v / (p.m * p.load_time))
        if self._planar:
            own += (r, v_y, -r, -v_x)
        return own, contacts

    def geometry(self, steer):
        """Return contacts per state (wheels, 5, n) and rates per contact (n, 4 wheels)."""
        if steer != self._steer:
            self._turn(steer)
        if self._rows is None:
            frames = np.array(self._frames)
            c, s = frames[:, :1, None], frames[:, 1:2, None]
            inner, outer = [part[0] + c * part[1] + s * part[2] for part in self._parts]
            self._rows = inner, outer.reshape(-1, len(self._layout)).T
        return self._rows

    # -- books --

    def books(self, x, point, given):
        """
        Return what the books need.

        :return: the energy of wheels, brakes, tyres and body, J; by how much that of tyres and
            brakes grows with their load alone, W; what each tyre takes by slip and by damping,
            each brake, each rolling resistance and the drag, W.
        """
        p, layout = self._p, self._layout
        v_x, v_y, r = self.twist(x)
        energy = 0.5 * (p.m * (v_x * v_x + v_y * v_y) + p.I_z * r * r)
        A, rates = self._lagged(x), point.A if self._planar else (point.A[0], 0.0)
        load_rates = self._body.load_rates(*A, *rates, slope(given.grade)[1], given.contact)
        parametric = 0.0
        slips, dampings, brakes, rollings = [], [], [], []
        for omega, y, kappa, alpha, F_z, rate, (mu, mu_slope, contact), capacity, (
                T_cap, lost) in zip(
                    x[layout.wheels], x[layout.pads], x[layout.kappa],
                    x[layout.alpha] or self._none, point.loads, load_rates, point.tyres,
                    given.brakes, point.brakes):
            stored, per_load = self._carcass.energy(mu, mu_slope, F_z, contact)
            pads = 0.5 * p.pad * y * y
            energy += stored + T_cap * pads + 0.5 * p.I_w * omega * omega
            parametric += (per_load + p.C_rr * p.R * pads) * rate
            slip, damping = tyre.lost_powers(mu, F_z, kappa, alpha, contact)
            slips.append(slip)
            dampings.append(damping)
            brakes.append(capacity * lost)
            rollings.append((T_cap - capacity) * lost)
        return energy, parametric, [*slips, *dampings, *brakes, *rollings,
                                    point.drag * (v_x + given.wind)]
