/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The books of a step with elastic shafts: see dm_ros/motion/coupled_meter.py.
 */

#include <string.h>

#include "coupled.h"

static const double FIT = 3e-5;

/* Put what each element loses at a state into powers, W, the half-shafts last. */
static void find_powers(coupled_step *c, const coupled_point *at, double *powers)
{
    step *job = &c->job;
    memcpy(job->u, at->u, sizeof at->u);
    memcpy(job->T, at->T, sizeof at->T);
    if (c->of->is_passive != 0.0) {
        dm_lost_powers(job, &at->at, powers);
    } else {
        const double w = at->z[0], s = at->z[1];
        const point *p = &at->at;
        const products x = {w, w * w, w * s, s * s, p->F_1 * w, p->F_1 * s, p->F_2 * w,
                            p->F_2 * s, p->M_1 * w, p->M_1 * s, p->M_2 * w, p->M_2 * s};
        memset(powers, 0, LOST * sizeof *powers);
        if (c->of->is_symmetric != 0.0)
            dm_clutched_symmetric_lost(job, &x, powers);
        else
            dm_clutched_lost(job, &x, powers);
    }
    for (int n = 0; n < c->rows - 2; n++) {
        const double slower = at->slope[2 + n] / c->scale[n];
        powers[LOST + n] = c->shafts[n]->damping * slower * slower;
    }
}

/* Return the momentum of z times a change of it. */
static double momentum_times(const coupled_step *c, const double *z, const double *change)
{
    const double *m = c->of->form;
    double total = 0.0;
    total += (m[0] * z[0] + m[1] * z[1]) * change[0];
    total += (m[1] * z[0] + m[2] * z[1]) * change[1];
    for (int n = 0; n < c->rows - 2; n++)
        total += c->shafts[n]->inertia * z[2 + n] * change[2 + n];
    return total;
}

void dm_book_coupled(coupled_step *c, const coupled_part *part)
{
    const int rows = c->rows, count = LOST + rows - 2;
    const double h = part->h;
    double lost[COUPLED_LOST] = {0.0}, powers[COUPLED_LOST], taken = 0.0;
    if (!part->way) {
        double jump[ROWS];
        find_powers(c, part->there, powers);
        for (int i = 0; i < rows; i++)
            jump[i] = part->there->z[i] - part->here->z[i];
        c->numerical += momentum_times(c, jump, jump) / 2;
        for (int n = 0; n < count; n++)
            c->lost[n] += h * powers[n];
        return;
    }
    places found;
    dm_find_places(part->e, part->way, FIT, dm_size(rows, part->here->z), &found);
    for (int k = 0; k < found.count; k++) {
        const double r = found.at[k].r, weight = found.at[k].weight, *q = found.at[k].q;
        const double r_2 = r * r, r_3 = r_2 * r;
        double z[ROWS], way_t[ROWS], error[ROWS];
        coupled_point at;
        for (int i = 0; i < rows; i++)
            z[i] = part->here->z[i] + q[i] + part->c[i] * r_3;
        dm_look(c, z, &at);
        find_powers(c, &at, powers);
        for (int n = 0; n < count; n++)
            lost[n] = lost[n] + weight * powers[n];
        dm_times(rows, &part->e->J, q, way_t);
        for (int i = 0; i < rows; i++)
            error[i] = (part->here->slope[i] + way_t[i] + 3 * part->c[i] * r_2 / h
                        - at.slope[i]);
        taken += weight * momentum_times(c, z, error);
    }
    for (int n = 0; n < count; n++)
        c->lost[n] += h * lost[n];
    c->numerical += -h * taken;
}
