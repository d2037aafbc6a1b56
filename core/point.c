/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The passive law at one state, for dm_ros/driveline/differential.py: what evaluate, jacobian,
 * torque_slopes and lost_powers of dm_ros/mechanism/passive.py return.
 */

#include "python.h"

#include "passive.h"

/* Take coefficients, what is held, w and s, and evaluate there; return 0 with an error if not. */
static int evaluated(PyObject *args, coefficients *k, step *job, point *at)
{
    const char *bytes;
    Py_ssize_t size;
    PyObject *held;
    double w, s;
    if (!PyArg_ParseTuple(args, "y#Odd", &bytes, &size, &held, &w, &s)
        || !dm_copied("coefficients", bytes, size, k, sizeof *k)
        || !dm_numbers(held, "held", S_TWO + 1, job->u))
        return 0;
    job->law = &dm_passive;
    job->coefficients = k;
    job->seen = NULL;
    job->broken = 0;
    job->law->evaluate(job, w, s, at);
    return 1;
}

/* Return a result, or an error where a number was divided by zero on the way. */
static PyObject *unless_broken(const step *job, PyObject *result)
{
    if (result && job->broken) {
        Py_DECREF(result);
        PyErr_SetString(PyExc_ZeroDivisionError, "division by zero");
        return NULL;
    }
    return result;
}

static PyObject *passive_point(PyObject *module, PyObject *args)
{
    coefficients k;
    step job;
    point at;
    (void)module;
    if (!evaluated(args, &k, &job, &at))
        return NULL;
    const signs *s = &at.sign;
    return unless_broken(&job, Py_BuildValue(
        "dddddddNNN", at.e_0, at.e_s, at.F_1, at.F_2, at.M_1, at.M_2, at.M_F,
        dm_tuple(5, (double[]){s->s_1, s->s_2, s->s_F, s->h_N, s->b}),
        dm_tuple(STATE, at.state), dm_tuple(SOLVED, at.solved)));
}

static PyObject *passive_slopes(PyObject *module, PyObject *args)
{
    coefficients k;
    step job;
    point at;
    double of_w[3], of_s[3];
    (void)module;
    if (!evaluated(args, &k, &job, &at))
        return NULL;
    const matrix J = job.law->jacobian(&job, &at).J;
    job.law->torque_slopes(&job, &at, of_w, of_s);
    return unless_broken(&job, Py_BuildValue("(dddd)NN", J.ww, J.ws, J.sw, J.ss,
                                             dm_tuple(3, of_w), dm_tuple(3, of_s)));
}

static PyObject *passive_lost(PyObject *module, PyObject *args)
{
    coefficients k;
    step job;
    point at;
    double lost[LOST];
    (void)module;
    if (!evaluated(args, &k, &job, &at))
        return NULL;
    dm_lost_powers(&job, &at, lost);
    return unless_broken(&job, dm_tuple(LOST, lost));
}

static PyMethodDef functions[] = {
    {"passive_point", passive_point, METH_VARARGS,
     "passive_point(k, u, w, s)\n--\n\nReturn what passive.evaluate does; k: bytes."},
    {"passive_slopes", passive_slopes, METH_VARARGS,
     "passive_slopes(k, u, w, s)\n--\n\nReturn the Jacobian there, and both torque_slopes."},
    {"passive_lost", passive_lost, METH_VARARGS,
     "passive_lost(k, u, w, s)\n--\n\nReturn what passive.lost_powers does there."},
    {NULL, NULL, 0, NULL},
};

int dm_add_points(PyObject *module)
{
    return PyModule_AddFunctions(module, functions);
}
