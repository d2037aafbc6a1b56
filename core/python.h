/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What the parts of the module dm_ros._core share, by the stable ABI of Python.
 */

#ifndef DM_ROS_PYTHON_H
#define DM_ROS_PYTHON_H

#define Py_LIMITED_API 0x030b0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

/* Put the numbers of a tuple where they belong; return 0 and set an error if they are none. */
int dm_numbers(PyObject *tuple, const char *what, int count, double *into);

PyObject *dm_tuple(int count, const double *values);

/* Copy bytes into a struct, whose alignment they may not have; return 0 with an error if not. */
int dm_copied(const char *what, const char *bytes, Py_ssize_t size, void *into, size_t expected);

/* Add the type Ticker, and the functions for many; return 0, or -1 with an error. */
int dm_add_ticker(PyObject *module);
int dm_add_ensemble(PyObject *module);
int dm_add_coupled_step(PyObject *module);
int dm_add_points(PyObject *module);

#endif
