/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * 8 members at once, in registers of AVX-512.
 */

#include "wide.h"

#ifdef HAS_X86_LANES

#ifdef __clang__
#pragma clang attribute push( \
    __attribute__((target("avx512f,avx512dq,avx512vl"))), apply_to = function)
#else
#pragma GCC target("avx512f,avx512dq,avx512vl")
#endif

#define LANES 8
#define SIGNS_OF(mask) _mm512_movepi64_mask((__m512i)(mask))
#define STEPPER dm_step_8
#include "lanes.h"

#ifdef __clang__
#pragma clang attribute pop
#endif

#endif
