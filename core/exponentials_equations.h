/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * phi_2 of a 2x2 matrix of two modes apart, made of REAL: see dm_ros/motion/exponentials.py and
 * real.h.
 */

static const double STEEPEST = 300.0, SMALL = 0.02, APART = 1e-4;

static REAL phi_2(OF(step) *job, REAL z)
{
    const MASK is_small = absolute(z) < SMALL;
    const REAL series = (1.0 / 2 + z * (1.0 / 6 + z * (1.0 / 24 + z * (1.0 / 120 + z * (
        1.0 / 720 + z / 5040)))));
    if (!any(opposite(is_small)))
        return series;
    const REAL bounded = pick(STEEPEST < z, fill(STEEPEST), z);
    const REAL square = pick(is_small, fill(1.0), z * z);
    return pick(is_small, series,
                OF(quotient)(job, expm1_of(bounded, opposite(is_small)) - z, square));
}

/* Return phi_2(Z) v, where Z has the modes mean + root and mean - root. */
static OF(pair) of_two_modes(OF(step) *job, REAL mean, REAL root, REAL z_11, REAL z_12, REAL z_21,
                             REAL z_22, REAL v_1, REAL v_2)
{
    const REAL high = mean + root, low = mean - root;
    const REAL value = phi_2(job, high);
    const REAL slope = (value - phi_2(job, low)) / (2 * root);
    return (OF(pair)){value * v_1 + slope * ((z_11 - high) * v_1 + z_12 * v_2),
                      value * v_2 + slope * (z_21 * v_1 + (z_22 - high) * v_2)};
}
