/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * A model of its parameters: see dm_ros/mechanism/parameters.py, passive.py, clutched.py,
 * elimination.py, losses.py, kinetic.py and dm_ros/motion/models.py.
 */

#include <stddef.h>
#include <string.h>

#include "differential.h"

enum { DIRECT, REVERSE };

/* The parameters of both mechanisms, in the order in which their tables have them. */
typedef struct {
    double g_F, g_2s, n_s, I_0, I_1, I_2, I_3, I_s, l_0, l_1, l_2, l_3, l_s;
    double eta_3B, eta_FG, eta_0B, eta_1G, eta_2G, sign_speed, alpha, R_1, R_2;
    double n_F[2], mu[2], c_f[2], R_F[2], N[2], c[2], tau[2], A[2];
} table;

enum { CLUTCHED = 16 };   /* parameters of clutches, the last of both tables */

static void read_clutches(table *t, const double *p)
{
    memcpy((char *)t + offsetof(table, n_F), p, CLUTCHED * sizeof *p);
}

static table read(int is_symmetric, const double *p)
{
    table t;
    if (is_symmetric) {
        const size_t before = offsetof(table, R_2) / sizeof *p;
        memcpy(&t, p, before * sizeof *p);
        t.R_2 = t.R_1;   /* there is one radius */
        read_clutches(&t, p + before);
        return t;
    }
    t.R_1 = p[0], t.R_2 = p[1], t.g_2s = p[2], t.n_s = p[3];
    t.I_0 = p[4], t.I_1 = p[5], t.I_2 = p[6], t.I_s = p[7];
    t.l_0 = p[8], t.l_1 = p[9], t.l_2 = p[10], t.l_s = p[11];
    t.eta_0B = p[12], t.eta_1G = p[13], t.eta_2G = p[14], t.sign_speed = p[15], t.alpha = p[16];
    t.g_F = t.I_3 = t.l_3 = 0.0;
    t.eta_3B = t.eta_FG = 1.0;
    read_clutches(&t, p + 17);
    return t;
}

static double full_slip(const table *p, int n)
{
    return p->n_F[n] * p->mu[n] * p->R_F[n] / (n ? p->R_2 : p->R_1);
}

/* Return whether a clutch locks the mechanism by its own gear moments. */
static int locks_itself(const table *p)
{
    for (int n = 0; n < CLUTCHES; n++) {
        const double gain = tan(p->alpha) * full_slip(p, n);
        if (gain != 0.0 && !(gain < (n ? p->eta_2G : p->eta_1G) * p->eta_0B))
            return 1;
    }
    return 0;
}

static coefficients make_coefficients(const model *m, const table *p)
{
    const double k_2 = 1 / (1 + m->g_12);
    const double spin = p->n_s * k_2 / (p->g_2s * p->g_2s);
    coefficients k = {
        p->sign_speed, m->g_12, m->g_12 * k_2, k_2, p->g_F,
        p->I_0, p->I_1, p->I_2, p->I_3, spin * p->I_s,
        p->l_0, p->l_1, p->l_2, p->l_3, spin * p->l_s,
        (1 + p->eta_1G) / 2, (1 + p->eta_2G) / 2, (1 + p->eta_FG) / 2,
        (1 - p->eta_1G) / 2, (1 - p->eta_2G) / 2, (1 - p->eta_FG) / 2,
        1 / p->eta_0B - 1, 1 / p->eta_3B - 1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    if (m->run.has_clutches != 0.0) {
        k.a_1 = p->c_f[0] * m->g_12 / (1 + m->g_12);
        k.a_2 = -p->c_f[1] / (1 + m->g_12);
    }
    if (m->run.has_clutches != 0.0 && m->run.is_lagged == 0.0) {
        k.phi_1 = m->phi[0];
        k.phi_2 = m->phi[1];
        k.psi_1 = m->phi[0] * p->c[0];
        k.psi_2 = m->phi[1] * p->c[1];
    }
    return k;
}

/* The rows of elimination.Rows: of w, s, T_0, T_1, T_2, F_1, F_2. */
typedef struct {
    double e_0[7], e_s[7], M_1[7], M_2[7], M_F[7];
} rows;

static int eliminate(const table *p, const coefficients *k, int flow, rows *found)
{
    const double g_F = k->g_F, d = 1 / p->eta_0B, eta_F = p->eta_FG, eta_3 = p->eta_3B;
    const int is_direct = flow == DIRECT;
    const double v_1 = is_direct ? 1 / p->eta_1G : p->eta_1G;
    const double v_2 = is_direct ? 1 / p->eta_2G : p->eta_2G;
    const double c = is_direct ? d : 1.0, b = is_direct ? 1.0 : d;
    const double c_T = is_direct ? eta_F * eta_3 : 1 / (eta_F * eta_3);
    const double c_I = is_direct ? eta_F * eta_3 : 1 / eta_F;
    const double c_L = is_direct ? eta_F : 1 / (eta_F * eta_3);
    const double u_1 = is_direct ? v_1 : -1.0, u_2 = is_direct ? v_2 : -1.0;
    const double u_F = is_direct ? 1 / eta_F : -1.0;
    const double a_1 = v_1 * k->I_1, a_2 = v_2 * k->I_2, I_s = k->I_s, g = k->g_12;
    const double k_1 = k->k_1, k_2 = k->k_2;
    const double I_F = c_I * g_F * g_F * k->I_3;
    const double I_0 = k->I_0 + b * I_F;
    const double slip = g * a_1 * k_1 + a_2 * k_2 + I_s;
    const double rest = c * (a_1 + a_2) * I_s + c * a_1 * a_2 * (1 + g);
    const double det = I_0 * slip + rest;
    if (det == 0.0)
        return 0;
    double carrier[5] = {slip / det, (a_2 - g * a_1) / det, k->I_1 * (a_2 + I_s) / det,
                         k->I_2 * (g * a_1 + I_s) / det};
    carrier[4] = -I_F * carrier[0];
    double satellite[5] = {c * (a_2 * k_2 - a_1 * k_1) / det, (I_0 + c * (a_1 + a_2)) / det,
                           k->I_1 * (k_1 * I_0 + c * a_2) / det,
                           -k->I_2 * (k_2 * I_0 + c * a_1) / det};
    satellite[4] = -I_F * satellite[0];
    const double both = (c * I_s - k_1 * I_0) / det;
    double shaft_1[5] = {c * v_1 * (a_2 + I_s) / det, v_1 * (g * I_0 + c * a_2 * (1 + g)) / det,
                         -(I_0 * (a_2 * k_2 + I_s) + c * a_2 * I_s) / det, k->I_2 * v_1 * both};
    shaft_1[4] = -I_F * shaft_1[0];
    double shaft_2[5] = {c * v_2 * (g * a_1 + I_s) / det, -v_2 * (I_0 + c * a_1 * (1 + g)) / det,
                         k->I_1 * v_2 * both,
                         -(I_0 * (g * a_1 * k_1 + I_s) + c * a_1 * I_s) / det};
    shaft_2[4] = -I_F * shaft_2[0];
    const double final_drive[5] = {b * carrier[0], b * carrier[1], b * carrier[2], b * carrier[3],
                                   (k->I_0 * slip + rest) / det};
    const double L_0 = d * k->l_0, L_3 = c_L * g_F * g_F * k->l_3;
    const double L_1 = k->l_1 * k_1, L_2 = k->l_2 * k_2;
    const double per_torque = c_T * (g_F != 0.0 ? g_F : 1.0);
    const double units[5] = {1.0, 1.0, u_1, u_2, u_F};
    double *const into[5] = {found->e_0, found->e_s, found->M_1, found->M_2, found->M_F};
    int is_finite = 1;
    for (int i = 0; i < 5; i++) {
        const double e = carrier[i], q_1 = shaft_1[i], q_2 = shaft_2[i], f = final_drive[i];
        const double row[7] = {
            -L_0 * e - L_3 * f, L_1 * (d * e - q_1) - L_2 * (d * e - q_2) - k->l_s * satellite[i],
            per_torque * f, q_1, q_2, d * e - q_1, d * e - q_2};
        for (int n = 0; n < 7; n++) {
            into[i][n] = i < 2 ? row[n] : i < 4 || g_F != 0.0 ? units[i] * row[n] : 0.0;
            is_finite &= isfinite(into[i][n]) != 0;
        }
    }
    return is_finite;
}

static losses_without_clutches make_losses(const table *p, int flow)
{
    const double direct = flow == DIRECT, reverse = flow == REVERSE;
    const double bearing_3 = 1 / p->eta_3B - 1, bearing_0 = 1 / p->eta_0B - 1;
    const double g_3 = p->l_3 * p->g_F * p->g_F;
    return (losses_without_clutches){
        p->l_0 + g_3, (p->l_1 + p->l_2 + p->n_s * p->l_s / (p->g_2s * p->g_2s)) / 4, g_3, p->l_0,
        (p->l_1 - p->l_2) / 2, 1 - p->eta_FG, 1 - p->eta_1G, 1 - p->eta_2G,
        bearing_3 * direct, -bearing_3 * reverse, bearing_3,
        bearing_0 * direct, bearing_0 * direct, bearing_0 * reverse, bearing_0};
}

static int make_exact(linear *made, const rows *r, const table *p, int flow, double h)
{
    const double direction = flow == DIRECT ? 1.0 : -1.0;
    const double *e[2] = {r->e_0, r->e_s}, *M[3] = {r->M_F, r->M_1, r->M_2};
    losses_without_clutches lost = make_losses(p, flow);
    double *const of_moments[7] = {&lost.mesh_F, &lost.mesh_1, &lost.mesh_2, &lost.pinion_F,
                                   &lost.carrier_1, &lost.carrier_2, &lost.carrier_F};
    response linear_response;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++)
            linear_response.A[i][j] = e[i][j];
        for (int j = 0; j < 3; j++)
            linear_response.B[i][j] = e[i][2 + j];
    }
    for (int i = 0; i < 3; i++) {   /* as they are reported */
        for (int j = 0; j < 2; j++)
            linear_response.P[i][j] = direction * M[i][j];
        for (int j = 0; j < 3; j++)
            linear_response.Q[i][j] = direction * M[i][2 + j];
    }
    for (int n = 0; n < 7; n++)
        *of_moments[n] = direction * *of_moments[n];
    return dm_make_linear(made, &linear_response, &lost, h);
}

static clutched_coefficients make_clutched(const model *m, const coefficients *k, const rows *r,
                                           int flow)
{
    const double *e_0 = r->e_0, *e_s = r->e_s, *M_1 = r->M_1, *M_2 = r->M_2;
    clutched_coefficients made = {
        e_0[0], e_0[1], e_s[0], e_s[1], -e_0[5], -e_0[6], -e_s[5], -e_s[6],
        M_1[0], M_1[1], M_2[0], M_2[1], -M_1[5], -M_1[6], -M_2[5], -M_2[6],
        e_0[2], e_0[3], e_0[4], e_s[2], e_s[3], e_s[4],
        M_1[2], M_1[3], M_1[4], M_2[2], M_2[3], M_2[4], k->a_1, k->a_2,
        0.0, 0.0, 0.0, 0.0};
    if (m->run.is_lagged == 0.0) {
        const int is_direct = flow == DIRECT;
        made.phi_1 = is_direct ? k->phi_1 : k->psi_1;
        made.phi_2 = is_direct ? k->phi_2 : k->psi_2;
        made.psi_1 = is_direct ? k->psi_1 : k->phi_1;
        made.psi_2 = is_direct ? k->psi_2 : k->phi_2;
    }
    return made;
}

static self_locking_losses make_self_locking_losses(const model *m, const table *p, int flow)
{
    const double k_1 = m->k_1, k_2 = m->k_2, direct = flow == DIRECT, spin = k_2 / p->g_2s;
    return (self_locking_losses){
        k_1, k_2, p->l_0,
        p->l_1 * k_1 * k_1 + p->l_2 * k_2 * k_2 + p->n_s * p->l_s * spin * spin,
        p->l_1 * k_1 - p->l_2 * k_2, 1 - p->eta_1G, 1 - p->eta_2G, 1 / p->eta_0B - 1, direct,
        1.0 - direct};
}

static symmetric_losses make_symmetric_losses(const table *p, const rows *r, int flow)
{
    const losses_without_clutches l = make_losses(p, flow);
    const double *M = r->M_F;
    return (symmetric_losses){
        l.drag_w, l.drag_s, l.pinion_w, l.carrier_w, l.carrier_s, l.mesh_F, l.mesh_1, l.mesh_2,
        l.pinion_F, l.pinion_T, l.pinion_L, l.carrier_1, l.carrier_2, l.carrier_F, l.carrier_L,
        M[0], M[1], M[2], M[3], M[4], -M[5], -M[6], p->g_F};
}

int dm_make(model *m, const setup *run, const double *parameters)
{
    static const double TOLERANCE = 1e-4;
    const int is_symmetric = run->is_symmetric != 0.0, is_passive = run->is_passive != 0.0;
    const table p = read(is_symmetric, parameters);
    memset(m, 0, sizeof *m);
    m->run = *run;
    m->h = run->dt / run->substeps;
    const int is_exact = is_symmetric && run->has_clutches == 0.0;
    if (is_passive || !is_exact)
        m->tolerance = is_passive || run->is_lagged != 0.0 ? TOLERANCE / 5 : TOLERANCE;
    m->g_12 = is_symmetric ? 1.0 : p.R_2 / p.R_1;
    m->k_1 = m->g_12 / (1 + m->g_12);
    m->k_2 = 1 / (1 + m->g_12);
    m->g_F = p.g_F;
    m->g_2s = p.g_2s;
    m->sign_speed = p.sign_speed;
    if ((is_symmetric && p.g_F == 0.0) || locks_itself(&p)
        || (is_exact && (p.n_F[0] > 0.0 || p.n_F[1] > 0.0)))
        return -1;
    const double spin = m->k_2 / p.g_2s;
    m->form[0] = p.I_0 + p.I_1 + p.I_2 + p.I_3 * p.g_F * p.g_F;
    m->form[1] = p.I_1 * m->k_1 - p.I_2 * m->k_2;
    m->form[2] = (p.I_1 * m->k_1 * m->k_1 + p.I_2 * m->k_2 * m->k_2
                  + p.n_s * p.I_s * spin * spin);
    for (int n = 0; n < CLUTCHES && run->has_clutches != 0.0; n++) {
        const double f = full_slip(&p, n);
        m->f[n] = f;
        m->phi[n] = f * tan(p.alpha);
        m->radius[n] = n ? p.R_2 : p.R_1;
        m->preload[n] = f * p.n_s * p.N[n] * m->radius[n];
        m->coast[n] = p.c[n];
        m->limit[n] = p.A[n];
        m->rise[n] = p.tau[n] == 0.0 ? 1.0 : -expm1(-run->dt / p.tau[n]);
    }

    const coefficients k = make_coefficients(m, &p);
    for (int flow = DIRECT; flow <= REVERSE; flow++) {
        rows r;
        if (!eliminate(&p, &k, flow, &r))
            return -1;
        if (is_passive)
            continue;
        if (is_exact) {
            if (!make_exact(&m->law.exact[flow], &r, &p, flow, m->h))
                return -1;
            continue;
        }
        m->law.paper.k[flow] = make_clutched(m, &k, &r, flow);
        if (is_symmetric)
            m->law.paper.losses[flow].symmetric = make_symmetric_losses(&p, &r, flow);
        else
            m->law.paper.losses[flow].self_locking = make_self_locking_losses(m, &p, flow);
    }
    if (is_passive) {
        m->law.passive = k;
        return dm_has_solutions(&k) ? 0 : -1;
    }
    return 0;
}
