/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The exact steps of a symmetric differential under the passive law, by the pattern of its signs:
 * see dm_ros/motion/patterns.py.
 */

#include <stddef.h>

#include "linear.h"

#include "real.h"

#include "exact_equations.h"

static const double MARGIN = 1e-9;

int dm_has_pattern(const coefficients *k, pair x)
{
    return is_fast(k, x);
}

/* Put the largest share into share; return 0 where a number is divided by zero. */
static int largest_share(double high, double low, double h, double *share)
{
    const double top = low * high > 0.0 ? log(low / high) / (high - low) : h;
    *share = 1.0;
    if (!(0.0 < top && top < h))
        return 1;
    const double a = exp(high * (top - h)), b = expm1((low - high) * top);
    const double c = expm1((low - high) * h);
    if (isinf(a) || isinf(b) || isinf(c)) {   /* which Python calls an overflow */
        *share = INFINITY;
        return 1;
    }
    if (c == 0.0)
        return 0;
    const double found = a * b / c;
    if (found > 1.0)
        *share = found;
    return 1;
}

static int reach_of_slopes(double A[2][2], double h, double *reach)
{
    const double mean = (A[0][0] + A[1][1]) / 2, half = (A[0][0] - A[1][1]) / 2;
    const double square = half * half + A[0][1] * A[1][0];
    if (!(square > 0.0))
        return 0;
    const double root = sqrt(square), high = mean + root, low = mean - root;
    if (!largest_share(-high, -low, h, &reach[0]) || !largest_share(high, low, h, &reach[1]))
        return 0;
    reach[0] = h / 2 * reach[0];
    reach[1] = h / 2 * reach[1];
    return 1;
}

/* Put a x + b y + z of rows into sum. */
static void row(double *sum, double a, const double *x, double b, const double *y,
                const double *z)
{
    for (int n = 0; n < 5; n++)
        sum[n] = a * x[n] + b * y[n] + z[n];
}

/* Make the pattern of the signs at a point; return 0 where its step is not exact. */
static int make(pattern *made, const coefficients *k, double h, const point *at,
                double input_sign)
{
    const double s_1 = at->sign.s_1, s_2 = at->sign.s_2, s_F = at->sign.s_F;
    const double h_N = at->sign.h_N, b = at->sign.b;
    const double sigma_0 = at->state[2], sigma_1 = at->state[3], sigma_2 = at->state[4];
    const double n_1 = at->solved[0], n_2 = at->solved[1], p_1 = at->solved[2];
    const double p_2 = at->solved[3], m_1 = at->solved[4], m_2 = at->solved[5];
    step job = {.law = &dm_passive, .coefficients = k, .u = {input_sign}};
    const matrix J = job.law->jacobian(&job, at).J;
    response r = {.A = {{J.ww + 0.0, J.ws + 0.0}, {J.sw + 0.0, J.ss + 0.0}}};
    job.law->torque_slopes(&job, at, r.B[0], r.B[1]);
    double (*e)[5] = made->way.slope, M[3][5], N[5], bracket[5];
    for (int n = 0; n < 2; n++) {
        for (int j = 0; j < 2; j++)
            e[n][j] = r.A[n][j];
        for (int j = 0; j < 3; j++)
            e[n][2 + j] = r.B[n][j];
    }

    const double n_F = k->mean_F + k->half_F * sigma_0 * s_F;
    const double c_F = k->mean_F - k->half_F * sigma_0 * s_F;
    const double drives = sigma_0 * s_F > 0.0, brakes = sigma_0 * s_F < 0.0;
    const double input_brakes = sigma_0 * k->g_F * input_sign < 0.0;
    const double per_torque = quotient(&job, k->g_F, (1 + k->bearing_3 * drives) * n_F);
    const double q_1 = quotient(&job, k->l_1 * k->k_1, p_1);
    const double q_2 = quotient(&job, -k->l_2 * k->k_2, p_2);
    const double none[5] = {0.0};
    row(M[1], m_1, e[0], m_1 * k->k_1, e[1],
        (double[]){0.0, q_1, 0.0, quotient(&job, -1, p_1), 0.0});
    row(M[2], m_2, e[0], -m_2 * k->k_2, e[1],
        (double[]){0.0, q_2, 0.0, 0.0, quotient(&job, -1, p_2)});
    row(M[0], -per_torque * k->I_3 * k->g_F, e[0], 0.0, e[1],
        (double[]){-per_torque * (1 + k->bearing_3) * k->l_3 * k->g_F, 0.0,
                   per_torque * (1 + k->bearing_3 * input_brakes), 0.0, 0.0});
    row(N, n_1, M[1], n_2, M[2], none);
    row(bracket, h_N, N, -brakes * c_F, M[0],
        (double[]){k->l_0, -k->l_1 * k->k_1 + k->l_2 * k->k_2, 0.0, 0.0, 0.0});

    const double fast = SATURATED * k->sign_speed;
    const double speeds[3][6] = {
        {sigma_0, 0.0, 0.0, 0.0, 0.0, fast},
        {sigma_1, sigma_1 * k->k_1, 0.0, 0.0, 0.0, fast},
        {sigma_2, -sigma_2 * k->k_2, 0.0, 0.0, 0.0, fast}};
    const double sign[5] = {s_F, s_1, s_2, (2 * h_N - 1) * sigma_0, (2 * b - 1) * sigma_0};
    const double *moments[5] = {M[0], M[1], M[2], N, bracket};
    for (int n = 0; n < KEPT; n++) {
        for (int j = 0; j < 6; j++)
            made->way.kept[n][j] = n < 3 ? speeds[n][j] : j < 5 ? sign[n - 3] * moments[n - 3][j]
                                                            : MARGIN;
    }
    if (job.broken || !reach_of_slopes(r.A, h, made->way.reach))
        return 0;
    for (int n = 0; n < KEPT; n++)
        for (int j = 0; j < 6; j++)
            if (!isfinite(made->way.kept[n][j]))
                return 0;
    for (int n = 0; n < 2; n++)
        for (int j = 0; j < 5; j++)
            if (!isfinite(e[n][j]))
                return 0;

    for (int n = 0; n < 3; n++) {
        for (int j = 0; j < 2; j++)
            r.P[n][j] = M[n][j];
        for (int j = 0; j < 3; j++)
            r.Q[n][j] = M[n][2 + j];
    }
    const double bearing_3 = k->bearing_3, bearing_0 = k->bearing_0 * b;
    const double g_3 = k->l_3 * k->g_F * k->g_F;
    const losses_without_clutches lost = {
        k->l_0 + g_3, k->l_1 * k->k_1 * k->k_1 + k->l_2 * k->k_2 * k->k_2 + k->l_s * k->k_2, g_3,
        k->l_0, k->l_1 * k->k_1 - k->l_2 * k->k_2,
        2 * k->half_F * s_F * sigma_0, 2 * k->half_1 * s_1 * sigma_1,
        2 * k->half_2 * s_2 * sigma_2,
        bearing_3 * drives * n_F, -bearing_3 * input_brakes, bearing_3,
        bearing_0 * h_N * n_1, bearing_0 * h_N * n_2, -bearing_0 * brakes * c_F, bearing_0};
    made->way.input_sign = input_sign;
    return dm_make_linear(&made->exact, &r, &lost, h);
}

const pattern *dm_pattern_at(patterns *known, const coefficients *k, double h, double T_in,
                             const point *at)
{
    const int key = number_of_signs(at, T_in);
    for (int n = 0; n < known->met; n++)
        if (known->kept[n].key == key) {
            known->last = n;
            return known->kept[n].is_none ? NULL : &known->kept[n];
        }
    /* where there is no room, the oldest goes */
    const int place = known->met < known->room ? known->met++ : known->next;
    known->next = (place + 1) % known->room;
    known->last = place;
    pattern *made = &known->kept[place];
    made->key = key;
    made->is_none = !make(made, k, h, at, T_in >= 0.0 ? 1.0 : -1.0);
    return made->is_none ? NULL : made;
}

int dm_pattern_step(const pattern *p, pair x, const double *T, pair *end, pair *integral)
{
    dm_exact_step(&p->exact, x, T, end, integral);
    return holds(&p->way, x, T, *end);
}
