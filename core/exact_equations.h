/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exact steps, and what must hold on their way, made of REAL: see dm_ros/motion/held_torque.py,
 * patterns.py and real.h.
 */

static const double SATURATED = 20.0;

static inline REAL response_to(const REAL *row, OF(pair) x, const REAL *T)
{
    return row[0] * x.w + row[1] * x.s + row[2] * T[0] + row[3] * T[1] + row[4] * T[2];
}

static inline void exact_step(const OF(exact) *map, OF(pair) x, const REAL *T, OF(pair) *end,
                              OF(pair) *integral)
{
    *end = (OF(pair)){response_to(map->step[0], x, T), response_to(map->step[1], x, T)};
    *integral = (OF(pair)){response_to(map->step[2], x, T), response_to(map->step[3], x, T)};
}

/* Return where the carrier and the outputs are so fast that every sigma is 1 or -1. */
static inline MASK is_fast(const OF(coefficients) *k, OF(pair) x)
{
    const REAL w = x.w, k_1s = k->k_1 * x.s, k_2s = k->k_2 * x.s;
    const REAL fast = SATURATED * k->sign_speed;
    return ((w > fast) | (w < -fast)) & ((w + k_1s > fast) | (w + k_1s < -fast))
        & ((w - k_2s > fast) | (w - k_2s < -fast));
}

/* Return the number of the signs at a point, and of that of the input torque; 0 is none. */
static inline MASK number_of_signs(const OF(point) *at, REAL T_in)
{
    const OF(signs) *s = &at->sign;
    const REAL numbers[] = {at->state[2], at->state[3], at->state[4], s->s_1, s->s_2, s->s_F,
                            s->h_N, s->b};
    MASK key = no_mask();
    key = with_digit(key, opposite(key));
    for (int n = 0; n < 8; n++)
        key = with_digit(key, numbers[n] > 0.0);
    return with_digit(key, T_in >= 0.0);
}

/* Return where every sign holds on the way of a step. */
static inline MASK holds(const OF(way) *p, OF(pair) x, const REAL *T, OF(pair) end)
{
    const REAL *a = p->slope[0], *b = p->slope[1];
    const REAL b_w = a[2] * T[0] + a[3] * T[1] + a[4] * T[2];
    const REAL b_s = b[2] * T[0] + b[3] * T[1] + b[4] * T[2];
    const REAL v_w = a[0] * x.w + a[1] * x.s + b_w, v_s = b[0] * x.w + b[1] * x.s + b_s;
    const REAL v_w_end = a[0] * end.w + a[1] * end.s + b_w;
    const REAL v_s_end = b[0] * end.w + b[1] * end.s + b_s;
    MASK all = opposite(T[0] * p->input_sign < 0.0) & (absolute(v_w) + absolute(v_s) < FASTEST);
    for (int n = 0; n < KEPT && any(all); n++) {
        const REAL *c = p->kept[n];
        const REAL held = c[2] * T[0] + c[3] * T[1] + c[4] * T[2] - c[5];
        const REAL f = c[0] * x.w + c[1] * x.s + held;
        const REAL f_end = c[0] * end.w + c[1] * end.s + held;
        const REAL slope = c[0] * v_w + c[1] * v_s;
        const REAL slope_end = c[0] * v_w_end + c[1] * v_s_end;
        const REAL down = p->reach[0] * absolute(slope) + p->reach[1] * absolute(slope_end);
        all &= (f > 0.0) & (f_end > 0.0)
            & opposite((slope * slope_end < 0.0) & (pick(f < f_end, f, f_end) <= down));
    }
    return all;
}
