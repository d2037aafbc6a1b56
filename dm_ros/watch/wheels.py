# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What no topic tells of the wheels of a car, from what the topics tell: steering and grip."""

from math import atan2, hypot, pi

from dm_ros.driveline.tyre import coefficients, contact, friction

STANDS = 1e-6           # m/s of a wheel centre, below which it points nowhere
NEAR = 1e-9             # of a force, within which a grip explains it
LEAST, MOST = 1e-6, 1e3   # grip of a road that is looked for
HALVINGS = 60
STEEP = 1e-3            # slip stiffness times slip over the load, below which any grip will do


def angle_between(one, other):
    """Return the angle from one direction to another, in (-pi, pi], rad."""
    turned = atan2(other[1], other[0]) - atan2(one[1], one[0])
    return turned - 2.0 * pi * round(turned / (2.0 * pi))


class Wheels:
    """
    The wheels of a car as they are seen: each keeps what was last known of it.

    :param p: ``VehicleParameters``; places: (x, y) of each wheel before and to the left of the
        centre of mass, m; steered: how many of them are steered, the first ones.
    """

    def __init__(self, p, places, steered):
        self._R, self._tyre = p.R, coefficients(p)
        self._places, self._steered = places, steered
        self._steer = [0.0] * len(places)
        self._grip = [None] * len(places)

    def steer(self, speeds, slip_speeds, twist):
        """
        Return the angle of each wheel against the body, rad, to the left positive.

        The velocity of a wheel centre is known twice: in the body by how this moves, and in the
        wheel by tread and slip. While it stands the last angle holds.

        :param speeds: of the wheels, rad/s; slip_speeds: (V_sx, V_sy), m/s; twist: (v_x, v_y, r).
        """
        v_x, v_y, r = twist
        for n in range(self._steered):
            (x, y), (V_sx, V_sy) = self._places[n], slip_speeds[n]
            of_body = v_x - y * r, v_y + x * r
            of_wheel = self._R * speeds[n] - V_sx, -V_sy
            if hypot(*of_wheel) > STANDS:
                self._steer[n] = angle_between(of_wheel, of_body)
        return list(self._steer)

    def grip(self, speeds, slips, slip_speeds, forces, loads):
        """
        Return the friction mu between each tyre and the road, None where nothing tells it.

        It is the one value under which this tyre with this slip has this force; with hardly any
        slip, or in the air, all values do.
        """
        for n, measured in enumerate(zip(speeds, slips, slip_speeds, forces, loads)):
            self._grip[n] = self._found(self._grip[n], *measured)
        share = [friction(self._tyre, 1.0, load)[0] for load in loads]
        return [grip and grip * part for grip, part in zip(self._grip, share)]

    def _found(self, last, speed, slip, slip_speed, force, load):
        k, (kappa, alpha), (V_sx, V_sy) = self._tyre, slip, slip_speed
        if not load > 0.0 or hypot(k.K_x * kappa, k.K_y * alpha) < STEEP:
            return None
        U, size = self._R * speed, hypot(*force)
        share = friction(k, 1.0, load)[0]

        def under(grip):
            F_x, F_y, *_ = contact(k, grip * share, load, kappa, alpha, U, U - V_sx, -V_sy)
            return F_x, F_y

        def explains(grip):
            F_x, F_y = under(grip)
            return hypot(F_x - force[0], F_y - force[1]) <= NEAR * size
        if last and explains(last):   # as nearly always
            return last
        low, high = LEAST, MOST
        for _ in range(HALVINGS):
            middle = (low * high) ** 0.5
            if hypot(*under(middle)) < size:
                low = middle
            else:
                high = middle
        return middle if explains(middle) else None
