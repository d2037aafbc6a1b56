/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * 4 members at once, in registers of AVX2.
 */

#include "wide.h"

#ifdef HAS_X86_LANES

#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif

#define LANES 4
#define SIGNS_OF(mask) _mm256_movemask_pd((__m256d)(mask))
#define STEPPER dm_step_4
#include "lanes.h"

#ifdef __clang__
#pragma clang attribute pop
#endif

#endif
