/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The module dm_ros._core: the core for Python.
 */

#include "python.h"

#include <string.h>

#include "quadrature.h"

int dm_numbers(PyObject *tuple, const char *what, int count, double *into)
{
    if (!PyTuple_Check(tuple) || PyTuple_Size(tuple) != count) {
        PyErr_Format(PyExc_TypeError, "%s must be a tuple of %d numbers", what, count);
        return 0;
    }
    for (int n = 0; n < count; n++) {
        into[n] = PyFloat_AsDouble(PyTuple_GetItem(tuple, n));
        if (into[n] == -1.0 && PyErr_Occurred())
            return 0;
    }
    return 1;
}

PyObject *dm_tuple(int count, const double *values)
{
    PyObject *tuple = PyTuple_New(count);
    for (int n = 0; tuple && n < count; n++) {
        PyObject *number = PyFloat_FromDouble(values[n]);
        if (!number || PyTuple_SetItem(tuple, n, number) < 0) {
            Py_DECREF(tuple);
            return NULL;
        }
    }
    return tuple;
}

int dm_copied(const char *what, const char *bytes, Py_ssize_t size, void *into, size_t expected)
{
    if ((size_t)size != expected) {
        PyErr_Format(PyExc_TypeError, "%s must be %zd bytes, not %zd", what,
                     (Py_ssize_t)expected, size);
        return 0;
    }
    memcpy(into, bytes, expected);
    return 1;
}

static PyMethodDef functions[] = {
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_core", "Differentials in C.", -1, functions, NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__core(void)
{
    dm_prepare_rules();
    PyObject *module = PyModule_Create(&definition);
    if (module && (dm_add_ticker(module) || dm_add_ensemble(module)
                   || dm_add_coupled_step(module) || dm_add_points(module))) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
