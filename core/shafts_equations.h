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

/* Put the speeds of the shafts with a port into speeds, from x, or their angles. */
static inline void port_speeds_of(REAL g_F, REAL k_1, REAL k_2, const REAL *x, REAL *speeds)
{
    speeds[0] = pick(g_F != 0.0, g_F, fill(1.0)) * x[0];
    speeds[1] = x[0] + k_1 * x[1];
    speeds[2] = x[0] - k_2 * x[1];
}

/* Return the power of the torque on the input shaft, at the carrier speed w. */
static inline REAL input_power(REAL T_in, REAL g_F, REAL w)
{
    return T_in * pick(g_F != 0.0, g_F, fill(1.0)) * w;
}

/* Return the power-flow index under the passive law. */
static inline REAL flow_of_input(REAL power, REAL w, REAL sign_speed, REAL deadband, REAL last)
{
    const MASK turning = absolute(w) > sign_speed;
    return pick(turning & (power > deadband), fill(1.0),
                pick(turning & (power < -deadband), fill(-1.0), last));
}

/* Return the power-flow index under the paper's law. */
static inline REAL flow_of_powers(REAL input, REAL output, REAL deadband, REAL last)
{
    const REAL excess = absolute(input) - absolute(output);
    const MASK falls = (excess < -deadband)
        | ((excess == deadband) & (deadband == 0.0) & (output != 0.0));
    return pick(excess > deadband, fill(1.0), pick(falls, fill(-1.0), last));
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
