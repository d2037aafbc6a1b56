/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The function dm_ros._core.coupled_step, for CoupledModel of dm_ros/motion/coupled_model.py.
 */

#include "python.h"

#include "coupled.h"

static const char DOC[] =
    "coupled_step(model, x, S, inputs, flow, has_books)\n--\n\n"
    "Advance by a step, see CoupledModel.step. The path is None; where the books are kept, what\n"
    "the elements lost, what each half-shaft lost, and what the error of the step took, J.";

/* Put what comes in on the ports into inputs, None as 0, and whether it is held into held. */
static int take_inputs(PyObject *tuple, double *inputs, int *held)
{
    if (!PyTuple_Check(tuple) || PyTuple_Size(tuple) != PORTS) {
        PyErr_Format(PyExc_TypeError, "inputs must be a tuple of %d numbers or None", PORTS);
        return 0;
    }
    for (int n = 0; n < PORTS; n++) {
        PyObject *value = PyTuple_GetItem(tuple, n);
        held[n] = value != Py_None;
        inputs[n] = held[n] ? PyFloat_AsDouble(value) : 0.0;
        if (inputs[n] == -1.0 && PyErr_Occurred())
            return 0;
    }
    return 1;
}

/* Return what of the last point the model reads. */
static PyObject *told_point(const coupling *of, const point *at)
{
    const double *t = at->state;
    if (of->is_passive != 0.0)
        return dm_tuple(7, (double[]){at->e_0, at->e_s, at->F_1, at->F_2, at->M_1, at->M_2,
                                      at->M_F});
    return dm_tuple(10, (double[]){at->e_0, at->e_s, at->F_1, at->F_2, at->M_1, at->M_2, t[0],
                                   t[1], t[2], t[3]});
}

static PyObject *told_books(const coupling *of, const double *lost, const double *damped,
                            double numerical)
{
    /* the passive law knows all elements of both mechanisms, the paper's those there are */
    static const int self_locking[] = {0, 2, 3, 5, 6, 7};
    const int picks = of->is_passive != 0.0 && of->is_symmetric == 0.0;
    double own[LOST];
    for (int n = 0; n < (int)of->elements; n++)
        own[n] = lost[picks ? self_locking[n] : n];
    return Py_BuildValue("NNd", dm_tuple((int)of->elements, own),
                         dm_tuple((int)of->count, damped), numerical);
}

static PyObject *coupled(PyObject *module, PyObject *args)
{
    const char *bytes;
    Py_ssize_t size;
    PyObject *given_x, *given_S, *given_inputs;
    int flow, has_books, held[PORTS];
    coupling of;
    coupled_step c;
    double x[ROWS], S[CLUTCHES], inputs[PORTS];
    (void)module;
    if (!PyArg_ParseTuple(args, "y#OOOip", &bytes, &size, &given_x, &given_S, &given_inputs, &flow,
                          &has_books)
        || !dm_copied("model", bytes, size, &of, sizeof of)
        || !dm_numbers(given_x, "x", 2 + (int)of.count, x)
        || !dm_numbers(given_S, "S", CLUTCHES, S) || !take_inputs(given_inputs, inputs, held))
        return NULL;
    dm_prepare_coupled(&c, &of, inputs, held, S, flow);
    c.has_books = has_books;
    if (dm_advance_coupled(&c, x)) {
        PyErr_SetString(PyExc_ArithmeticError, "beyond the range of floating point numbers");
        return NULL;
    }
    const int count = 2 + (int)of.count;
    const double *z = c.at_end->z;
    double end[ROWS] = {z[0], z[1]}, turned[ROWS] = {c.integral[0], c.integral[1]};
    double damped[PORTS] = {0.0};
    for (int n = 0, held_one = 0; n < (int)of.count; n++) {
        if (!held[(int)of.shafts[n].port]) {
            x[2 + n] = 0.0;
            continue;
        }
        end[2 + n] = z[2 + held_one] / c.scale[held_one];
        turned[2 + n] = c.integral[2 + held_one] / c.scale[held_one];
        damped[n] = c.lost[LOST + held_one++];
    }
    PyObject *path = has_books ? told_books(&of, c.lost, damped, c.numerical)
                               : Py_BuildValue("");
    return Py_BuildValue("NiNNNiN", dm_tuple(count, x), flow, dm_tuple(count, end),
                         dm_tuple(count, turned), told_point(&of, &c.at_end->at), c.coarse, path);
}

static PyMethodDef functions[] = {
    {"coupled_step", coupled, METH_VARARGS, DOC},
    {NULL, NULL, 0, NULL},
};

int dm_add_coupled_step(PyObject *module)
{
    return PyModule_AddFunctions(module, functions);
}
