/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Many differentials at once, for dm_ros/ensemble.py: their models, states and known patterns lie
 * one after the other in memory that Python owns, and are stepped with the interpreter free.
 */

#include "../python.h"

#include <string.h>

#include "member.h"
#include "wide.h"

/* The buffers of a call; each that was taken is given back. */
enum { MODELS, MEMBERS, TORQUES, FORCES, OUT, BUFFERS };

typedef struct {
    Py_buffer view[BUFFERS];
    int taken[BUFFERS];
} buffers;

static void give_back(buffers *b)
{
    for (int n = 0; n < BUFFERS; n++)
        if (b->taken[n])
            PyBuffer_Release(&b->view[n]);
}

/* Take a buffer of at least so many bytes; return 0 and set an error if it is none. */
static int take(buffers *b, int which, PyObject *object, int flags, Py_ssize_t least)
{
    if (PyObject_GetBuffer(object, &b->view[which], flags) < 0)
        return 0;
    b->taken[which] = 1;
    if (b->view[which].len < least) {
        PyErr_Format(PyExc_ValueError, "buffer %d has %zd bytes, of %zd", which,
                     b->view[which].len, least);
        return 0;
    }
    return 1;
}

patterns *dm_known_of(member *one)
{
    one->known.room = ROOM;
    one->known.kept = one->kept;
    return &one->known;
}

/* Return what advances so many members at once on this machine, NULL where nothing does. */
static stepper *stepper_of(Py_ssize_t lanes)
{
#ifdef HAS_X86_LANES
    if (lanes == 8 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")
        && __builtin_cpu_supports("avx512vl"))
        return dm_step_8;
    if (lanes == 4 && __builtin_cpu_supports("avx2"))
        return dm_step_4;
#endif
#ifdef HAS_LANES
    if (lanes == 2)
        return dm_step_2;
#endif
    return NULL;
}

static const char DOC_MAKE[] =
    "make_all(setup, parameters, models, first, last)\n--\n\n"
    "Make some models of the rows of parameters, doubles in the order of their table.\n\n"
    ":param setup: bytes of the doubles of struct setup, for all.\n"
    ":return: the first row of which no model can be made, or last.";

static PyObject *make_all(PyObject *module, PyObject *args)
{
    PyObject *parameters, *models;
    const char *bytes;
    Py_ssize_t size, first, last;
    setup run;
    buffers b = {0};
    (void)module;
    if (!PyArg_ParseTuple(args, "y#OOnn", &bytes, &size, &parameters, &models, &first, &last)
        || !dm_copied("setup", bytes, size, &run, sizeof run))
        return NULL;
    const Py_ssize_t columns = run.is_symmetric != 0.0 ? SYMMETRIC : SELF_LOCKING;
    if (take(&b, TORQUES, parameters, PyBUF_SIMPLE,
             last * columns * (Py_ssize_t)sizeof(double))
        && take(&b, MODELS, models, PyBUF_WRITABLE, last * (Py_ssize_t)sizeof(model))) {
        const double *rows = b.view[TORQUES].buf;
        model *m = b.view[MODELS].buf;
        Py_BEGIN_ALLOW_THREADS
        while (first < last && !dm_make(&m[first], &run, &rows[first * columns]))
            first++;
        Py_END_ALLOW_THREADS
    }
    give_back(&b);
    return PyErr_Occurred() ? NULL : PyLong_FromSsize_t(first);
}

static const char DOC_RESET[] =
    "reset_all(models, members, velocity, first, last)\n--\n\n"
    "Put some members back to the start, with the speeds velocity (n, 2) of the outputs, rad/s.";

static PyObject *reset_all(PyObject *module, PyObject *args)
{
    PyObject *models, *members, *velocity;
    Py_ssize_t first, last;
    buffers b = {0};
    (void)module;
    if (!PyArg_ParseTuple(args, "OOOnn", &models, &members, &velocity, &first, &last))
        return NULL;
    if (take(&b, MODELS, models, PyBUF_SIMPLE, last * (Py_ssize_t)sizeof(model))
        && take(&b, MEMBERS, members, PyBUF_WRITABLE, last * (Py_ssize_t)sizeof(member))
        && take(&b, OUT, velocity, PyBUF_SIMPLE, last * 2 * (Py_ssize_t)sizeof(double))) {
        const model *m = b.view[MODELS].buf;
        member *all = b.view[MEMBERS].buf;
        const double *omega = b.view[OUT].buf;
        for (Py_ssize_t n = first; n < last; n++) {
            dm_reset(&m[n], &all[n].now, &omega[2 * n]);
            all[n].failed = 0;
        }
    }
    give_back(&b);
    if (PyErr_Occurred())
        return NULL;
    Py_RETURN_NONE;
}

/* Put what a member reports into a row. */
static void put(const member *one, const report *told, double *row)
{
    memcpy(row, told, sizeof *told);
    row += SHAFTS + SHAFTS + MOMENTS;
    *row++ = one->now.flow;
    *row++ = one->now.force[0];
    *row++ = one->now.force[1];
    *row++ = one->now.coarse_steps;
    *row++ = one->failed;
}

void dm_member_tick(const task *of, ptrdiff_t n, ptrdiff_t t)
{
    member *one = &of->members[n];
    const ptrdiff_t place = t * of->of_tick + n * of->of_member;
    report told = {{0.0}, {0.0}, {0.0}};
    if (!one->failed)
        one->failed = dm_tick(&of->models[n], &one->now, dm_known_of(one),
                              of->torques + PORTS * place,
                              of->forces ? of->forces + CLUTCHES * place : NULL, NULL,
                              of->rows ? &told : NULL) != 0;
    if (of->rows)
        put(one, &told, &of->rows[(t * of->count + n) * COLUMNS]);
}

static const char DOC_STEP[] =
    "step_all(models, members, torques, forces, out, ticks, of_tick, of_member, first, last,"
    " lanes)\n--\n\n"
    "Advance some members by some ticks, without the interpreter.\n\n"
    "Torques are doubles, N m, those of a tick and a member begin at tick of_tick + member\n"
    "of_member; forces, N, likewise with 2/3 of that, or None. What is reported after each tick,\n"
    "as report_all has it, goes into out, (ticks, members, 20), or it is None. A member whose\n"
    "tick leads out of the range of numbers fails: it stays where it was. lanes, one of LANES,\n"
    "is how many are advanced at once where that can be; it changes no bit.";

/* Advance some members by a task, so many at once if they can be. */
static void step_members(const task *of, Py_ssize_t lanes, Py_ssize_t first, Py_ssize_t last)
{
    stepper *step = stepper_of(lanes);
    const setup *run = &of->models[first].run;
    const int is_rare = run->is_lagged != 0.0
        || (run->is_passive == 0.0 && run->is_symmetric != 0.0 && run->has_clutches != 0.0);
    if (step && !is_rare)
        for (; first + lanes <= last; first += lanes)
            step(of, first);
    for (; first < last; first++)
        for (Py_ssize_t t = 0; t < of->ticks; t++)
            dm_member_tick(of, first, t);
}

static PyObject *step_all(PyObject *module, PyObject *args)
{
    PyObject *models, *members, *torques, *forces, *out;
    Py_ssize_t ticks, of_tick, of_member, first, last, lanes;
    buffers b = {0};
    (void)module;
    if (!PyArg_ParseTuple(args, "OOOOOnnnnnn", &models, &members, &torques, &forces, &out,
                          &ticks, &of_tick, &of_member, &first, &last, &lanes))
        return NULL;
    const Py_ssize_t places = (ticks - 1) * of_tick + (last - 1) * of_member + 1;
    const Py_ssize_t size = (Py_ssize_t)sizeof(double);
    if (take(&b, MODELS, models, PyBUF_SIMPLE, last * (Py_ssize_t)sizeof(model))
        && take(&b, MEMBERS, members, PyBUF_WRITABLE, last * (Py_ssize_t)sizeof(member))
        && take(&b, TORQUES, torques, PyBUF_SIMPLE, places * PORTS * size)
        && (forces == Py_None
            || take(&b, FORCES, forces, PyBUF_SIMPLE, places * CLUTCHES * size))
        && (out == Py_None
            || take(&b, OUT, out, PyBUF_WRITABLE, ticks * COLUMNS * size
                    * (b.view[MEMBERS].len / (Py_ssize_t)sizeof(member))))) {
        const task of = {
            .models = b.view[MODELS].buf, .members = b.view[MEMBERS].buf,
            .torques = b.view[TORQUES].buf, .forces = b.taken[FORCES] ? b.view[FORCES].buf : NULL,
            .rows = b.taken[OUT] ? b.view[OUT].buf : NULL,
            .count = b.view[MEMBERS].len / (Py_ssize_t)sizeof(member), .ticks = ticks,
            .of_tick = of_tick, .of_member = of_member};
        Py_BEGIN_ALLOW_THREADS
        if (first < last)
            step_members(&of, lanes, first, last);
        Py_END_ALLOW_THREADS
    }
    give_back(&b);
    if (PyErr_Occurred())
        return NULL;
    Py_RETURN_NONE;
}

static const char DOC_REPORT[] =
    "report_all(models, members, out, first, last)\n--\n\n"
    "Put what some members report into out, doubles (n, 20): velocity (5), position (5), moment\n"
    "(5), power flow, clutch forces (2), coarse steps, whether it failed.";

static PyObject *report_all(PyObject *module, PyObject *args)
{
    PyObject *models, *members, *out;
    Py_ssize_t first, last;
    buffers b = {0};
    (void)module;
    if (!PyArg_ParseTuple(args, "OOOnn", &models, &members, &out, &first, &last))
        return NULL;
    if (take(&b, MODELS, models, PyBUF_SIMPLE, last * (Py_ssize_t)sizeof(model))
        && take(&b, MEMBERS, members, PyBUF_WRITABLE, last * (Py_ssize_t)sizeof(member))
        && take(&b, OUT, out, PyBUF_WRITABLE, last * COLUMNS * (Py_ssize_t)sizeof(double))) {
        const model *m = b.view[MODELS].buf;
        member *all = b.view[MEMBERS].buf;
        double *values = b.view[OUT].buf;
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t n = first; n < last; n++) {
            report told = {{0.0}, {0.0}, {0.0}};
            dm_report(&m[n], &all[n].now, dm_known_of(&all[n]), &told);
            put(&all[n], &told, &values[n * COLUMNS]);
        }
        Py_END_ALLOW_THREADS
    }
    give_back(&b);
    if (PyErr_Occurred())
        return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef functions[] = {
    {"make_all", make_all, METH_VARARGS, DOC_MAKE},
    {"reset_all", reset_all, METH_VARARGS, DOC_RESET},
    {"step_all", step_all, METH_VARARGS, DOC_STEP},
    {"report_all", report_all, METH_VARARGS, DOC_REPORT},
    {NULL, NULL, 0, NULL},
};

int dm_add_ensemble(PyObject *module)
{
    PyObject *lanes = PyList_New(0);
    for (Py_ssize_t n = 1; lanes && n <= 8; n *= 2) {
        PyObject *number = n == 1 || stepper_of(n) ? PyLong_FromSsize_t(n) : NULL;
        if (number)
            PyList_Append(lanes, number);
        Py_XDECREF(number);
    }
    return PyModule_AddObject(module, "LANES", lanes)
        || PyModule_AddFunctions(module, functions)
        || PyModule_AddIntConstant(module, "MODEL", sizeof(model))
        || PyModule_AddIntConstant(module, "MEMBER", sizeof(member)) ? -1 : 0;
}
