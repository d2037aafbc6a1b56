# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Integrals along the path of a step, which is a sum of exponentials."""

import math

from dm_ros.motion.exponentials import phi_matrices, way


def lobatto(pieces):
    """
    Return Lobatto's rule of five points on [0, 1] in pieces, each as long as all before it.

    It is exact to degree 7 in each piece.

    :return: ``(r, r^2, r^3, weight)`` of each node r in (0, 1), 1/2 first; the weights at 0 and 1.
    """
    inner = math.sqrt(3 / 7) / 2
    rule = ((0.0, 1 / 20), (0.5 - inner, 49 / 180), (0.5, 16 / 45), (0.5 + inner, 49 / 180),
            (1.0, 1 / 20))
    edges = [0.0] + [2.0**(n + 1 - pieces) for n in range(pieces)]
    weights = {0.5: 0.0}
    for begin, end in zip(edges, edges[1:]):
        for node, weight in rule:
            at = begin + (end - begin) * node
            weights[at] = weights.get(at, 0.0) + (end - begin) * weight
    first, last = weights.pop(0.0), weights.pop(1.0)
    return tuple((r, r * r, r * r * r, weight) for r, weight in weights.items()), first, last


# by the number of pieces
RULES = (None, *(lobatto(pieces) for pieces in range(1, 41)))
STIFF = 1.5   # time constants of a path that the first piece may take
FINE = 0.4    # the same where a path leads far


def rule_for(J, h, far=True):
    """
    Return the rule of ``lobatto`` that follows a path with the Jacobian J over h, s.

    :param far: whether the speeds change on the path by more than a small part of them.
    """
    stiff, most = h * (abs(J[0]) + abs(J[3])), FINE if far else STIFF
    pieces = 1
    while stiff > most and pieces < len(RULES) - 1:
        stiff /= 2.0
        pieces += 1
    return RULES[pieces]


def second_moment_of_the_way(A, h):
    """
    Return what gives the integral of q q' from d d', both as (11, 12, 22), nine numbers by rows.

    q is the way from the start of a step of x' = A x + b over h, and d the whole of it.

    :param A: (11, 12, 21, 22).
    """
    inner, _, end = rule_for(A, h)
    (a, b, c, d), _ = phi_matrices([h * x for x in A])
    det = h * (a * d - b * c)   # the slope at the start is this matrix, inverted, times d
    ways = [way(A, slope, h, inner) for slope in ((d / det, -c / det), (-b / det, a / det))]
    total = [end, 0.0, 0.0, 0.0, end, 0.0, 0.0, 0.0, end]
    for (*_, weight), (p_1, p_2), (q_1, q_2) in zip(inner, *ways):
        for n, x in enumerate((p_1 * p_1, 2 * p_1 * q_1, q_1 * q_1,
                               p_1 * p_2, p_1 * q_2 + q_1 * p_2, q_1 * q_2,
                               p_2 * p_2, 2 * p_2 * q_2, q_2 * q_2)):
            total[n] += weight * x
    return tuple([h * x for x in total])
