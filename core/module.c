/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The module dm_ros._core: the core for Python, by its stable ABI.
 */

#define Py_LIMITED_API 0x030b0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <string.h>

#include "books.h"

/* Put the numbers of a tuple into a struct of doubles; return 0 and set an error if they differ. */
static int numbers(PyObject *tuple, const char *what, int count, double *into)
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

static PyObject *tuple_of(int count, const double *values)
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

static const char DOC_STEP[] =
    "passive_step(coefficients, u, y, h, tolerance, form)\n--\n\n"
    "Return what adaptive.step does under the passive law, and the books of its path.\n\n"
    ":param coefficients: bytes of the doubles of passive.Coefficients; u: of passive.held.\n"
    ":param form: of the kinetic energy, or None for no books.\n"
    ":return: ``(y, integral, point, coarse, books)``, books ``(lost, numerical)`` or None.\n"
    ":raises ArithmeticError: where no speed in reach fits.";

static PyObject *passive_step(PyObject *module, PyObject *args)
{
    const char *bytes;
    Py_ssize_t size;
    PyObject *u, *y, *form;
    coefficients k;
    step job;
    pair start;
    (void)module;
    memset(&job, 0, sizeof job);
    if (!PyArg_ParseTuple(args, "y#OOddO", &bytes, &size, &u, &y, &job.h, &job.tolerance, &form))
        return NULL;
    if (size != sizeof k) {
        PyErr_Format(PyExc_TypeError, "coefficients must be %zd bytes", (Py_ssize_t)sizeof k);
        return NULL;
    }
    memcpy(&k, bytes, sizeof k);
    job.k = &k;
    job.has_books = form != Py_None;
    if (!numbers(u, "u", 5, &job.u.T_in) || !numbers(y, "y", 2, &start.w)
        || (job.has_books && !numbers(form, "form", 3, job.form)))
        return NULL;
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = dm_advance(&job, start);
    Py_END_ALLOW_THREADS
    if (failed) {
        PyErr_SetString(PyExc_ArithmeticError, "no speed in reach fits");
        return NULL;
    }
    const point *at = &job.at_end;
    PyObject *books = job.has_books
        ? Py_BuildValue("Nd", tuple_of(LOST, job.lost), job.numerical)
        : Py_NewRef(Py_None);
    return Py_BuildValue(
        "(dd)(dd)(dddddddNNN)NN", job.end.w, job.end.s, job.integral.w, job.integral.s,
        at->e_0, at->e_s, at->F_1, at->F_2, at->M_1, at->M_2, at->M_F, tuple_of(5, &at->sign.s_1),
        tuple_of(STATE, at->state), tuple_of(SOLVED, at->solved), PyBool_FromLong(job.coarse),
        books);
}

static PyMethodDef functions[] = {
    {"passive_step", passive_step, METH_VARARGS, DOC_STEP},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_core", "The ticks in C.", 0, functions, NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__core(void)
{
    dm_prepare_rules();
    return PyModule_Create(&definition);
}
