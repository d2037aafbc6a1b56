/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of LANES members at once: as dm_tick, to the last bit.
 *
 * Whatever is rare, such as signs that are not found in a few rounds or a tick of many parts, is
 * left to dm_tick, which then takes the whole tick of that member.
 */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "../exponentials.h"
#include "member.h"

#include "../real.h"

#include "../types.h"

typedef struct {
    OF(matrix) J;
} OF(slopes);

/* A step of all; of those that are not watched nothing matters. */
typedef struct {
    const void *coefficients;   /* of the law */
    int is_passive;
    REAL u[HELD], h, tolerance;
    const REAL *seen;
    MASK watched, broken;
} OF(step);

static inline REAL OF(quotient)(OF(step) *job, REAL a, REAL b)
{
    job->broken |= (b == 0.0) & job->watched;
    return a / b;
}

static inline MASK OF(watched)(const OF(step) *job)
{
    return job->watched;
}

/* Watch some; return which were watched. */
static inline MASK OF(watch)(OF(step) *job, MASK which)
{
    const MASK before = job->watched;
    job->watched = which;
    return before;
}

#include "../clutched_equations.h"
#include "../exact_equations.h"
#include "../exponentials_equations.h"
#include "../passive_equations.h"
#include "../shafts_equations.h"

static OF(pair) apply_phi_2(OF(step) *job, REAL z_11, REAL z_12, REAL z_21, REAL z_22, REAL v_1,
                            REAL v_2)
{
    const REAL mean = (z_11 + z_22) / 2, half = (z_11 - z_22) / 2;
    const REAL square = half * half + z_12 * z_21;
    const REAL root = root_of(absolute(square));
    const MASK is_plain = opposite(square < 0.0) & (root > APART);
    OF(pair) found = of_two_modes(job, mean, root, z_11, z_12, z_21, z_22, v_1, v_2);
    const MASK others = opposite(is_plain) & job->watched;
    for (int n = 0; any(others) && n < LANES; n++) {
        if (others[n]) {
            step one = {0};
            const pair v = dm_apply_phi_2(&one, z_11[n], z_12[n], z_21[n], z_22[n], v_1[n],
                                          v_2[n]);
            found.w[n] = v.w;
            found.s[n] = v.s;
            job->broken[n] |= -one.broken;
        }
    }
    return found;
}

static MASK same_bits(REAL a, REAL b)
{
    return (MASK)a == (MASK)b;
}

static void evaluate_passive(OF(step) *job, REAL w, REAL s, OF(point) *at)
{
    REAL q[2];
    OF(signs) found;
    const MASK is_seen = job->seen ? same_bits(job->seen[0], w) & same_bits(job->seen[1], s)
                                   : no_mask();
    if (any(opposite(is_seen) & job->watched)) {
        at->state[0] = w;
        at->state[1] = s;
        find_signs(job, w, s, at->state);
    } else {
        memcpy(at->state, job->seen, sizeof at->state);
    }
    OF(signs) sign = first_guess(job, at->state, q);
    MASK open = job->watched;
    for (int n = 0; n < ROUNDS; n++) {
        open &= solve(job, q[0], q[1], sign, &found, at) != 0.0;
        if (!any(open))
            return;
        sign.s_1 = pick(open, found.s_1, sign.s_1);
        sign.s_2 = pick(open, found.s_2, sign.s_2);
        sign.s_F = pick(open, found.s_F, sign.s_F);
        sign.h_N = pick(open, found.h_N, sign.h_N);
        sign.b = pick(open, found.b, sign.b);
    }
    job->broken |= open;
}

static void evaluate(OF(step) *job, REAL w, REAL s, OF(point) *at)
{
    if (job->is_passive)
        evaluate_passive(job, w, s, at);
    else
        evaluate_clutched(job, w, s, at);
}

static OF(slopes) slopes_at(OF(step) *job, const OF(point) *at)
{
    REAL F[4];
    return (OF(slopes)){job->is_passive ? jacobian_at(job, at) : jacobian_clutched(job, at, F)};
}

static MASK bends(const OF(step) *job, const OF(point) *here, const OF(point) *there)
{
    return job->is_passive ? bends_between(job, here, there) : opposite(no_mask());
}

#define EVALUATE evaluate
#define JACOBIAN slopes_at
#define BENDS bends
#define APPLY_PHI_2 apply_phi_2

#include "../part_equations.h"

enum { TRIALS = 40 };   /* of a step, before it is left to dm_tick */

/* Put some of the numbers of one into another. */
static void put(MASK which, size_t count, const REAL *from, REAL *into)
{
    for (size_t n = 0; n < count; n++)
        into[n] = pick(which, from[n], into[n]);
}

/* Put some of one point into another. */
static void blend(MASK which, const OF(point) *from, OF(point) *into)
{
    put(which, sizeof *from / sizeof(REAL), (const REAL *)from, (REAL *)into);
}

/* Advance those that are watched from the point here, as dm_advance; points are there for use. */
static const OF(point) *advance(OF(step) *job, OF(pair) y, OF(point) *here, OF(point) *points,
                                OF(pair) *end, OF(pair) *integral)
{
    REAL w = y.w, s = y.s, left = job->h, h = job->h;
    REAL angle_w = fill(0.0), angle_s = fill(0.0);
    OF(point) *there = &points[0], *last = &points[1];
    OF(trial) found;
    MASK open = job->watched;
    const double relative = job->is_passive ? dm_passive.relative : dm_clutched.relative;
    job->broken |= open & opposite(absolute(here->e_0) + absolute(here->e_s) < FASTEST);
    job->seen = NULL;
    OF(matrix) J = found.at_end.J = slopes_at(job, here).J;
    for (int n = 0; n < TRIALS; n++) {
        try_part(job, here, J, w, s, h, relative, there, &found);
        const MASK fits = (found.error <= 1.0) & open;
        const OF(pair) d = found.d, c = found.c;
        angle_w = pick(fits, angle_w + (found.integral.w + h * c.w / 4), angle_w);
        angle_s = pick(fits, angle_s + (found.integral.s + h * c.s / 4), angle_s);
        w = pick(fits, w + d.w + c.w, w);
        s = pick(fits, s + d.s + c.s, s);
        left = pick(fits, left - h, left);
        const MASK done = fits & (left <= 0.0);
        open &= opposite(done | job->broken);
        if (n == 0 && !any(open)) {
            last = there;
            break;
        }
        blend(done, there, last);
        if (!any(open))
            break;
        job->watched = open;
        const MASK goes_on = fits & open;
        if (any(goes_on)) {
            OF(matrix) next = J;
            if (any(goes_on & opposite(found.has_slopes)))
                next = slopes_at(job, there).J;
            const REAL *known = (const REAL *)&found.at_end, *new = (const REAL *)&next;
            REAL *into = (REAL *)&J;
            for (int i = 0; i < 4; i++)
                into[i] = pick(goes_on, pick(found.has_slopes, known[i], new[i]), into[i]);
            blend(goes_on, there, here);
        }
        for (int i = 0; i < LANES; i++)
            if (open[i])
                h[i] = next_part(h[i], found.error[i], left[i]);
    }
    job->broken |= open;
    *end = (OF(pair)){w, s};
    *integral = (OF(pair)){angle_w, angle_s};
    return last;
}

/* The members of a block, and what is known of them. */
typedef struct {
    const task *of;
    ptrdiff_t first;
    const model *m;                        /* that of the first */
    int is_passive, has_exact;             /* or every step is exact; or some, by their signs */
    OF(coefficients) k;
    OF(clutched_coefficients) paper[3];    /* direct flow, reverse flow, each its own */
    OF(exact) exact[3];
    REAL h, tolerance, k_1, k_2, g_F, g_2s, deadband;
    REAL preload[CLUTCHES], f[CLUTCHES], radius[CLUTCHES], limit[CLUTCHES], rise[CLUTCHES];
    OF(state) now;
    MASK alive;
    MASK key;                              /* of the signs that were looked up last; or 0 */
    MASK has_way;                          /* they have an exact step */
    OF(way) way;
    OF(exact) map;
} block;

/* Put numbers into one lane, or take them from it. */
static void set_lane(void *into, int lane, const void *from, size_t size)
{
    double *values = into;
    const double *numbers = from;
    for (size_t n = 0; n < size / sizeof *numbers; n++)
        values[n * LANES + lane] = numbers[n];
}

static void get_lane(const void *from, int lane, void *into, size_t size)
{
    const double *values = from;
    double *numbers = into;
    for (size_t n = 0; n < size / sizeof *numbers; n++)
        numbers[n] = values[n * LANES + lane];
}

/* Put numbers of all into their lanes; from are those of the first, stride bytes apart. */
static inline void set_lanes(void *into, const void *from, size_t stride, size_t size)
{
    double *values = into;
    for (size_t n = 0; n < size; n += sizeof *values)
        for (int lane = 0; lane < LANES; lane++)
            *values++ = *(const double *)((const char *)from + lane * stride + n);
}

static void know(block *b, int lane)
{
    b->alive[lane] = b->of->members[b->first + lane].failed ? 0 : -1;
    b->key[lane] = b->has_way[lane] = 0;
}

static void store_state(const block *b, int lane)
{
    get_lane(&b->now, lane, &b->of->members[b->first + lane].now, sizeof(state));
}

static void load(block *b, const task *of, ptrdiff_t first)
{
    const model *m = &of->models[first];
    b->of = of;
    b->first = first;
    b->m = m;
    b->is_passive = m->run.is_passive != 0.0;
    b->has_exact = m->run.is_symmetric != 0.0 && m->run.has_clutches == 0.0;
    for (int n = 0; n < 2; n++) {
        if (b->is_passive)
            set_lanes(&b->k, &m->law.passive, sizeof *m, sizeof m->law.passive);
        else if (b->has_exact)
            set_lanes(&b->exact[n], &m->law.exact[n].map, sizeof *m, sizeof(exact));
        else
            set_lanes(&b->paper[n], &m->law.paper.k[n], sizeof *m, sizeof m->law.paper.k[n]);
    }
    set_lanes(&b->h, &m->h, sizeof *m, sizeof m->h);
    set_lanes(&b->tolerance, &m->tolerance, sizeof *m, sizeof m->tolerance);
    set_lanes(&b->k_1, &m->k_1, sizeof *m, sizeof m->k_1);
    set_lanes(&b->k_2, &m->k_2, sizeof *m, sizeof m->k_2);
    set_lanes(&b->g_F, &m->g_F, sizeof *m, sizeof m->g_F);
    set_lanes(&b->g_2s, &m->g_2s, sizeof *m, sizeof m->g_2s);
    set_lanes(&b->deadband, &m->run.deadband, sizeof *m, sizeof m->run.deadband);
    set_lanes(b->preload, m->preload, sizeof *m, sizeof m->preload);
    set_lanes(b->f, m->f, sizeof *m, sizeof m->f);
    set_lanes(b->radius, m->radius, sizeof *m, sizeof m->radius);
    set_lanes(b->limit, m->limit, sizeof *m, sizeof m->limit);
    set_lanes(b->rise, m->rise, sizeof *m, sizeof m->rise);
    set_lanes(&b->now, &of->members[first].now, sizeof *of->members, sizeof(state));
    for (int n = 0; n < LANES; n++)
        know(b, n);
}

/* Look up the patterns of signs at a point; return where there is one that was not there. */
static MASK find_ways(block *b, MASK which, const OF(point) *at, REAL T_in)
{
    MASK is_new = no_mask();
    const MASK key = number_of_signs(at, T_in);
    which &= key != b->key;
    for (int n = 0; any(which) && n < LANES; n++) {
        if (!which[n])
            continue;
        point here;
        get_lane(at, n, &here, sizeof here);
        const ptrdiff_t place = b->first + n;
        const pattern *p = dm_pattern_at(dm_known_of(&b->of->members[place]),
                                         &b->of->models[place].law.passive, b->h[n], T_in[n],
                                         &here);
        b->key[n] = key[n];
        b->has_way[n] = is_new[n] = p ? -1 : 0;
        if (p) {
            set_lane(&b->way, n, &p->way, sizeof p->way);
            set_lane(&b->map, n, &p->exact.map, sizeof p->exact.map);
        }
    }
    return is_new;
}

/* What a solver step of a block did; a point where it took no exact step. */
typedef struct {
    OF(pair) end, integral;
    MASK is_exact;
    const OF(point) *at;
    OF(point) points[3];
} OF(moved);

/* Take the exact steps of some, where their signs hold. */
static MASK exact_steps(const block *b, MASK which, OF(pair) x, const REAL *T, OF(moved) *did)
{
    if (!any(which))
        return which;
    OF(pair) end, integral;
    exact_step(&b->map, x, T, &end, &integral);
    const MASK held = which & holds(&b->way, x, T, end);
    did->end = (OF(pair)){pick(held, end.w, did->end.w), pick(held, end.s, did->end.s)};
    did->integral = (OF(pair)){pick(held, integral.w, did->integral.w),
                               pick(held, integral.s, did->integral.s)};
    return held;
}

/* Return which of direct flow, reverse flow and each its own has what holds, of this size. */
static const void *of_flow(REAL flow, void *three, size_t size)
{
    char *direct = three, *reverse = direct + size, *own = reverse + size;
    const MASK is_reverse = flow < 0.0;
    if (!any(is_reverse))
        return direct;
    if (!any(opposite(is_reverse)))
        return reverse;
    memcpy(own, direct, size);
    put(is_reverse, size / sizeof(REAL), (const REAL *)reverse, (REAL *)own);
    return own;
}

/* Advance by a solver step; return where it cannot. */
static MASK solver_step(block *b, OF(pair) x, const REAL *seen, const REAL *T, const REAL *S,
                        REAL flow, OF(moved) *did)
{
    OF(step) job;
    MASK fast = no_mask();
    job.h = b->h;
    job.tolerance = b->tolerance;
    job.is_passive = b->is_passive;
    job.broken = did->is_exact = no_mask();
    if (b->is_passive) {
        job.coefficients = &b->k;
        job.seen = seen;
        memcpy(job.u, T, PORTS * sizeof *T);
        memcpy(job.u + PORTS, S, CLUTCHES * sizeof *S);
        if (b->has_exact) {
            fast = is_fast(&b->k, x) & b->alive;
            did->is_exact = exact_steps(b, fast & b->has_way, x, T, did);
        }
    } else if (b->has_exact) {
        exact_step(of_flow(flow, b->exact, sizeof *b->exact), x, T, &did->end, &did->integral);
        did->is_exact = opposite(no_mask());
        return no_mask();
    } else {
        job.coefficients = of_flow(flow, b->paper, sizeof *b->paper);
        hold(job.coefficients, T, S, job.u);
    }
    job.watched = b->alive & opposite(did->is_exact);
    if (!any(job.watched))
        return job.broken;
    evaluate(&job, x.w, x.s, &did->points[2]);
    const MASK at_signs = fast & job.watched & opposite(job.broken);
    const MASK is_new = any(at_signs) ? find_ways(b, at_signs, &did->points[2], T[0]) : at_signs;
    did->is_exact |= exact_steps(b, is_new, x, T, did);
    job.watched &= opposite(did->is_exact);
    if (!any(job.watched))
        return job.broken;
    OF(pair) end, integral;
    const MASK rest = job.watched;
    did->at = advance(&job, x, &did->points[2], did->points, &end, &integral);
    did->end = (OF(pair)){pick(rest, end.w, did->end.w), pick(rest, end.s, did->end.s)};
    did->integral = (OF(pair)){pick(rest, integral.w, did->integral.w),
                               pick(rest, integral.s, did->integral.s)};
    return job.broken;
}

/* Put what is reported after a tick into the rows of some. */
static void tell(block *b, ptrdiff_t t, MASK which, const OF(moved) *did)
{
    const OF(state) *now = &b->now;
    REAL all[COLUMNS];
    for (int n = 0; n < COLUMNS; n++)
        all[n] = fill(0.0);
    speeds_of(b->g_F, b->k_1, b->k_2, b->g_2s, now->x, all);
    REAL *angle = all + SHAFTS, *moment = angle + SHAFTS;
    speeds_of(b->g_F, b->k_1, b->k_2, b->g_2s, now->turned, angle);
    for (int n = 0; n < SHAFTS; n++)
        angle[n] = now->origin[n] + angle[n];

    const OF(pair) x = {now->x[0], now->x[1]};
    MASK is_exact = did->is_exact;
    const OF(exact) *map = &b->map;
    if (!b->is_passive && b->has_exact)
        map = of_flow(now->flow, b->exact, sizeof *b->exact);
    if (any(which & opposite(is_exact))) {
        const REAL direction = b->is_passive ? fill(1.0) : now->flow;
        REAL *next = moment;
        if (b->m->run.is_symmetric != 0.0)
            *next++ = did->at->M_F + 0.0;
        *next++ = b->has_exact ? did->at->M_1 + 0.0 : direction * did->at->M_1;
        *next++ = b->has_exact ? did->at->M_2 + 0.0 : direction * did->at->M_2;
        if (b->m->run.has_clutches != 0.0) {
            *next++ = did->at->F_1 + 0.0;
            *next++ = did->at->F_2 + 0.0;
        }
        if (b->has_exact) {
            const MASK fast = which & opposite(is_exact) & is_fast(&b->k, x);
            if (any(fast))
                find_ways(b, fast, did->at, now->held[0]);
            is_exact |= fast & b->has_way;
        }
    }
    if (any(which & is_exact))
        for (int n = 0; n < 3; n++)
            moment[n] = pick(is_exact, response_to(map->moments[n], x, now->held), moment[n]);
    REAL *more = moment + MOMENTS;
    *more++ = now->flow;
    *more++ = now->force[0];
    *more++ = now->force[1];
    *more++ = now->coarse_steps;
    for (int n = 0; n < LANES; n++)
        if (which[n])
            get_lane(all, n, &b->of->rows[(t * b->of->count + b->first + n) * COLUMNS],
                     sizeof(double[COLUMNS]));
}

/* Take one number of what each is given in a tick; stride is that of two members. */
static REAL given(const double *numbers, ptrdiff_t stride)
{
    if (!stride)
        return fill(*numbers);
    REAL all = {0};
    for (int n = 0; n < LANES; n++)
        all[n] = numbers[n * stride];
    return all;
}

static void tick(block *b, ptrdiff_t t)
{
    const task *of = b->of;
    const int substeps = (int)b->m->run.substeps;
    const ptrdiff_t place = t * of->of_tick + b->first * of->of_member;
    OF(state) *now = &b->now;
    OF(moved) did;
    REAL x[2] = {now->x[0], now->x[1]}, turned[2] = {now->turned[0], now->turned[1]};
    REAL force[CLUTCHES] = {now->force[0], now->force[1]}, flow = now->flow;
    REAL T[PORTS], S[CLUTCHES], seen[STATE];
    for (int n = 0; n < PORTS; n++)
        T[n] = given(of->torques + PORTS * place + n, PORTS * of->of_member);
    if (b->m->run.has_clutches != 0.0 && of->forces)
        for (int n = 0; n < CLUTCHES; n++)
            force[n] = force_after(force[n], given(of->forces + CLUTCHES * place + n,
                                                   CLUTCHES * of->of_member),
                                   b->limit[n], b->rise[n]);
    const MASK is_pressed = (force[0] != 0.0) | (force[1] != 0.0);
    for (int n = 0; n < CLUTCHES; n++)
        S[n] = pressed_friction(is_pressed, b->preload[n], b->f[n], force[n], b->radius[n]);
    MASK left = no_mask(), is_fresh = no_mask();   /* to dm_tick; what was seen */
    for (int n = 0; n < substeps; n++) {
        const REAL power = input_power(T[0], b->g_F, x[0]);
        if (b->is_passive) {
            flow = flow_of_input(power, x[0], b->k.sign_speed, b->deadband, flow);
        } else {
            REAL speeds[PORTS];
            port_speeds_of(b->g_F, b->k_1, b->k_2, x, speeds);
            flow = flow_of_powers(power, T[1] * speeds[1] + T[2] * speeds[2], b->deadband, flow);
        }
        left |= solver_step(b, (OF(pair)){x[0], x[1]}, n ? seen : now->seen, T, S, flow, &did);
        const MASK rest = b->alive & opposite(did.is_exact);
        if (n == 0 && (any(rest) || substeps > 1))
            memcpy(seen, now->seen, sizeof seen);
        if (b->is_passive && any(rest)) {
            put(rest, STATE, did.at->state, seen);
            is_fresh |= rest;
        }
        x[0] = did.end.w;
        x[1] = did.end.s;
        turned[0] += did.integral.w;
        turned[1] += did.integral.s;
    }
    const REAL sum = x[0] + x[1] + turned[0] + turned[1];
    const MASK moved = b->alive & opposite(left) & (sum - sum == 0.0);
    put(moved, 2, x, now->x);
    put(moved, 2, turned, now->turned);
    put(moved, CLUTCHES, force, now->force);
    put(moved, 1, &flow, &now->flow);
    put(moved, PORTS, T, now->torque);
    put(moved, PORTS, T, now->held);
    now->ticks = pick(moved, now->ticks + 1.0, now->ticks);
    if (any(is_fresh))
        put(moved, STATE, seen, now->seen);
    if (of->rows)
        tell(b, t, moved, &did);
    for (int n = 0; any(opposite(moved)) && n < LANES; n++) {
        if (!moved[n]) {
            store_state(b, n);
            dm_member_tick(of, b->first + n, t);
            set_lane(&b->now, n, &of->members[b->first + n].now, sizeof(state));
            know(b, n);
        }
    }
}

void STEPPER(const task *of, ptrdiff_t first)
{
    block b;
    load(&b, of, first);
    for (ptrdiff_t t = 0; t < of->ticks; t++)
        tick(&b, t);
    for (int n = 0; n < LANES; n++)
        store_state(&b, n);
}
