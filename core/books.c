/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The books of a step: see PassiveMeter in dm_ros/motion/meters.py, and quadrature.py.
 */

#include <math.h>

#include "books.h"
#include "exponentials.h"

enum { MOST_PIECES = 40, MOST_NODES = 4 * MOST_PIECES };

static const double STIFF = 1.5, FINE = 0.4;

/* Lobatto's rule of five points on [0, 1], in pieces each as long as all before it. */
typedef struct {
    int count;   /* of the nodes inside */
    double r[MOST_NODES], r_2[MOST_NODES], r_3[MOST_NODES], weight[MOST_NODES], begin, end;
} rule;

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

static const rule *rule_for(matrix J, double h, int far)
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

void dm_book_part(step *job, const part *path, double *lost, double *taken)
{
    const double m_ww = job->form[0], m_ws = job->form[1], m_ss = job->form[2];
    const double h = path->h, w_0 = path->y.w, s_0 = path->y.s;
    const double d_w = path->d.w, d_s = path->d.s, c_w = path->c.w, c_s = path->c.s;
    const double f_w = path->f.w, f_s = path->f.s;
    const matrix J = path->J;
    double ends[LOST];
    pair ways[MOST_NODES];

    dm_lost_powers(job, path->there, ends);
    if (path->is_straight) {
        *taken = (m_ww * d_w * d_w + m_ss * d_s * d_s) / 2 + m_ws * d_w * d_s;
        for (int n = 0; n < LOST; n++)
            lost[n] = h * ends[n];
        return;
    }
    const int far = fabs(d_w) + fabs(d_s) > 0.05 * (fabs(w_0) + fabs(s_0));
    const rule *nodes = rule_for(J, h, far);
    double w = w_0 + d_w + c_w, s = s_0 + d_s + c_s;
    double error_w = f_w + J.ww * d_w + J.ws * d_s + 3 * c_w / h - path->there->e_0;
    double error_s = f_s + J.sw * d_w + J.ss * d_s + 3 * c_s / h - path->there->e_s;
    double sum = nodes->end * ((m_ww * w + m_ws * s) * error_w + (m_ws * w + m_ss * s) * error_s);
    dm_lost_powers(job, path->here, lost);
    for (int n = 0; n < LOST; n++)
        lost[n] = nodes->begin * lost[n] + nodes->end * ends[n];
    dm_way(job, J, path->f, h, nodes->count, nodes->r, ways);
    for (int i = 0; i < nodes->count; i++) {
        const double q_w = ways[i].w, q_s = ways[i].s;
        const double r_2 = nodes->r_2[i], r_3 = nodes->r_3[i], weight = nodes->weight[i];
        w = w_0 + q_w + c_w * r_3;
        s = s_0 + q_s + c_s * r_3;
        const point at = dm_evaluate(job, w, s);
        error_w = f_w + J.ww * q_w + J.ws * q_s + 3 * c_w * r_2 / h - at.e_0;
        error_s = f_s + J.sw * q_w + J.ss * q_s + 3 * c_s * r_2 / h - at.e_s;
        sum += weight * ((m_ww * w + m_ws * s) * error_w + (m_ws * w + m_ss * s) * error_s);
        dm_lost_powers(job, &at, ends);
        for (int n = 0; n < LOST; n++)
            lost[n] = lost[n] + weight * ends[n];
    }
    for (int n = 0; n < LOST; n++)
        lost[n] = h * lost[n];
    *taken = -h * sum;
}
