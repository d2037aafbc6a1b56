/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The books of a step under the passive law: see PassiveMeter in dm_ros/motion/meters.py.
 */

#include "exponentials.h"
#include "passive.h"
#include "quadrature.h"

void dm_passive_book(step *job, const part *path, double *lost, double *taken)
{
    const double m_ww = job->form[0], m_ws = job->form[1], m_ss = job->form[2];
    const double h = path->h, w_0 = path->y.w, s_0 = path->y.s;
    const double d_w = path->d.w, d_s = path->d.s, c_w = path->c.w, c_s = path->c.s;
    const double f_w = path->f.w, f_s = path->f.s;
    const matrix J = path->at_start.J;
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
    const rule *nodes = dm_rule_for(J, h, far);
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
        point at;
        dm_passive.evaluate(job, w, s, &at);
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
