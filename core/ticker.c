/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The type dm_ros._core.Ticker: a differential in motion, as Ticker of dm_ros/motion/ticker.py.
 */

#include "python.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "differential.h"

enum { ROOM = 16 };   /* patterns of signs that are kept */

typedef struct {
    PyObject_HEAD
    model m;
    state now;
    books kept;
    int is_audited;
    patterns known;
} Ticker;

static PyTypeObject *type;   /* lives as long as the module does */

static PyObject *refuse_range(void)
{
    PyErr_SetString(PyExc_ArithmeticError, "beyond the range of floating point numbers");
    return NULL;
}

static PyObject *create(PyTypeObject *kind, PyObject *args, PyObject *names)
{
    const char *bytes;
    Py_ssize_t size;
    int is_audited;
    (void)names;
    if (!PyArg_ParseTuple(args, "y#p", &bytes, &size, &is_audited))
        return NULL;
    const allocfunc allocate = (allocfunc)PyType_GetSlot(kind, Py_tp_alloc);
    Ticker *self = (Ticker *)allocate(kind, 0);
    if (!self)
        return NULL;
    self->is_audited = is_audited;
    self->known = (patterns){.room = ROOM, .kept = calloc(ROOM, sizeof(pattern))};
    if (!self->known.kept || !dm_copied("model", bytes, size, &self->m, sizeof self->m)) {
        if (!self->known.kept)
            PyErr_NoMemory();
        Py_DECREF((PyObject *)self);
        return NULL;
    }
    return (PyObject *)self;
}

static void destroy(PyObject *object)
{
    PyTypeObject *kind = Py_TYPE(object);
    free(((Ticker *)object)->known.kept);
    ((freefunc)PyType_GetSlot(kind, Py_tp_free))(object);
    Py_DECREF((PyObject *)kind);
}

/* Put numbers into values where they are just as many finite ones; return 0 where not. */
static int plain(PyObject *numbers, int count, double least, double *values)
{
    PyObject *tuple = NULL;
    int is_plain = 0;
    if (PyTuple_Check(numbers)) {
        Py_INCREF(numbers);
        tuple = numbers;
    } else if (PySequence_Check(numbers)) {
        tuple = PySequence_Tuple(numbers);
    }
    if (tuple && PyTuple_Size(tuple) == count) {
        is_plain = 1;
        for (int n = 0; n < count && is_plain; n++) {
            values[n] = PyFloat_AsDouble(PyTuple_GetItem(tuple, n));
            is_plain = isfinite(values[n]) && values[n] >= least && !PyErr_Occurred();
        }
    }
    Py_XDECREF(tuple);
    PyErr_Clear();
    return is_plain;
}

/* As plain, for the forces on the clutches, if there are any. */
static int plain_forces(const Ticker *self, PyObject *forces, double *values)
{
    if (self->m.run.has_clutches != 0.0)
        return plain(forces, CLUTCHES, 0.0, values);
    return PyTuple_Check(forces)
        && (PyTuple_Size(forces) == 0
            || (plain(forces, CLUTCHES, 0.0, values) && values[0] == 0.0 && values[1] == 0.0));
}

static PyObject *told(const Ticker *self, const report *r)
{
    const model *m = &self->m;
    const int forces = m->run.has_clutches != 0.0 ? CLUTCHES : 0;
    return Py_BuildValue(
        "dNNNNiN", self->now.ticks * m->run.dt, dm_tuple(dm_shafts(m), r->velocity),
        dm_tuple(dm_shafts(m), r->position), dm_tuple(PORTS, self->now.torque),
        dm_tuple(dm_moments(m), r->moment), (int)self->now.flow,
        dm_tuple(forces, self->now.force));
}

static PyObject *quick(PyObject *object, PyObject *args)
{
    Ticker *self = (Ticker *)object;
    double T[PORTS], forces[CLUTCHES];
    report r;
    PyObject *given, *commands, *is_told;
    if (!PyArg_UnpackTuple(args, "quick", 3, 3, &given, &commands, &is_told))
        return NULL;
    if (!plain(given, PORTS, -INFINITY, T) || !plain_forces(self, commands, forces))
        Py_RETURN_NONE;
    if (dm_tick(&self->m, &self->now, &self->known, T, forces,
                self->is_audited ? &self->kept : NULL, is_told == Py_True ? &r : NULL))
        return refuse_range();
    return is_told == Py_True ? told(self, &r) : PyTuple_New(0);
}

static PyObject *tick(PyObject *object, PyObject *args)
{
    Ticker *self = (Ticker *)object;
    double T[PORTS], forces[CLUTCHES];
    PyObject *given, *commands;
    if (!PyArg_UnpackTuple(args, "tick", 2, 2, &given, &commands))
        return NULL;
    if (!plain(given, PORTS, -INFINITY, T) || !plain_forces(self, commands, forces)) {
        PyErr_SetString(PyExc_TypeError,
                        "torques and forces must be finite numbers, one for each");
        return NULL;
    }
    if (dm_tick(&self->m, &self->now, &self->known, T, forces,
                self->is_audited ? &self->kept : NULL, NULL))
        return refuse_range();
    Py_RETURN_NONE;
}

static PyObject *reported(PyObject *object, PyObject *unused)
{
    Ticker *self = (Ticker *)object;
    report r;
    (void)unused;
    if (dm_report(&self->m, &self->now, &self->known, &r))
        return refuse_range();
    return told(self, &r);
}

static PyObject *reset(PyObject *object, PyObject *velocity)
{
    Ticker *self = (Ticker *)object;
    double omega[2];
    if (!dm_numbers(velocity, "velocity", 2, omega))
        return NULL;
    dm_reset(&self->m, &self->now, omega);
    dm_begin_books(&self->m, &self->now, &self->kept);
    Py_RETURN_NONE;
}

static PyObject *follow(PyObject *object, PyObject *other)
{
    Ticker *self = (Ticker *)object;
    if (!PyObject_TypeCheck(other, type)) {
        PyErr_SetString(PyExc_TypeError, "a ticker follows a ticker");
        return NULL;
    }
    const Ticker *before = (const Ticker *)other;
    self->now = before->now;
    self->kept = before->kept;
    self->m.run.deadband = before->m.run.deadband;
    dm_adopt(&before->m, &self->m, &self->now);
    dm_note_change(&self->m, &self->now, &self->kept);
    Py_RETURN_NONE;
}

static PyObject *get_state(PyObject *object, void *unused)
{
    const Ticker *self = (Ticker *)object;
    const model *m = &self->m;
    const state *now = &self->now;
    (void)unused;
    return Py_BuildValue(
        "NNNNiNNN", dm_tuple(2, now->x), dm_tuple(2, now->turned),
        dm_tuple(dm_shafts(m), now->origin), dm_tuple(PORTS, now->torque), (int)now->flow,
        dm_tuple(m->run.is_lagged != 0.0 ? CLUTCHES : 0, now->memory),
        dm_tuple(m->run.has_clutches != 0.0 ? CLUTCHES : 0, now->force),
        dm_tuple(PORTS, now->held));
}

static int set_state(PyObject *object, PyObject *value, void *unused)
{
    Ticker *self = (Ticker *)object;
    const model *m = &self->m;
    state next = {.ticks = self->now.ticks, .coarse_steps = self->now.coarse_steps,
                  .seen = {NAN}};
    PyObject *x, *turned, *origin, *torque, *memory, *force, *held;
    int flow;
    (void)unused;
    if (!value || !PyArg_ParseTuple(value, "OOOOiOOO", &x, &turned, &origin, &torque, &flow,
                                    &memory, &force, &held)) {
        if (!value)
            PyErr_SetString(PyExc_AttributeError, "a ticker has a state");
        return -1;
    }
    if (!dm_numbers(x, "x", 2, next.x) || !dm_numbers(turned, "turned", 2, next.turned)
        || !dm_numbers(origin, "origin", dm_shafts(m), next.origin)
        || !dm_numbers(torque, "torque", PORTS, next.torque)
        || !dm_numbers(memory, "memory", m->run.is_lagged != 0.0 ? CLUTCHES : 0, next.memory)
        || !dm_numbers(force, "force", m->run.has_clutches != 0.0 ? CLUTCHES : 0, next.force)
        || !dm_numbers(held, "held", PORTS, next.held))
        return -1;
    next.flow = flow;
    self->now = next;
    dm_note_change(m, &self->now, &self->kept);
    return 0;
}

static PyObject *get_count(PyObject *object, void *place)
{
    return PyLong_FromDouble(*(double *)((char *)object + (size_t)place));
}

static PyObject *get_number(PyObject *object, void *place)
{
    return PyFloat_FromDouble(*(double *)((char *)object + (size_t)place));
}

static int set_number(PyObject *object, PyObject *value, void *place)
{
    const double number = value ? PyFloat_AsDouble(value) : -1.0;
    if (!value)
        PyErr_SetString(PyExc_AttributeError, "a ticker has this");
    if (PyErr_Occurred())
        return -1;
    *(double *)((char *)object + (size_t)place) = number;
    return 0;
}

static PyObject *energy(PyObject *object, PyObject *unused)
{
    const Ticker *self = (Ticker *)object;
    (void)unused;
    return Py_BuildValue("Nd", dm_tuple(dm_entries(&self->m), self->kept.tick),
                         self->kept.stored);
}

static PyObject *booked(PyObject *object, PyObject *unused)
{
    const Ticker *self = (Ticker *)object;
    const model *m = &self->m;
    const books *b = &self->kept;
    const int entries = dm_entries(m), returning = dm_gears(m) + dm_bearings(m);
    PyObject *ticks = PyTuple_New(returning);
    (void)unused;
    for (int n = 0; ticks && n < returning; n++)
        PyTuple_SetItem(ticks, n, PyLong_FromDouble(b->returned_ticks[n]));
    return Py_BuildValue("NNdddNN", dm_tuple(entries, b->tick), dm_tuple(entries, b->total),
                         b->stored, b->changes, b->worst, ticks, dm_tuple(returning, b->returned));
}

static PyMethodDef methods[] = {
    {"quick", quick, METH_VARARGS,
     "quick(torques, forces, is_told)\n--\n\nAdvance one tick and return what is reported of it, "
     "or (); return None, and do nothing,\nwhere these are not plain finite numbers."},
    {"tick", tick, METH_VARARGS, "tick(T, commands)\n--\n\nAdvance one tick."},
    {"report", reported, METH_NOARGS, "report()\n--\n\nReturn what a Snapshot holds."},
    {"reset", reset, METH_O, "reset(velocity)\n--\n\nGo back to the start."},
    {"follow", follow, METH_O, "follow(other)\n--\n\nGo on where another ticker is."},
    {"energy", energy, METH_NOARGS, "energy()\n--\n\nReturn the books of the last tick and the "
     "stored energy, J."},
    {"booked", booked, METH_NOARGS, "booked()\n--\n\nReturn what is Booked."},
    {NULL, NULL, 0, NULL},
};

static PyGetSetDef members[] = {
    {"state", get_state, set_state, "The State, as a tuple.", NULL},
    {"ticks", get_count, NULL, "Ticks since the start.", (void *)offsetof(Ticker, now.ticks)},
    {"coarse_steps", get_count, NULL, "Coarse solver steps since the start.",
     (void *)offsetof(Ticker, now.coarse_steps)},
    {"deadband", get_number, set_number, "Of the power-flow index, W.",
     (void *)offsetof(Ticker, m.run.deadband)},
    {"worst", get_number, set_number, "The largest residual of a tick over its scale.",
     (void *)offsetof(Ticker, kept.worst)},
    {NULL, NULL, NULL, NULL, NULL},
};

static PyType_Slot slots[] = {
    {Py_tp_doc, "Ticker(model, audited)\n--\n\nA differential in motion, see motion/ticker.py."},
    {Py_tp_new, create},
    {Py_tp_dealloc, destroy},
    {Py_tp_methods, methods},
    {Py_tp_getset, members},
    {0, NULL},
};

static PyType_Spec specification = {
    "dm_ros._core.Ticker", sizeof(Ticker), 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, slots,
};

int dm_add_ticker(PyObject *module)
{
    type = (PyTypeObject *)PyType_FromSpec(&specification);
    if (!type)
        return -1;
    Py_INCREF((PyObject *)type);
    return PyModule_AddObject(module, "Ticker", (PyObject *)type);
}
