/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Integrals along the path of a step: see dm_ros/motion/quadrature.py.
 */

#include "quadrature.h"

static const double STIFF = 1.5, FINE = 0.4;

static rule rules[MOST_PIECES + 1];

/* Add a weight at a node of a rule, where it may be already. */
static void add(rule *to, double at, double weight)
{
    int n;
    if (at == 0.0) {
        to->begin += weight;
        return;
    }
    if (at == 1.0) {
        to->end += weight;
        return;
    }
    for (n = 0; n < to->count && to->r[n] != at; n++)
        ;
    if (n == to->count) {
        to->r[n] = at;
        to->r_2[n] = at * at;
        to->r_3[n] = at * at * at;
        to->weight[n] = 0.0;
        to->count++;
    }
    to->weight[n] += weight;
}

void dm_prepare_rules(void)
{
    const double inner = sqrt(3.0 / 7) / 2;
    const double nodes[] = {0.0, 0.5 - inner, 0.5, 0.5 + inner, 1.0};
    const double weights[] = {1.0 / 20, 49.0 / 180, 16.0 / 45, 49.0 / 180, 1.0 / 20};
    for (int pieces = 1; pieces <= MOST_PIECES; pieces++) {
        rule *to = &rules[pieces];
        double begin = 0.0;
        *to = (rule){0};
        add(to, 0.5, 0.0);
        for (int n = 0; n < pieces; n++) {
            const double end = ldexp(1.0, n + 1 - pieces);
            for (int i = 0; i < 5; i++)
                add(to, begin + (end - begin) * nodes[i], (end - begin) * weights[i]);
            begin = end;
        }
    }
}

const rule *dm_rule_for(matrix J, double h, int far)
{
    double stiff = h * (fabs(J.ww) + fabs(J.ss));
    const double most = far ? FINE : STIFF;
    int pieces = 1;
    while (stiff > most && pieces < MOST_PIECES) {
        stiff /= 2.0;
        pieces += 1;
    }
    return &rules[pieces];
}
