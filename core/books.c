/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The books of the ticks: see dm_ros/motion/books.py and meters.py.
 */

#include <string.h>

#include "differential.h"

static const double AT_REST = 1e-6, NO_LOSS = 1e-12;

int dm_entries(const model *m)
{
    return PORTS + 2 + dm_bearings(m) + dm_moments(m) + 2;
}

static double stored(const model *m, const double *x)
{
    const double *f = m->form;
    return (f[0] * x[0] * x[0] + f[2] * x[1] * x[1]) / 2 + f[1] * x[0] * x[1];
}

static double gained(const model *m, const double *x, const pair *y)
{
    const double *f = m->form;
    const double s_1 = y->w + x[0], s_2 = y->s + x[1];
    return ((y->w - x[0]) * (f[0] * s_1 + f[1] * s_2)
            + (y->s - x[1]) * (f[1] * s_1 + f[2] * s_2)) / 2;
}

void dm_begin_books(const model *m, const state *now, books *kept)
{
    memset(kept, 0, sizeof *kept);
    kept->stored = stored(m, now->x);
}

void dm_note_change(const model *m, const state *now, books *kept)
{
    const double before = kept->stored;
    kept->stored = stored(m, now->x);
    kept->changes += kept->stored - before;
}

void dm_book_step(const model *m, int is_first, const double *x, const pair *end,
                  const double *work, const double *lost, double numerical, double *tick)
{
    /* the passive law knows all elements of both mechanisms, the paper's those there are */
    static const int self_locking[] = {0, 2, 3, 5, 6, 7};
    const int clutches = dm_moments(m) - dm_gears(m);
    const int elements = 1 + dm_gears(m) + dm_bearings(m) + clutches;
    const int picks = m->run.is_passive != 0.0 && m->run.is_symmetric == 0.0;
    double entries[ENTRIES];
    int count = 0;
    for (int n = 0; n < PORTS; n++)
        entries[count++] = work[n];
    entries[count++] = gained(m, x, end);
    for (int n = 0; n < elements; n++)
        entries[count++] = lost[picks ? self_locking[n] : n];
    entries[count++] = numerical;
    for (int n = 0; n < count; n++)
        tick[n] = is_first ? entries[n] : tick[n] + entries[n];
}

void dm_book_tick(const model *m, const state *now, const double *tick, books *kept)
{
    const int count = dm_entries(m) - 1;
    double work = 0.0, scale = 0.0, whole = 0.0;
    kept->stored = stored(m, now->x);
    for (int n = 0; n < PORTS; n++)
        work += tick[n];
    for (int n = 0; n < count; n++) {
        whole += tick[n];
        scale += fabs(tick[n]);
    }
    const double least = AT_REST * kept->stored;
    if (least > scale)
        scale = least;
    const double residual = fabs(work + work - whole);
    if (residual > kept->worst * scale)
        kept->worst = residual / scale;
    const double rounding = NO_LOSS * scale;
    for (int n = 0; n < dm_gears(m) + dm_bearings(m); n++) {
        const double loss = tick[PORTS + 2 + n];
        if (loss < -rounding) {
            kept->returned_ticks[n] += 1.0;
            kept->returned[n] -= loss;
        }
    }
    for (int n = 0; n < count; n++)
        kept->tick[n] = tick[n];
    kept->tick[count] = scale;
    for (int n = 0; n <= count; n++)
        kept->total[n] = kept->total[n] + kept->tick[n];
}
