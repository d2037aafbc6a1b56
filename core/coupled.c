/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The step with elastic shafts: see dm_ros/motion/coupled.py.
 */

#include <string.h>

#include "coupled.h"

static const double BACKWARD = 3.0, SAFETY = 0.8, SHRINK = 0.1, GROW = 5.0, LOOSE = 0.3;
enum { MOST_RESORTS = 1000 };

void dm_prepare_coupled(coupled_step *c, const coupling *of, const double *inputs,
                        const int *held, const double *S, double flow)
{
    const int reverse = flow < 0.0;
    step *job = &c->job;
    c->of = of;
    c->rows = 2;
    for (int n = 0; n < (int)of->count; n++) {
        const half_shaft *shaft = &of->shafts[n];
        if (held[(int)shaft->port]) {
            c->shafts[c->rows - 2] = shaft;
            c->scale[c->rows - 2] = sqrt(shaft->stiffness / shaft->inertia);
            c->rows += 1;
        }
    }
    memcpy(c->inputs, inputs, sizeof c->inputs);
    memcpy(c->S, S, sizeof c->S);
    job->seen = NULL;
    job->broken = c->coarse = 0;
    if (of->is_passive != 0.0) {
        c->inner = &dm_passive;
        job->coefficients = &of->law.passive;
        job->losses = NULL;
    } else {
        c->inner = of->is_symmetric != 0.0 ? &dm_clutched_symmetric : &dm_clutched;
        job->coefficients = &of->law.paper.k[reverse];
        job->losses = &of->law.paper.losses[reverse];
    }
    job->law = c->inner;
}

/* Make the torques T what is held. */
static void hold(coupled_step *c, const double *T)
{
    if (c->of->is_passive != 0.0) {
        memcpy(c->job.u, T, PORTS * sizeof *T);
        memcpy(c->job.u + PORTS, c->S, sizeof c->S);
    } else {
        dm_clutched_held(c->job.coefficients, T, c->S, c->job.u);
    }
}

void dm_look(coupled_step *c, const double *z, coupled_point *at)
{
    memcpy(at->z, z, c->rows * sizeof *z);
    memcpy(at->T, c->inputs, sizeof at->T);
    for (int n = 0; n < c->rows - 2; n++) {
        const half_shaft *shaft = c->shafts[n];
        const int port = (int)shaft->port;
        const double faster = at->T[port] - shaft->per_w * z[0] - shaft->per_s * z[1];
        at->T[port] = shaft->stiffness / c->scale[n] * z[2 + n] + shaft->damping * faster;
        at->slope[2 + n] = c->scale[n] * faster;
    }
    hold(c, at->T);
    memcpy(at->u, c->job.u, sizeof at->u);
    c->inner->evaluate(&c->job, z[0], z[1], &at->at);
    at->slope[0] = at->at.e_0;
    at->slope[1] = at->at.e_s;
}

static void jacobian(coupled_step *c, const coupled_point *at, table *J)
{
    double of_w[PORTS], of_s[PORTS];
    memcpy(c->job.u, at->u, sizeof at->u);
    matrix inner = c->inner->jacobian(&c->job, &at->at).J;
    c->inner->torque_slopes(&c->job, &at->at, of_w, of_s);
    for (int n = 0; n < c->rows - 2; n++) {
        const half_shaft *shaft = c->shafts[n];
        const int port = (int)shaft->port;
        const double k = shaft->stiffness / c->scale[n], d = shaft->damping;
        const double w = of_w[port], s = of_s[port];
        J->at[0][2 + n] = w * k;
        J->at[1][2 + n] = s * k;
        J->at[2 + n][0] = -c->scale[n] * shaft->per_w;
        J->at[2 + n][1] = -c->scale[n] * shaft->per_s;
        for (int j = 2; j < c->rows; j++)
            J->at[2 + n][j] = 0.0;
        inner.ww -= w * d * shaft->per_w;
        inner.ws -= w * d * shaft->per_s;
        inner.sw -= s * d * shaft->per_w;
        inner.ss -= s * d * shaft->per_s;
    }
    J->at[0][0] = inner.ww;
    J->at[0][1] = inner.ws;
    J->at[1][0] = inner.sw;
    J->at[1][1] = inner.ss;
}

/* The equations of an implicit Euler step, whose twists follow from the speeds at its end. */

static double end_twist(const coupled_step *c, int n, double w, double s)
{
    const half_shaft *shaft = c->shafts[n];
    const double outside = c->inputs[(int)shaft->port];
    return c->twists[n] + c->h * (outside - shaft->per_w * w - shaft->per_s * s);
}

static void euler_evaluate(step *job, double w, double s, point *at)
{
    coupled_step *c = (coupled_step *)job;
    double T[PORTS];
    memcpy(T, c->inputs, sizeof T);
    for (int n = 0; n < c->rows - 2; n++) {
        const half_shaft *shaft = c->shafts[n];
        const int port = (int)shaft->port;
        T[port] = shaft->stiffness * end_twist(c, n, w, s) + shaft->damping * (
            c->inputs[port] - shaft->per_w * w - shaft->per_s * s);
    }
    hold(c, T);
    c->inner->evaluate(job, w, s, at);
}

/* At a point that was the last to be evaluated. */
static slopes euler_jacobian(step *job, const point *at)
{
    const coupled_step *c = (const coupled_step *)job;
    double of_w[PORTS], of_s[PORTS];
    slopes found = c->inner->jacobian(job, at);
    c->inner->torque_slopes(job, at, of_w, of_s);
    for (int n = 0; n < c->rows - 2; n++) {
        const half_shaft *shaft = c->shafts[n];
        const double stiff = shaft->damping + c->h * shaft->stiffness;
        const double w = of_w[(int)shaft->port] * stiff, s = of_s[(int)shaft->port] * stiff;
        found.J.ww -= w * shaft->per_w;
        found.J.ws -= w * shaft->per_s;
        found.J.sw -= s * shaft->per_w;
        found.J.ss -= s * shaft->per_s;
    }
    return found;
}

static const law coupled_euler = {.evaluate = euler_evaluate, .jacobian = euler_jacobian};

/* Put z after an implicit Euler step into end; return 0 where none is found. */
static int euler(coupled_step *c, const double *z, double h, double *end)
{
    pair found, integral;
    c->h = h;
    for (int n = 0; n < c->rows - 2; n++)
        c->twists[n] = z[2 + n] / c->scale[n];
    c->job.law = &coupled_euler;
    const int is_found = dm_implicit_euler(&c->job, (pair){z[0], z[1]},
                                           (matrix){0.0, 0.0, 0.0, 0.0}, h, &found, &integral);
    c->job.law = c->inner;
    if (!is_found)
        return 0;
    end[0] = found.w;
    end[1] = found.s;
    for (int n = 0; n < c->rows - 2; n++)
        end[2 + n] = end_twist(c, n, found.w, found.s) * c->scale[n];
    return 1;
}

/* Put h (slope - f - J d) into D. */
static void beyond(int rows, double h, const double *slope, const double *f, const table *J,
                   const double *d, double *D)
{
    dm_times(rows, J, d, D);
    for (int i = 0; i < rows; i++)
        D[i] = h * (slope[i] - f[i] - D[i]);
}

static double bend(coupled_step *c, const coupled_point *here, const exponential *e,
                   const linear_way *way, double least)
{
    const int rows = c->rows;
    double largest = 0.0;
    places found;
    dm_find_places(e, way, LOOSE, 0.0, &found);
    for (int n = 2; n < found.count - 1; n += 2) {
        const double *q = found.at[n].q;
        double z[ROWS], D[ROWS], r[ROWS];
        coupled_point at;
        if (!(dm_size(rows, q) > least))
            continue;
        for (int i = 0; i < rows; i++)
            z[i] = here->z[i] + q[i];
        dm_look(c, z, &at);
        beyond(rows, e->h, at.slope, here->slope, &e->J, q, D);
        dm_times(rows, &e->solver, D, r);
        const double estimate = dm_size(rows, r);
        if (estimate > largest)
            largest = estimate;
    }
    return largest;
}

static int differ(int rows, const table *X, const table *Y)
{
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < rows; j++)
            if (X->at[i][j] != Y->at[i][j])
                return 1;
    return 0;
}

static coupled_point *other(coupled_step *c, const coupled_point *one)
{
    return &c->points[one == &c->points[0]];
}

int dm_advance_coupled(coupled_step *c, const double *x)
{
    const int rows = c->rows;
    const law *law = c->inner;
    step *job = &c->job;
    double z[ROWS], left = c->of->h, h = c->of->h;
    exponential e;
    linear_way way;
    table J, J_there;
    coupled_point *here = &c->points[0], *there;
    memset(c->integral, 0, sizeof c->integral);
    memset(c->lost, 0, sizeof c->lost);
    c->numerical = 0.0;
    z[0] = x[0];
    z[1] = x[1];
    for (int n = 0, shaft = 0; n < (int)c->of->count && shaft < rows - 2; n++)
        if (c->shafts[shaft] == &c->of->shafts[n]) {
            z[2 + shaft] = x[2 + n] * c->scale[shaft];
            shaft++;
        }
    dm_look(c, z, here);
    jacobian(c, here, &J);
    for (int n = 0; n < (int)c->of->most_trials; n++) {
        double D[ROWS], r[ROWS], d_c[ROWS];
        there = other(c, here);
        if (!dm_make_exponential(job, &e, rows, &J, h))
            return -1;
        dm_make_way(&e, here->slope, &way);
        const double *d = way.doubled[e.doublings];
        for (int i = 0; i < rows; i++)
            z[i] = here->z[i] + d[i];
        dm_look(c, z, there);
        beyond(rows, h, there->slope, here->slope, &J, d, D);
        dm_times(rows, &e.solver, D, r);
        const double allowed = c->of->tolerance + law->relative * dm_size(rows, d);
        double error = quotient(job, dm_size(rows, r), allowed);
        if (error <= 1.0) {
            const double seen = quotient(job, bend(c, here, &e, &way, c->of->tolerance),
                                         BACKWARD * allowed);
            if (seen > error)
                error = seen;
        }
        if (error <= 1.0) {
            for (int i = 0; i < rows; i++) {
                z[i] = here->z[i] + d[i] + r[i];
                d_c[i] = d[i] + r[i];
            }
            dm_look(c, z, there);
            jacobian(c, there, &J_there);
            if (differ(rows, &J, &J_there)) {
                table solver;
                double back[ROWS];
                beyond(rows, h, there->slope, here->slope, &J_there, d_c, D);
                dm_implicit(job, rows, &J_there, h, &solver);
                dm_times(rows, &solver, D, back);
                const double seen = quotient(job, dm_size(rows, back), BACKWARD * allowed);
                if (seen > error)
                    error = seen;
            }
        }
        if (job->broken || (!isfinite(error) && !isfinite(dm_size(rows, here->slope))))
            return -1;
        if (!isfinite(error))
            error = INFINITY;
        if (error <= 1.0) {
            for (int i = 0; i < rows; i++)
                c->integral[i] += h * here->z[i] + way.integral[i] + h * r[i] / 4;
            if (c->has_books)
                dm_book_coupled(c, &(coupled_part){here, there, r, h, &e, &way});
            left -= h;
            here = there;
            J = J_there;
            if (left <= 0.0) {
                c->at_end = here;
                return job->broken ? -1 : 0;
            }
        }
        double scale = error > 1e-3 ? SAFETY * pow(error, -1.0 / 3) : GROW;
        scale = scale > SHRINK ? scale : SHRINK;
        h *= scale < GROW ? scale : GROW;
        if (h > 0.999 * left)
            h = left;
    }
    h = left;
    for (int n = 0; n < MOST_RESORTS; n++) {
        const int is_found = euler(c, here->z, h, z);
        if (job->broken)
            return -1;
        if (!is_found) {
            h /= 2.0;
            continue;
        }
        there = other(c, here);
        dm_look(c, z, there);
        for (int i = 0; i < rows; i++)
            c->integral[i] += h * z[i];
        if (c->has_books)
            dm_book_coupled(c, &(coupled_part){.here = here, .there = there, .h = h});
        left -= h;
        here = there;
        if (left <= 0.0) {
            c->at_end = here;
            c->coarse = 1;
            return job->broken ? -1 : 0;
        }
        h = left < 2.0 * h ? left : 2.0 * h;
    }
    return -1;
}
