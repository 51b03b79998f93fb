"""Arrays of alembic3d from lists, for the scripts that make archives beside this one."""

import imath


def filled(array, values):
    for i, value in enumerate(values):
        array[i] = value
    return array


def points(values):
    return filled(imath.V3fArray(len(values)), [imath.V3f(*value) for value in values])


def pairs(values):
    return filled(imath.V2fArray(len(values)), [imath.V2f(*value) for value in values])


def colors(values):
    return filled(imath.C3fArray(len(values)), [imath.Color3f(*value) for value in values])


def floats(values):
    return filled(imath.FloatArray(len(values)), values)


def integers(values):
    return filled(imath.IntArray(len(values)), values)


def indices(values):
    return filled(imath.UnsignedIntArray(len(values)), values)
