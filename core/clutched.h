/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The motion of a differential with clutches under the paper's law of losses: see
 * dm_ros/mechanism/clutched.py and losses.py.
 */

#ifndef DM_ROS_CLUTCHED_H
#define DM_ROS_CLUTCHED_H

#include "core.h"

/* What is held in a step. */
enum { B_W, B_S, M_ONE, M_TWO, S_1, S_2 };

/* In the order of losses.SelfLockingLosses. */
typedef struct {
    double k_1, k_2, drag_w, drag_s, carrier_s, mesh_1, mesh_2, bearing_0, direct, reverse;
} self_locking_losses;

/* In the order of losses.SymmetricLosses, then of clutched.FinalDrive, then g_F. */
typedef struct {
    double drag_w, drag_s, pinion_w, carrier_w, carrier_s, mesh_F, mesh_1, mesh_2;
    double pinion_F, pinion_T, pinion_L, carrier_1, carrier_2, carrier_F, carrier_L;
    double P_w, P_s, Q_0, Q_1, Q_2, W_1, W_2;
    double g_F;
} symmetric_losses;

/* The laws differ by their books alone. */
extern const law dm_clutched, dm_clutched_symmetric;

/* Put what is held in a step, under torques and friction, into u. */
void dm_clutched_held(const clutched_coefficients *, const double *T, const double *S, double *u);

/* Products of a_w, which is w, and others: at an instant, or their integrals over a part. */
typedef struct {
    double a_w, X_ww, X_ws, X_ss, F_1_w, F_1_s, F_2_w, F_2_s, M_1_w, M_1_s, M_2_w, M_2_s;
} products;

/* Put what the elements lose, of which there are products, into lost: W, or J. */
void dm_clutched_lost(const step *job, const products *, double *lost);
void dm_clutched_symmetric_lost(const step *job, const products *, double *lost);

void dm_clutched_book(step *job, const part *path, double *lost, double *taken);
void dm_clutched_symmetric_book(step *job, const part *path, double *lost, double *taken);

#endif
