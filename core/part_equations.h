/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * A part of the adaptive step, made of REAL: see dm_ros/motion/adaptive.py and real.h.
 *
 * EVALUATE, JACOBIAN, BENDS and APPLY_PHI_2 are those of its includer.
 */

static const double BACKWARD = 3.0, SAFETY = 0.8, SHRINK = 0.1, GROW = 5.0;

/* Return the length of the next part after one of length h with an error over the allowed. */
static double next_part(double h, double error, double left)
{
    double scale = error > 1e-3 ? SAFETY * pow(error, -1.0 / 3) : GROW;
    scale = scale > SHRINK ? scale : SHRINK;
    h *= scale < GROW ? scale : GROW;
    return h > 0.999 * left ? left : h;
}

/* Return h (3 I - |h| J)^-1 (f(there) - f(here) - J d) of two points that are d apart. */
static OF(pair) nonlinear_part(OF(step) *job, const OF(point) *here, const OF(point) *there,
                               OF(matrix) J, REAL h, REAL d_w, REAL d_s)
{
    const REAL D_w = h * (there->e_0 - here->e_0 - J.ww * d_w - J.ws * d_s);
    const REAL D_s = h * (there->e_s - here->e_s - J.sw * d_w - J.ss * d_s);
    const REAL k = absolute(h);
    const REAL a = 3 - k * J.ww, b = k * J.ws, c = k * J.sw, d = 3 - k * J.ss;
    const REAL det = a * d - b * c;
    return (OF(pair)){OF(quotient)(job, d * D_w + b * D_s, det),
                      OF(quotient)(job, c * D_w + a * D_s, det)};
}

/* What a trial of a part finds: its way, that of y + d, and how far off it may be. */
typedef struct {
    OF(pair) d, c, integral;
    REAL error;
    MASK has_slopes;      /* whether it found those at its end */
    OF(slopes) at_end;
} OF(trial);

static void try_part(OF(step) *job, const OF(point) *here, OF(matrix) J, REAL w, REAL s, REAL h,
                     double relative, OF(point) *there, OF(trial) *found)
{
    const REAL f_w = here->e_0, f_s = here->e_s;
    const REAL z_ww = h * J.ww, z_ws = h * J.ws, z_sw = h * J.sw, z_ss = h * J.ss;
    const OF(pair) v = APPLY_PHI_2(job, z_ww, z_ws, z_sw, z_ss, f_w, f_s);
    const REAL d_w = h * (f_w + z_ww * v.w + z_ws * v.s);
    const REAL d_s = h * (f_s + z_sw * v.w + z_ss * v.s);
    EVALUATE(job, w + d_w, s + d_s, there);
    const OF(pair) c = nonlinear_part(job, here, there, J, h, d_w, d_s);
    const REAL allowed = job->tolerance + relative * (absolute(d_w) + absolute(d_s));
    REAL error = OF(quotient)(job, absolute(c.w) + absolute(c.s), allowed);
    const MASK fits = (error <= 1.0) & OF(watched)(job);
    found->has_slopes = fits & no_mask();
    if (any(fits)) {
        const MASK before = OF(watch)(job, fits);
        EVALUATE(job, w + d_w + c.w, s + d_s + c.s, there);
        const MASK bent = fits & BENDS(job, here, there);
        if (any(bent)) {
            OF(watch)(job, bent);
            found->at_end = JACOBIAN(job, there);
            found->has_slopes = bent;
            const OF(pair) r = nonlinear_part(job, there, here, found->at_end.J, -h, -d_w - c.w,
                                              -d_s - c.s);
            const REAL seen = OF(quotient)(job, absolute(r.w) + absolute(r.s),
                                           BACKWARD * allowed);
            error = pick(bent & (seen > error), seen, error);
        }
        OF(watch)(job, before);
    }
    found->d = (OF(pair)){d_w, d_s};
    found->c = c;
    found->integral = (OF(pair)){h * (w + h * v.w), h * (s + h * v.s)};
    found->error = error;
}
