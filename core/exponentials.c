/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exponentials of 2x2 matrices: see dm_ros/motion/exponentials.py.
 */

#include "exponentials.h"
#include "real.h"

#include "exponentials_equations.h"

static double bounded(double z)
{
    return STEEPEST < z ? STEEPEST : z;
}

/* Return phi_2 of a + ib, b > 0, as a real and an imaginary part. */
static pair complex_phi_2(step *job, double a, double b)
{
    if (fabs(a) + b < SMALL) {
        static const double starts[] = {1.0 / 120, 1.0 / 24, 1.0 / 6, 1.0 / 2};
        double p = 1.0 / 720 + a / 5040, q = b / 5040;
        for (int n = 0; n < 4; n++) {
            const double real = starts[n] + (a * p - b * q);
            q = a * q + b * p;
            p = real;
        }
        return (pair){p, q};
    }
    const double growth = exp(bounded(a));
    const double p = growth * cos(b) - 1.0 - a, q = growth * sin(b) - b;
    const double c = a * a - b * b, d = 2.0 * a * b;
    const double size = c * c + d * d;
    if (isinf(b))   /* of which Python takes no cosine */
        job->broken = 1;
    return (pair){quotient(job, p * c + q * d, size), quotient(job, q * c - p * d, size)};
}

pair dm_apply_phi_2(step *job, double z_11, double z_12, double z_21, double z_22, double v_1,
                 double v_2)
{
    const double mean = (z_11 + z_22) / 2, half = (z_11 - z_22) / 2;
    const double square = half * half + z_12 * z_21;
    const double root = sqrt(fabs(square));
    if (!(square < 0.0) && root > APART)
        return of_two_modes(job, mean, root, z_11, z_12, z_21, z_22, v_1, v_2);
    double center = mean + root, value, slope = 0.0;
    if (square < 0.0) {
        const pair turning = complex_phi_2(job, mean, root);
        center = mean;
        value = turning.w;
        slope = quotient(job, turning.s, root);
    } else {
        value = phi_2(job, center);
    }
    if (!(root > APART))
        slope = (phi_2(job, mean + 1e-3) - phi_2(job, mean - 1e-3)) / 2e-3;
    return (pair){value * v_1 + slope * ((z_11 - center) * v_1 + z_12 * v_2),
                  value * v_2 + slope * (z_21 * v_1 + (z_22 - center) * v_2)};
}

void dm_way(step *job, matrix J, pair f, double h, int count, const double *r, pair *path)
{
    const double mean = (J.ww + J.ss) / 2, half = (J.ww - J.ss) / 2;
    const double square = half * half + J.ws * J.sw;
    if (square > 1e-6 * mean * mean) {   /* two modes that are far from each other */
        const double root = sqrt(square);
        const double high = mean + root, low = mean - root;
        const double b_1 = quotient(job, (high - J.ww) * f.w - J.ws * f.s, 2 * root);
        const double b_2 = quotient(job, (high - J.ss) * f.s - J.sw * f.w, 2 * root);
        const double a_1 = f.w - b_1, a_2 = f.s - b_2;
        for (int n = 0; n < count; n++) {
            const double t = h * r[n];
            const double slow = high != 0.0 ? expm1(bounded(high * t)) / high : t;
            const double fast = low != 0.0 ? expm1(bounded(low * t)) / low : t;
            path[n] = (pair){a_1 * slow + b_1 * fast, a_2 * slow + b_2 * fast};
        }
    } else {
        for (int n = 0; n < count; n++) {
            const double t = h * r[n];
            const pair v = dm_apply_phi_2(job, t * J.ww, t * J.ws, t * J.sw, t * J.ss, f.w, f.s);
            path[n] = (pair){t * (f.w + t * (J.ww * v.w + J.ws * v.s)),
                             t * (f.s + t * (J.sw * v.w + J.ss * v.s))};
        }
    }
}
