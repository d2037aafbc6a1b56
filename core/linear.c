/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exact steps: see dm_ros/motion/held_torque.py, exponentials.py, quadrature.py and meters.py.
 */

#include "exponentials.h"
#include "linear.h"
#include "quadrature.h"
#include "real.h"

#include "exact_equations.h"

/* A 2x2 matrix, (11, 12, 21, 22). */
typedef struct {
    double a, b, c, d;
} square;

static square product(square x, square y)
{
    return (square){x.a * y.a + x.b * y.c, x.a * y.b + x.b * y.d,
                    x.c * y.a + x.d * y.c, x.c * y.b + x.d * y.d};
}

/* Put phi_1(Z) and phi_2(Z) into first and second. */
static void phi_matrices(square z, square *first, square *second)
{
    const double upper = fabs(z.a) + fabs(z.b), lower = fabs(z.c) + fabs(z.d);
    const double size = lower > upper ? lower : upper;
    int exponent = 0;
    if (isfinite(size))
        frexp(size, &exponent);
    const int doublings = exponent + 2 > 0 ? exponent + 2 : 0;
    const square small = {ldexp(z.a, -doublings), ldexp(z.b, -doublings),
                          ldexp(z.c, -doublings), ldexp(z.d, -doublings)};
    square p = {1.0, 0.0, 0.0, 1.0};
    for (int n = 16; n > 2; n--) {
        const square q = product(small, p);
        p = (square){1 + q.a / n, q.b / n, q.c / n, 1 + q.d / n};
    }
    *second = (square){p.a / 2, p.b / 2, p.c / 2, p.d / 2};
    p = product(small, *second);
    *first = (square){1 + p.a, p.b, p.c, 1 + p.d};
    p = product(small, *first);
    p.a = 1 + p.a;
    p.d = 1 + p.d;
    for (int n = 0; n < doublings; n++) {
        const square f = product(*first, *first);
        *second = (square){(f.a + 2 * second->a) / 4, (f.b + 2 * second->b) / 4,
                           (f.c + 2 * second->c) / 4, (f.d + 2 * second->d) / 4};
        const square g = product((square){1 + p.a, p.b, p.c, 1 + p.d}, *first);
        *first = (square){g.a / 2, g.b / 2, g.c / 2, g.d / 2};
        p = product(p, p);
    }
}

static void make_step(double step[4][5], const response *r, double h)
{
    const square A = {r->A[0][0], r->A[0][1], r->A[1][0], r->A[1][1]};
    square phi[2];
    phi_matrices((square){h * A.a, h * A.b, h * A.c, h * A.d}, &phi[0], &phi[1]);
    for (int n = 0; n < 2; n++) {   /* the speeds, then their integrals */
        const double of_x = n ? h : 1.0, of_slope = n ? h * h : h;
        const square p = product(phi[n], A);
        double *w = step[2 * n], *s = step[2 * n + 1];
        w[0] = of_x + of_slope * p.a;
        w[1] = of_slope * p.b;
        s[0] = of_slope * p.c;
        s[1] = of_x + of_slope * p.d;
        for (int j = 0; j < 3; j++) {
            w[2 + j] = of_slope * (phi[n].a * r->B[0][j] + phi[n].b * r->B[1][j]);
            s[2 + j] = of_slope * (phi[n].c * r->B[0][j] + phi[n].d * r->B[1][j]);
        }
    }
}

/* See quadrature.second_moment_of_the_way; return 0 where a number is divided by zero. */
static int make_second(double *second, const response *r, double h)
{
    const matrix A = {r->A[0][0], r->A[0][1], r->A[1][0], r->A[1][1]};
    const rule *nodes = dm_rule_for(A, h, 1);
    square phi, other;
    step job = {0};
    pair ways[2][MOST_NODES];
    phi_matrices((square){h * A.ww, h * A.ws, h * A.sw, h * A.ss}, &phi, &other);
    const double det = h * (phi.a * phi.d - phi.b * phi.c);
    const pair slopes[2] = {
        {quotient(&job, phi.d, det), quotient(&job, -phi.c, det)},
        {quotient(&job, -phi.b, det), quotient(&job, phi.a, det)}};
    if (job.broken)
        return 0;
    for (int n = 0; n < 2; n++)
        dm_way(&job, A, slopes[n], h, nodes->count, nodes->r, ways[n]);
    for (int n = 0; n < 9; n++)
        second[n] = n % 4 ? 0.0 : nodes->end;
    for (int i = 0; i < nodes->count; i++) {
        const double p_1 = ways[0][i].w, p_2 = ways[0][i].s;
        const double q_1 = ways[1][i].w, q_2 = ways[1][i].s;
        const double x[9] = {p_1 * p_1, 2 * p_1 * q_1, q_1 * q_1,
                             p_1 * p_2, p_1 * q_2 + q_1 * p_2, q_1 * q_2,
                             p_2 * p_2, 2 * p_2 * q_2, q_2 * q_2};
        for (int n = 0; n < 9; n++)
            second[n] += nodes->weight[i] * x[n];
    }
    for (int n = 0; n < 9; n++)
        second[n] = h * second[n];
    return !job.broken;
}

int dm_make_linear(linear *made, const response *r, const losses_without_clutches *lost, double h)
{
    make_step(made->map.step, r, h);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 2; j++)
            made->map.moments[i][j] = r->P[i][j];
        for (int j = 0; j < 3; j++)
            made->map.moments[i][2 + j] = r->Q[i][j];
    }
    made->lost = *lost;
    return make_second(made->second, r, h);
}

void dm_exact_step(const linear *exact, pair x, const double *T, pair *end, pair *integral)
{
    exact_step(&exact->map, x, T, end, integral);
}

void dm_exact_moments(const linear *exact, pair x, const double *T, double *moments)
{
    for (int n = 0; n < 3; n++)
        moments[n] = response_to(exact->map.moments[n], x, T);
}

void dm_exact_book(const linear *exact, double g_F, double h, pair x, pair end, pair integral,
                   const double *T, double *work, double *lost)
{
    const double w = x.w, s = x.s, a_w = integral.w, a_s = integral.s;
    const double *k = exact->second;
    const double d_w = end.w - w, d_s = end.s - s;
    const double d_ww = d_w * d_w, d_ws = d_w * d_s, d_ss = d_s * d_s;
    const double b_w = a_w - h * w, b_s = a_s - h * s;
    const double X_ww = w * (a_w + b_w) + k[0] * d_ww + k[1] * d_ws + k[2] * d_ss;
    const double X_ws = w * a_s + s * b_w + k[3] * d_ww + k[4] * d_ws + k[5] * d_ss;
    const double X_ss = s * (a_s + b_s) + k[6] * d_ww + k[7] * d_ws + k[8] * d_ss;
    double M[3], M_w[3];   /* the moments of the torques, and their products with w */
    for (int n = 0; n < 3; n++) {
        const double *row = exact->map.moments[n];
        M[n] = row[2] * T[0] + row[3] * T[1] + row[4] * T[2];
        M_w[n] = row[0] * X_ww + row[1] * X_ws + M[n] * a_w;
    }
    const double *M_1 = exact->map.moments[1], *M_2 = exact->map.moments[2];
    const double T_3_w3 = T[0] * g_F * a_w;
    const losses_without_clutches *q = &exact->lost;
    lost[0] = q->drag_w * X_ww + q->drag_s * X_ss;
    lost[1] = q->mesh_F * M_w[0];
    lost[2] = q->mesh_1 * (M_w[1] + (M_1[0] * X_ws + M_1[1] * X_ss + M[1] * a_s) / 2);
    lost[3] = q->mesh_2 * (M_w[2] - (M_2[0] * X_ws + M_2[1] * X_ss + M[2] * a_s) / 2);
    lost[4] = q->pinion_L * q->pinion_w * X_ww + q->pinion_F * M_w[0] + q->pinion_T * T_3_w3;
    lost[5] = (q->carrier_L * (q->carrier_w * X_ww - q->carrier_s * X_ws)
               + q->carrier_1 * M_w[1] + q->carrier_2 * M_w[2] + q->carrier_F * M_w[0]);
    work[0] = T_3_w3;
    work[1] = T[1] * (a_w + a_s / 2);
    work[2] = T[2] * (a_w - a_s / 2);
}
