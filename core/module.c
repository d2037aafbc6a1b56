/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The module dm_ros._core: the core for Python, by its stable ABI.
 */

#define Py_LIMITED_API 0x030b0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <string.h>

#include "clutched.h"
#include "passive.h"
#include "quadrature.h"

/* Put the numbers of a tuple where they belong; return 0 and set an error if they are none. */
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

/* Copy bytes into a struct, whose alignment they may not have; return 0 and set an error if not. */
static int copied(const char *what, const char *bytes, Py_ssize_t size, void *into,
                  size_t expected)
{
    if ((size_t)size != expected) {
        PyErr_Format(PyExc_TypeError, "%s must be %zd bytes, not %zd", what,
                     (Py_ssize_t)expected, size);
        return 0;
    }
    memcpy(into, bytes, expected);
    return 1;
}

/* Advance from y; put the path's books into books; return whether that could be done. */
static int advanced(step *job, PyObject *y, int count, PyObject **books)
{
    double start[2];
    if (!numbers(y, "y", 2, start))
        return 0;
    /* the interpreter stays held: to get it back from another thread may take longer than this */
    if (dm_advance(job, (pair){start[0], start[1]})) {
        PyErr_SetString(PyExc_ArithmeticError, "no speed in reach fits");
        return 0;
    }
    *books = Py_BuildValue("Nd", tuple_of(count, job->lost), job->numerical);
    return *books != NULL;
}

static const char DOC_PASSIVE[] =
    "passive_step(coefficients, u, y, h, tolerance, form)\n--\n\n"
    "Return what adaptive.step does under the passive law, and the books of its path.\n\n"
    ":param coefficients: bytes of the doubles of passive.Coefficients; u: of passive.held.\n"
    ":param form: of the kinetic energy.\n"
    ":return: ``(y, integral, point, coarse, (lost, numerical))``.\n"
    ":raises ArithmeticError: where no speed in reach fits.";

static PyObject *passive_step(PyObject *module, PyObject *args)
{
    coefficients k;
    step job = {.law = &dm_passive, .coefficients = &k, .has_books = 1};
    const char *bytes;
    Py_ssize_t size;
    PyObject *u, *y, *form, *books;
    (void)module;
    if (!PyArg_ParseTuple(args, "y#OOddO", &bytes, &size, &u, &y, &job.h, &job.tolerance, &form)
        || !copied("coefficients", bytes, size, &k, sizeof k) || !numbers(u, "u", 5, job.u)
        || !numbers(form, "form", 3, job.form) || !advanced(&job, y, LOST, &books))
        return NULL;
    const point *at = &job.at_end;
    const double sign[] = {at->sign.s_1, at->sign.s_2, at->sign.s_F, at->sign.h_N, at->sign.b};
    return Py_BuildValue(
        "(dd)(dd)(dddddddNNN)NN", job.end.w, job.end.s, job.integral.w, job.integral.s,
        at->e_0, at->e_s, at->F_1, at->F_2, at->M_1, at->M_2, at->M_F, tuple_of(5, sign),
        tuple_of(STATE, at->state), tuple_of(SOLVED, at->solved), PyBool_FromLong(job.coarse),
        books);
}

static const char DOC_PAPER[] =
    "paper_step(coefficients, losses, u, T, y, h, tolerance, form)\n--\n\n"
    "Return what adaptive.step does under the paper's law, and the books of its path.\n\n"
    ":param coefficients: bytes of the doubles of clutched.Coefficients; u: of clutched.held.\n"
    ":param losses: bytes of the doubles of losses.SelfLockingLosses, or of SymmetricLosses,\n"
    "    FinalDrive and g_F; T: torques on the ports, N m; form: of the kinetic energy.\n"
    ":return: ``(y, integral, point, coarse, (lost, numerical))``.\n"
    ":raises ArithmeticError: where no speed in reach fits.";

static PyObject *paper_step(PyObject *module, PyObject *args)
{
    clutched_coefficients k;
    union {
        self_locking_losses self_locking;
        symmetric_losses symmetric;
    } lost;
    step job = {.coefficients = &k, .losses = &lost, .has_books = 1};
    const char *bytes, *bytes_of_losses;
    Py_ssize_t size, size_of_losses;
    PyObject *u, *T, *y, *form, *books;
    (void)module;
    if (!PyArg_ParseTuple(args, "y#y#OOOddO", &bytes, &size, &bytes_of_losses, &size_of_losses, &u,
                          &T, &y, &job.h, &job.tolerance, &form))
        return NULL;
    const int is_symmetric = size_of_losses != sizeof lost.self_locking;
    const size_t expected = is_symmetric ? sizeof lost.symmetric : sizeof lost.self_locking;
    job.law = is_symmetric ? &dm_clutched_symmetric : &dm_clutched;
    if (!copied("coefficients", bytes, size, &k, sizeof k)
        || !copied("losses", bytes_of_losses, size_of_losses, &lost, expected)
        || !numbers(u, "u", 6, job.u) || !numbers(T, "T", 3, job.T)
        || !numbers(form, "form", 3, job.form)
        || !advanced(&job, y, is_symmetric ? 8 : 6, &books))
        return NULL;
    const point *at = &job.at_end;
    return Py_BuildValue(
        "(dd)(dd)(dddddddddd)NN", job.end.w, job.end.s, job.integral.w, job.integral.s,
        at->e_0, at->e_s, at->F_1, at->F_2, at->M_1, at->M_2, at->state[0], at->state[1],
        at->state[2], at->state[3], PyBool_FromLong(job.coarse), books);
}

static PyMethodDef functions[] = {
    {"passive_step", passive_step, METH_VARARGS, DOC_PASSIVE},
    {"paper_step", paper_step, METH_VARARGS, DOC_PAPER},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_core", "The adaptive steps in C.", 0, functions, NULL, NULL, NULL,
    NULL,
};

PyMODINIT_FUNC PyInit__core(void)
{
    dm_prepare_rules();
    return PyModule_Create(&definition);
}
