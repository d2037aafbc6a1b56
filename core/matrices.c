/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Matrices of two to five rows, and the ways of linear equations: see dm_ros/motion/matrices.py.
 */

#include <string.h>

#include "matrices.h"

enum { TERMS = 8, MOST_PIECES = 64, SHARES = 8 };

static void product(int rows, const table *X, const table *Y, table *Z)
{
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < rows; j++) {
            double total = Y->at[0][j] * X->at[i][0];
            for (int k = 1; k < rows; k++)
                total += Y->at[k][j] * X->at[i][k];
            Z->at[i][j] = total;
        }
    }
}

static void invert(step *job, int rows, const table *A, table *X)
{
    double both[ROWS][2 * ROWS];
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < rows; j++) {
            both[i][j] = A->at[i][j];
            both[i][rows + j] = i == j;
        }
    }
    for (int i = 0; i < rows; i++) {
        int best = i;
        for (int j = i + 1; j < rows; j++)
            if (fabs(both[j][i]) > fabs(both[best][i]))
                best = j;
        for (int k = 0; k < 2 * rows; k++) {
            const double other = both[i][k];
            both[i][k] = both[best][k];
            both[best][k] = other;
        }
        const double pivot = both[i][i];
        for (int k = 0; k < 2 * rows; k++)
            both[i][k] = quotient(job, both[i][k], pivot);
        for (int j = 0; j < rows; j++) {
            const double factor = both[j][i];
            for (int k = 0; j != i && k < 2 * rows; k++)
                both[j][k] = both[j][k] - factor * both[i][k];
        }
    }
    for (int i = 0; i < rows; i++)
        memcpy(X->at[i], &both[i][rows], rows * sizeof **both);
}

void dm_implicit(step *job, int rows, const table *J, double h, table *X)
{
    table A;
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < rows; j++)
            A.at[i][j] = (i == j ? 3.0 : 0.0) - h * J->at[i][j];
    invert(job, rows, &A, X);
}

int dm_make_exponential(step *job, exponential *made, int rows, const table *J, double h)
{
    double largest = 0.0;
    int n = 0;
    table more;
    for (int i = 0; i < rows; i++) {
        const double total = h * dm_size(rows, J->at[i]);
        if (total > largest)
            largest = total;
    }
    if (isfinite(largest))
        frexp(largest, &n);
    n = n + 4 > 3 ? n + 4 : 3;
    if (n > MOST_DOUBLINGS)
        return 0;
    made->rows = rows;
    made->doublings = n;
    made->h = h;
    made->start = ldexp(h, -n);
    made->J = *J;
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < rows; j++)
            made->powers[0].at[i][j] = made->small.at[i][j] = made->start * J->at[i][j];
    for (int k = TERMS; k > 1; k--) {
        product(rows, &made->small, &made->powers[0], &more);
        for (int i = 0; i < rows; i++)
            for (int j = 0; j < rows; j++)
                made->powers[0].at[i][j] = made->small.at[i][j] + more.at[i][j] / k;
    }
    for (int m = 0; m < n; m++) {
        product(rows, &made->powers[m], &made->powers[m], &more);
        for (int i = 0; i < rows; i++)
            for (int j = 0; j < rows; j++)
                made->powers[m + 1].at[i][j] = 2 * made->powers[m].at[i][j] + more.at[i][j];
    }
    dm_implicit(job, rows, J, h, &made->solver);
    return 1;
}

void dm_make_way(const exponential *e, const double *f, linear_way *made)
{
    const int rows = e->rows;
    double t = e->start, v[ROWS], more[ROWS];
    double *q = made->doubled[0], *integral = made->integral;
    memcpy(made->f, f, rows * sizeof *f);
    memcpy(v, f, rows * sizeof *f);
    for (int k = TERMS; k > 2; k--) {
        dm_times(rows, &e->small, v, more);
        for (int i = 0; i < rows; i++)
            v[i] = f[i] + more[i] / k;
    }
    dm_times(rows, &e->small, v, more);
    for (int i = 0; i < rows; i++) {
        integral[i] = t * t * (v[i] / 2);
        q[i] = t * (f[i] + more[i] / 2);
    }
    for (int n = 0; n < e->doublings; n++) {
        double *next = made->doubled[n + 1];
        dm_times(rows, &e->powers[n], integral, more);
        for (int i = 0; i < rows; i++)
            integral[i] = 2 * integral[i] + more[i] + t * q[i];
        dm_times(rows, &e->powers[n], q, more);
        for (int i = 0; i < rows; i++)
            next[i] = 2 * q[i] + more[i];
        t *= 2.0;
        q = next;
    }
}

/* Put q a time of a level after that of q into after. */
static void go(const exponential *e, const linear_way *way, int level, const double *q,
               double *after)
{
    double more[ROWS];
    dm_times(e->rows, &e->powers[level], q, more);
    for (int i = 0; i < e->rows; i++)
        after[i] = way->doubled[level][i] + q[i] + more[i];
}

/* Put dq/dt into slope. */
static void slope_at(const exponential *e, const linear_way *way, const double *q, double *slope)
{
    double more[ROWS];
    dm_times(e->rows, &e->J, q, more);
    for (int i = 0; i < e->rows; i++)
        slope[i] = way->f[i] + more[i];
}

/* Put these into found; return 0 where they are too many. */
static int find_pieces(const exponential *e, const linear_way *way, double fit, double speed,
                       places *found)
{
    static const double romberg[SHARES] = {
        217.0 / 5670, 1024.0 / 5670, 352.0 / 5670, 1024.0 / 5670,
        436.0 / 5670, 1024.0 / 5670, 352.0 / 5670, 1024.0 / 5670};
    const int rows = e->rows, top = e->doublings;
    int level = top, pieces = 0, count = 0;
    double place = 0.0, weight = 0.0, q[ROWS] = {0.0}, q_t[ROWS];
    double largest = dm_size(rows, way->doubled[top]);
    memcpy(q_t, way->f, rows * sizeof *q_t);
    while (place < 1.0 || level < top) {
        const double length = ldexp(1.0, level - top), t = length * e->h;
        double middle[ROWS], end[ROWS], end_t[ROWS], middle_t[ROWS], turning[ROWS], bend[ROWS];
        go(e, way, level - 1, q, middle);
        go(e, way, level, q, end);
        slope_at(e, way, end, end_t);
        slope_at(e, way, middle, middle_t);
        dm_times(rows, &e->J, middle_t, turning);
        for (int i = 0; i < rows; i++)
            bend[i] = t * turning[i] - (end_t[i] - q_t[i]);
        const double far[2] = {dm_size(rows, middle), dm_size(rows, end)};
        for (int i = 0; i < 2; i++)
            if (far[i] > largest)
                largest = far[i];
        if (t / 16 * dm_size(rows, bend) > fit * sqrt(largest * (largest + speed)) && level > 3) {
            level -= 1;
            place *= 2.0;
            continue;
        }
        if (pieces == MOST_PIECES)
            return 0;
        pieces += 1;
        for (int n = 0; n < SHARES; n++) {
            /* from the start, the quarter, the middle and the last quarter an eighth on */
            double *x = found->at[count + n].q;
            if (n == 0)
                memcpy(x, q, rows * sizeof *x);
            else if (n == 4)
                memcpy(x, middle, rows * sizeof *x);
            else if (n % 4 == 2)
                go(e, way, level - 2, n == 2 ? q : middle, x);
        }
        for (int n = 1; n < SHARES; n += 2)
            go(e, way, level - 3, found->at[count + n - 1].q, found->at[count + n].q);
        for (int n = 0; n < SHARES; n++) {
            found->at[count].r = length * (place + n / 8.0);
            found->at[count++].weight = weight + length * romberg[n];
            weight = 0.0;
        }
        weight = length * romberg[0];
        memcpy(q, end, rows * sizeof *q);
        memcpy(q_t, end_t, rows * sizeof *q_t);
        place += 1.0;
        while (level < top && fmod(place, 2.0) == 0.0) {
            place /= 2.0;
            level += 1;
        }
    }
    found->at[count].r = 1.0;
    found->at[count].weight = weight;
    memcpy(found->at[count++].q, q, rows * sizeof *q);
    found->count = count;
    return 1;
}

void dm_find_places(const exponential *e, const linear_way *way, double fit, double speed,
                    places *found)
{
    while (!find_pieces(e, way, fit, speed, found))
        fit *= 16.0;
}
