/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Which compilers can do the same to many doubles at once, and for which machines.
 */

#ifndef DM_ROS_WIDE_H
#define DM_ROS_WIDE_H

#if defined __GNUC__
#define HAS_LANES
#if defined __x86_64__ && !defined _WIN32   /* where the stack is not aligned enough */
#define HAS_X86_LANES
#include <immintrin.h>
#endif
#endif

#endif
