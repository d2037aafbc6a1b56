/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * 2 members at once, in registers which every machine has that this is built for.
 */

#include "wide.h"

#ifdef HAS_LANES

#define LANES 2
#ifdef HAS_X86_LANES
#define SIGNS_OF(mask) _mm_movemask_pd((__m128d)(mask))
#endif
#define STEPPER dm_step_2
#include "lanes.h"

#endif
