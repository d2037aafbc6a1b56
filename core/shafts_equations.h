/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The shafts of a differential, made of REAL: see dm_ros/mechanism/ports.py and real.h.
 */

/* Put the speeds of all shafts into speeds, from x, or their angles. */
static inline void speeds_of(REAL g_F, REAL k_1, REAL k_2, REAL g_2s, const REAL *x, REAL *speeds)
{
    const REAL spin = (0.0 - x[1]) * k_2 / g_2s;
    speeds[0] = x[0];
    speeds[1] = x[0] + k_1 * x[1];
    speeds[2] = x[0] - k_2 * x[1];
    speeds[3] = pick(g_F != 0.0, g_F * x[0], spin);
    speeds[4] = spin;
}

/* Return the power-flow index under the passive law. */
static inline REAL flow_of_input(REAL T_in, REAL g_F, REAL w, REAL sign_speed, REAL deadband,
                                 REAL last)
{
    const REAL power = T_in * pick(g_F != 0.0, g_F, fill(1.0)) * w;
    const MASK turning = absolute(w) > sign_speed;
    return pick(turning & (power > deadband), fill(1.0),
                pick(turning & (power < -deadband), fill(-1.0), last));
}

/* Return the friction at full slip of a clutch that a force presses. */
static inline REAL pressed_friction(MASK is_pressed, REAL preload, REAL f, REAL force, REAL radius)
{
    return pick(is_pressed, preload + f * force * radius, preload);
}

/* Return the force of an actuator after a tick in which it is commanded. */
static inline REAL force_after(REAL force, REAL command, REAL limit, REAL rise)
{
    const REAL least = pick(limit < command, limit, command);
    return pick(rise == 1.0, least, force + (least - force) * rise);
}
