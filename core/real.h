/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What the equations are written in, once: REAL is a double, or, where LANES says so, as many
 * doubles side by side, on which every operation is that of a double, to the last bit.
 *
 * A MASK says for which of them something holds. OF(name) is the type of that name made of REAL.
 */

#ifdef LANES

#define OF(name) name##_lanes

typedef double REAL __attribute__((vector_size(8 * LANES)));
typedef long long MASK __attribute__((vector_size(8 * LANES)));

static inline REAL fill(double value)
{
    REAL all = {0};
    for (int n = 0; n < LANES; n++)
        all[n] = value;
    return all;
}

static inline REAL pick(MASK which, REAL yes, REAL no)
{
    return (REAL)(((MASK)yes & which) | ((MASK)no & ~which));
}

static inline int any(MASK which)
{
#ifdef SIGNS_OF
    return SIGNS_OF(which) != 0;   /* in one instruction */
#else
    long long found = 0;
    for (int n = 0; n < LANES; n++)
        found |= which[n];
    return found != 0;
#endif
}

static inline MASK opposite(MASK which)
{
    return ~which;
}

/* Append a binary digit to each number. */
static inline MASK with_digit(MASK number, MASK digit)
{
    return 2 * number - digit;
}

static inline REAL absolute(REAL x)
{
    return (REAL)((MASK)x & 0x7fffffffffffffff);
}

static inline REAL root_of(REAL x)
{
    REAL all = {0};
    for (int n = 0; n < LANES; n++)
        all[n] = sqrt(x[n]);
    return all;
}

static inline MASK no_mask(void)
{
    return (MASK){0};
}

static inline REAL expm1_of(REAL x, MASK which)
{
    for (int n = 0; n < LANES; n++)
        if (which[n])
            x[n] = expm1(x[n]);
    return x;
}

/* tanh, where it is not 1 or x to the last bit one after the other. */
static inline REAL tanh_of(REAL x)
{
    const MASK is_one = absolute(x) >= 22.0;
    REAL all = pick(is_one, pick(x > 0.0, fill(1.0), fill(-1.0)), x);
    const MASK others = ~is_one & (x != 0.0);
    if (any(others))
        for (int n = 0; n < LANES; n++)
            if (others[n])
                all[n] = tanh(x[n]);
    return all;
}

#else

#define OF(name) name

typedef double REAL;
typedef int MASK;

static inline double fill(double value)
{
    return value;
}

static inline double pick(int which, double yes, double no)
{
    return which ? yes : no;
}

static inline int any(int which)
{
    return which;
}

static inline int opposite(int which)
{
    return !which;
}

static inline int with_digit(int number, int digit)
{
    return 2 * number + digit;
}

static inline double absolute(double x)
{
    return fabs(x);
}

static inline double root_of(double x)
{
    return sqrt(x);
}

static inline int no_mask(void)
{
    return 0;
}

static inline double expm1_of(double x, int which)
{
    return which ? expm1(x) : x;
}

static inline double tanh_of(double x)
{
    return tanh(x);
}

#endif
