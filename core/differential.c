/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of a differential: see dm_ros/motion/ticker.py, models.py and the mechanism/ beside it.
 */

#include <string.h>

#include "differential.h"
#include "real.h"

#include "shafts_equations.h"

int dm_shafts(const model *m)
{
    return m->run.is_symmetric != 0.0 ? 5 : 4;
}

int dm_gears(const model *m)
{
    return m->run.is_symmetric != 0.0 ? 3 : 2;
}

int dm_bearings(const model *m)
{
    return m->run.is_symmetric != 0.0 ? 2 : 1;
}

int dm_moments(const model *m)
{
    return dm_gears(m) + (m->run.has_clutches != 0.0 ? CLUTCHES : 0);
}

/* Put the speeds of the shafts with a port into speeds, from x, or their angles. */
static void at_ports(const model *m, const double *x, double *speeds)
{
    port_speeds_of(m->g_F, m->k_1, m->k_2, x, speeds);
}

/* Put the speeds of all shafts into speeds, from x, or their angles. */
static void all_shafts(const model *m, const double *x, double *speeds)
{
    speeds_of(m->g_F, m->k_1, m->k_2, m->g_2s, x, speeds);
}

static void positions(const model *m, const state *now, double *angles)
{
    all_shafts(m, now->turned, angles);
    for (int n = 0; n < SHAFTS; n++)
        angles[n] = now->origin[n] + angles[n];
}

static void independent(const model *m, double omega_1, double omega_2, double *x)
{
    x[0] = (omega_1 + m->g_12 * omega_2) / (1 + m->g_12);
    x[1] = omega_1 - omega_2;
}

void dm_reset(const model *m, state *now, const double *velocity)
{
    memset(now, 0, sizeof *now);
    now->flow = 1.0;
    now->seen[0] = NAN;   /* nothing was */
    independent(m, velocity[0], velocity[1], now->x);
}

void dm_adopt(const model *before, const model *after, state *now)
{
    double speeds[SHAFTS], angles[SHAFTS];
    all_shafts(before, now->x, speeds);
    positions(before, now, angles);
    memcpy(now->origin, angles, sizeof angles);
    now->turned[0] = now->turned[1] = 0.0;
    now->seen[0] = NAN;   /* it was of the other model */
    independent(after, speeds[1], speeds[2], now->x);
}

/* Return the power-flow index. */
static double flow_of(const model *m, const double *x, const double *T, double last)
{
    const double deadband = m->run.deadband;
    const double power = input_power(T[0], m->g_F, x[0]);
    if (m->run.is_passive != 0.0)
        return flow_of_input(power, x[0], m->sign_speed, deadband, last);
    double speeds[PORTS];
    at_ports(m, x, speeds);
    return flow_of_powers(power, T[1] * speeds[1] + T[2] * speeds[2], deadband, last);
}

/* Put the friction at full slip that does not follow the moments of a step into S. */
static void friction(const model *m, const double *memory, const double *force, double *S)
{
    const int pressed = force[0] != 0.0 || force[1] != 0.0;
    for (int n = 0; n < CLUTCHES; n++) {
        S[n] = pressed_friction(pressed, m->preload[n], m->f[n], force[n], m->radius[n]);
        if (m->run.is_lagged != 0.0)
            S[n] = m->phi[n] * memory[n] + S[n];
    }
}

/* What a solver step did, or what is known of a state. */
typedef struct {
    step job;
    pair end, integral;
    const point *at;       /* in the job */
    const linear *exact;   /* of an exact step, and of a state at which one begins; or NULL */
    double work[PORTS], lost[LOST], numerical;
    int coarse;
} moved;

static int index_of(double flow)
{
    return flow < 0.0;
}

/* Begin with what holds for every step; what is large is left as it is. */
static void begin(step *job)
{
    job->law = NULL;
    job->start = NULL;
    job->seen = NULL;
    job->has_books = job->broken = job->coarse = 0;
}

/* Make a step ready: its law, coefficients and what is held in it. */
static void prepare(const model *m, const double *T, const double *S, double flow, step *job)
{
    job->h = m->h;
    job->tolerance = m->tolerance;
    memcpy(job->form, m->form, sizeof job->form);
    memcpy(job->T, T, sizeof job->T);
    if (m->run.is_passive != 0.0) {
        job->law = &dm_passive;
        job->coefficients = &m->law.passive;
        memcpy(job->u, T, PORTS * sizeof *T);
        memcpy(job->u + PORTS, S, CLUTCHES * sizeof *S);
    } else if (m->run.is_symmetric == 0.0 || m->run.has_clutches != 0.0) {
        const int n = index_of(flow);
        job->law = m->run.is_symmetric != 0.0 ? &dm_clutched_symmetric : &dm_clutched;
        job->coefficients = &m->law.paper.k[n];
        job->losses = &m->law.paper.losses[n];
        dm_clutched_held(job->coefficients, T, S, job->u);
    }
}

static int has_patterns(const model *m)
{
    return m->run.is_passive != 0.0 && m->run.is_symmetric != 0.0 && m->run.has_clutches == 0.0;
}

static int is_always_exact(const model *m)
{
    return m->run.is_passive == 0.0 && m->run.is_symmetric != 0.0 && m->run.has_clutches == 0.0;
}

/* Return what is exact at a point, NULL where nothing is. */
static const linear *exact_at(const model *m, patterns *known, pair x, double T_in,
                              const point *at)
{
    const coefficients *k = &m->law.passive;
    if (!has_patterns(m) || !dm_has_pattern(k, x))
        return NULL;
    const pattern *found = dm_pattern_at(known, k, m->h, T_in, at);
    return found ? &found->exact : NULL;
}

/* Find what is known of a state; return 0, or -1 where a number is divided by zero. */
static int find(const model *m, const state *now, patterns *known, moved *found)
{
    double S[CLUTCHES];
    if (is_always_exact(m)) {
        found->exact = &m->law.exact[index_of(now->flow)];
        return 0;
    }
    step *job = &found->job;
    begin(job);
    friction(m, now->memory, now->force, S);
    prepare(m, now->held, S, now->flow, job);
    job->law->evaluate(job, now->x[0], now->x[1], &job->points[0]);
    found->at = &job->points[0];
    found->exact = exact_at(m, known, (pair){now->x[0], now->x[1]}, now->held[0], found->at);
    return job->broken ? -1 : 0;
}

/* Take the exact step of the signs at x; where there is none, the job starts from its point. */
static void pattern_step(const model *m, patterns *known, pair x, const double *T, moved *did)
{
    const coefficients *k = &m->law.passive;
    step *job = &did->job;
    const pattern *p = known->met ? &known->kept[known->last] : NULL;
    if (p && p->is_none)
        p = NULL;
    const int guess = p ? p->key : 0;
    if (!p || !dm_pattern_step(p, x, T, &did->end, &did->integral)) {
        job->law->evaluate(job, x.w, x.s, &job->points[0]);
        job->start = &job->points[0];
        p = dm_pattern_at(known, k, m->h, T[0], job->start);
        if (!p || p->key == guess || !dm_pattern_step(p, x, T, &did->end, &did->integral))
            return;
    }
    did->exact = &p->exact;
}

/* Advance by a solver step; return 0 or -1. */
static int advance(const model *m, patterns *known, const double *x, const double *S,
                   const double *T, double flow, const double *seen, int has_books, moved *did)
{
    const pair from = {x[0], x[1]};
    step *job = &did->job;
    begin(job);
    job->has_books = has_books;
    job->seen = seen;
    did->exact = NULL;
    did->at = NULL;
    did->coarse = 0;
    did->numerical = 0.0;
    if (is_always_exact(m)) {
        did->exact = &m->law.exact[index_of(flow)];
        dm_exact_step(did->exact, from, T, &did->end, &did->integral);
        if (!has_books)
            return 0;
    } else {
        prepare(m, T, S, flow, job);
    }
    if (has_patterns(m) && dm_has_pattern(&m->law.passive, from))
        pattern_step(m, known, from, T, did);
    if (did->exact) {
        if (has_books)
            dm_exact_book(did->exact, m->g_F, m->h, from, did->end, did->integral, T, did->work,
                          did->lost);
        return job->broken ? -1 : 0;
    }
    if (dm_advance(job, from))
        return -1;
    did->end = job->end;
    did->integral = job->integral;
    did->at = job->at_end;
    did->coarse = job->coarse;
    if (has_books) {
        at_ports(m, (double[]){job->integral.w, job->integral.s}, did->work);
        for (int n = 0; n < PORTS; n++)
            did->work[n] = T[n] * did->work[n];
        memcpy(did->lost, job->lost, sizeof job->lost);
        did->numerical = job->numerical;
    }
    did->exact = exact_at(m, known, job->end, T[0], did->at);
    return job->broken ? -1 : 0;
}

/* Put the moments at a state into moment; a mesh is positive when the mechanism drives. */
static void moments(const model *m, const state *now, const moved *found, double *moment)
{
    const point *at = found->at;
    const double direction = m->run.is_passive != 0.0 ? 1.0 : now->flow;
    if (found->exact) {
        dm_exact_moments(found->exact, (pair){now->x[0], now->x[1]}, now->held, moment);
        return;
    }
    if (m->run.is_symmetric != 0.0) {
        if (m->run.is_passive != 0.0) {
            *moment++ = at->M_F + 0.0;
        } else {
            const symmetric_losses *k = &m->law.paper.losses[index_of(now->flow)].symmetric;
            const double *T = now->held;
            const double M_F = (k->P_w * now->x[0] + k->P_s * now->x[1] + k->Q_0 * T[0]
                                + k->Q_1 * T[1] + k->Q_2 * T[2] - k->W_1 * at->F_1
                                - k->W_2 * at->F_2);
            *moment++ = direction * M_F;
        }
    }
    const int without = has_patterns(m);
    *moment++ = without ? at->M_1 + 0.0 : direction * at->M_1;
    *moment++ = without ? at->M_2 + 0.0 : direction * at->M_2;
    if (m->run.has_clutches != 0.0) {
        *moment++ = at->F_1 + 0.0;
        *moment++ = at->F_2 + 0.0;
    }
}

static void tell(const model *m, const state *now, const moved *found, report *told)
{
    all_shafts(m, now->x, told->velocity);
    positions(m, now, told->position);
    moments(m, now, found, told->moment);
}

int dm_report(const model *m, const state *now, patterns *known, report *told)
{
    moved found;
    if (find(m, now, known, &found))
        return -1;
    tell(m, now, &found, told);
    return 0;
}

int dm_tick(const model *m, state *now, patterns *known, const double *T, const double *commands,
            books *kept, report *told)
{
    moved did;
    double x[2] = {now->x[0], now->x[1]}, turned[2] = {now->turned[0], now->turned[1]};
    double memory[CLUTCHES] = {now->memory[0], now->memory[1]};
    double force[CLUTCHES] = {now->force[0], now->force[1]};
    double flow = now->flow, coarse_steps = now->coarse_steps, S[CLUTCHES], tick[ENTRIES];
    const double *seen = now->seen;
    if (m->run.has_clutches != 0.0 && commands) {
        for (int n = 0; n < CLUTCHES; n++)
            force[n] = force_after(force[n], commands[n], m->limit[n], m->rise[n]);
    }
    const int lagged = m->run.is_lagged != 0.0, substeps = (int)m->run.substeps;
    if (lagged && find(m, now, known, &did))
        return -1;
    friction(m, memory, force, S);
    for (int n = 0; n < substeps; n++) {
        const double was = m->run.is_passive != 0.0 ? 1.0 : flow;
        flow = flow_of(m, x, T, flow);
        if (lagged) {
            const double M[CLUTCHES] = {was * did.at->M_1, was * did.at->M_2};
            for (int i = 0; i < CLUTCHES; i++)
                memory[i] = M[i] >= 0.0 ? M[i] : -M[i] * m->coast[i];
            friction(m, memory, force, S);
        }
        if (advance(m, known, x, S, T, flow, seen, kept != NULL, &did))
            return -1;
        if (kept)
            dm_book_step(m, n == 0, x, &did.end, did.work, did.lost, did.numerical, tick);
        if (m->run.is_passive != 0.0 && did.at)
            seen = did.at->state;
        x[0] = did.end.w;
        x[1] = did.end.s;
        turned[0] += did.integral.w;
        turned[1] += did.integral.s;
        coarse_steps += did.coarse;
    }
    if (!isfinite(x[0] + x[1] + turned[0] + turned[1]))
        return -1;
    if (seen != now->seen)
        memcpy(now->seen, seen, sizeof now->seen);
    for (int n = 0; n < 2; n++) {
        now->x[n] = x[n];
        now->turned[n] = turned[n];
        now->memory[n] = memory[n];
        now->force[n] = force[n];
    }
    for (int n = 0; n < PORTS; n++)
        now->torque[n] = now->held[n] = T[n];
    now->flow = flow;
    now->coarse_steps = coarse_steps;
    now->ticks += 1.0;
    if (kept)
        dm_book_tick(m, now, tick, kept);
    if (told)
        tell(m, now, &did, told);
    return 0;
}
