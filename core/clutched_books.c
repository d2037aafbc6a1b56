/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The books of a step under the paper's law: see ClutchedMeter in dm_ros/motion/meters.py.
 */

#include "clutched.h"
#include "exponentials.h"
#include "quadrature.h"

static const double CALM = 4e-6;

static products book(step *job, const part *path, double *taken)
{
    const clutched_coefficients *k = job->coefficients;
    const double m_ww = job->form[0], m_ws = job->form[1], m_ss = job->form[2];
    const double w = path->y.w, s = path->y.s, h = path->h;
    const double d_w = path->d.w, d_s = path->d.s, c_w = path->c.w, c_s = path->c.s;
    const double a_w = path->integral.w, a_s = path->integral.s;
    const int straight = path->is_straight;
    const matrix J = path->at_start.J;
    const matrix J_path = straight ? (matrix){0.0, 0.0, 0.0, 0.0} : J;
    const double F_1w = path->at_start.F[0], F_1s = path->at_start.F[1];
    const double F_2w = path->at_start.F[2], F_2s = path->at_start.F[3];
    const double F_1 = path->here->F_1, F_2 = path->here->F_2;
    const int far = fabs(d_w) + fabs(d_s) > 0.05 * (fabs(w) + fabs(s));
    const rule *nodes = dm_rule_for(J_path, h, far);
    pair ways[MOST_NODES];
    dm_way(job, J_path, path->f, h, nodes->count, nodes->r, ways);

    /* moments over the path of the way y(t) - y */
    double w_r = d_w + c_w, s_r = d_s + c_s;
    double w_2 = nodes->end * w_r, s_2 = nodes->end * s_r, w_3 = w_2, s_3 = s_2;
    double R_ww = w_2 * w_r, R_ws = w_2 * s_r, R_ss = s_2 * s_r;
    for (int i = 0; i < nodes->count; i++) {
        const double r_2 = nodes->r_2[i], r_3 = nodes->r_3[i], weight = nodes->weight[i];
        const double w_q = ways[i].w + c_w * r_3, s_q = ways[i].s + c_s * r_3;
        const double a = weight * w_q, b = weight * s_q;
        R_ww += a * w_q;
        R_ws += a * s_q;
        R_ss += b * s_q;
        w_2 += a * r_2;
        s_2 += b * r_2;
        w_3 += a * r_3;
        s_3 += b * r_3;
    }

    /* y' - f(y) but for the remainder */
    double sum;
    if (straight) {
        const double f_w = path->f.w, f_s = path->f.s;
        const double e_w = f_w - path->here->e_0, e_s = f_s - path->here->e_s;
        const double g_w = -h * (J.ww * f_w + J.ws * f_s), g_s = -h * (J.sw * f_w + J.ss * f_s);
        sum = ((m_ww * w + m_ws * s) * (e_w + g_w / 2) + (m_ws * w + m_ss * s) * (e_s + g_s / 2)
               + (m_ww * d_w + m_ws * d_s) * (e_w / 2 + g_w / 3)
               + (m_ws * d_w + m_ss * d_s) * (e_s / 2 + g_s / 3));
    } else {
        const double b_w = 3 * c_w / h, b_s = 3 * c_s / h;
        const double g_w = J.ww * c_w + J.ws * c_s, g_s = J.sw * c_w + J.ss * c_s;
        w_2 = w_2 + w / 3;
        s_2 = s_2 + s / 3;
        w_3 = w_3 + w / 4;
        s_3 = s_3 + s / 4;
        sum = ((m_ww * w_2 + m_ws * s_2) * b_w + (m_ws * w_2 + m_ss * s_2) * b_s
               - (m_ww * w_3 + m_ws * s_3) * g_w - (m_ws * w_3 + m_ss * s_3) * g_s);
    }
    const double r_w = a_w - h * w, r_s = a_s - h * s;
    const double V_ww = r_w * w + h * R_ww, V_ws = r_w * s + h * R_ws;
    const double V_sw = r_s * w + h * R_ws, V_ss = r_s * s + h * R_ss;
    const double X_ww = w * a_w + V_ww, X_ws = w * a_s + V_ws, X_ss = s * a_s + V_ss;

    /* what friction has beside its tangent */
    double F_1r = path->there->F_1 - (F_1 + F_1w * w_r + F_1s * s_r);
    double F_2r = path->there->F_2 - (F_2 + F_2w * w_r + F_2s * s_r);
    double f_1w, f_1s, f_2w, f_2s;
    w_r += w;
    s_r += s;
    if (fabs(c_w) + fabs(c_s) < CALM && !straight) {
        F_1r *= h / 3;
        F_2r *= h / 3;
        f_1w = F_1r * w_r;
        f_1s = F_1r * s_r;
        f_2w = F_2r * w_r;
        f_2s = F_2r * s_r;
    } else {   /* by Simpson's rule */
        const double e = h / 6, m = h * 2 / 3;
        double w_m = ways[0].w + c_w / 8, s_m = ways[0].s + c_s / 8;
        point at;
        job->law->evaluate(job, w + w_m, s + s_m, &at);
        const double F_1m = m * (at.F_1 - F_1 - F_1w * w_m - F_1s * s_m);
        const double F_2m = m * (at.F_2 - F_2 - F_2w * w_m - F_2s * s_m);
        F_1r = e * F_1r;
        F_2r = e * F_2r;
        w_m += w;
        s_m += s;
        f_1w = F_1m * w_m + F_1r * w_r;
        f_1s = F_1m * s_m + F_1r * s_r;
        f_2w = F_2m * w_m + F_2r * w_r;
        f_2s = F_2m * s_m + F_2r * s_r;
    }
    *taken = -(h * sum + (
        m_ww * (k->C_w1 * f_1w + k->C_w2 * f_2w) + m_ss * (k->C_s1 * f_1s + k->C_s2 * f_2s)
        + m_ws * (k->C_w1 * f_1s + k->C_w2 * f_2s + k->C_s1 * f_1w + k->C_s2 * f_2w)));

    const double F_1_w = F_1 * a_w + F_1w * V_ww + F_1s * V_sw + f_1w;
    const double F_1_s = F_1 * a_s + F_1w * V_ws + F_1s * V_ss + f_1s;
    const double F_2_w = F_2 * a_w + F_2w * V_ww + F_2s * V_sw + f_2w;
    const double F_2_s = F_2 * a_s + F_2w * V_ws + F_2s * V_ss + f_2s;
    const double m_1 = job->u[M_ONE], m_2 = job->u[M_TWO];
    return (products){
        a_w, X_ww, X_ws, X_ss, F_1_w, F_1_s, F_2_w, F_2_s,
        m_1 * a_w + k->P_1w * X_ww + k->P_1s * X_ws - k->W_11 * F_1_w - k->W_12 * F_2_w,
        m_1 * a_s + k->P_1w * X_ws + k->P_1s * X_ss - k->W_11 * F_1_s - k->W_12 * F_2_s,
        m_2 * a_w + k->P_2w * X_ww + k->P_2s * X_ws - k->W_21 * F_1_w - k->W_22 * F_2_w,
        m_2 * a_s + k->P_2w * X_ws + k->P_2s * X_ss - k->W_21 * F_1_s - k->W_22 * F_2_s};
}

void dm_clutched_lost(const step *job, const products *of, double *lost)
{
    const self_locking_losses *k = job->losses;
    const products x = *of;
    const double T_0_w = job->T[0] * x.a_w;
    lost[0] = k->drag_w * x.X_ww + k->drag_s * x.X_ss;
    lost[1] = k->mesh_1 * (x.M_1_w + k->k_1 * x.M_1_s);
    lost[2] = k->mesh_2 * (x.M_2_w - k->k_2 * x.M_2_s);
    lost[3] = k->bearing_0 * (k->drag_w * x.X_ww - k->carrier_s * x.X_ws - x.F_1_w - x.F_2_w
                              + k->direct * (x.M_1_w + x.M_2_w) - k->reverse * T_0_w);
    lost[4] = k->k_1 * x.F_1_s;
    lost[5] = -k->k_2 * x.F_2_s;
}

void dm_clutched_symmetric_lost(const step *job, const products *of, double *lost)
{
    const symmetric_losses *k = job->losses;
    const products x = *of;
    const double *T = job->T;
    const double M_F_w = ((k->Q_0 * T[0] + k->Q_1 * T[1] + k->Q_2 * T[2]) * x.a_w
                          + k->P_w * x.X_ww + k->P_s * x.X_ws
                          - k->W_1 * x.F_1_w - k->W_2 * x.F_2_w);
    const double T_3_w3 = T[0] * k->g_F * x.a_w;
    lost[0] = k->drag_w * x.X_ww + k->drag_s * x.X_ss;
    lost[1] = k->mesh_F * M_F_w;
    lost[2] = k->mesh_1 * (x.M_1_w + x.M_1_s / 2);
    lost[3] = k->mesh_2 * (x.M_2_w - x.M_2_s / 2);
    lost[4] = k->pinion_L * k->pinion_w * x.X_ww + k->pinion_F * M_F_w + k->pinion_T * T_3_w3;
    lost[5] = (k->carrier_L * (k->carrier_w * x.X_ww - k->carrier_s * x.X_ws)
               + k->carrier_1 * x.M_1_w + k->carrier_2 * x.M_2_w + k->carrier_F * M_F_w)
        - k->carrier_L * (x.F_1_w + x.F_2_w);
    lost[6] = x.F_1_s / 2;
    lost[7] = -x.F_2_s / 2;
}

void dm_clutched_book(step *job, const part *path, double *lost, double *taken)
{
    const products x = book(job, path, taken);
    dm_clutched_lost(job, &x, lost);
}

void dm_clutched_symmetric_book(step *job, const part *path, double *lost, double *taken)
{
    const products x = book(job, path, taken);
    dm_clutched_symmetric_lost(job, &x, lost);
}
