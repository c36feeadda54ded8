"""The compiled errors of rotations as functions with a result."""

import numpy as np

from tp_controller.tasks import rows


def rotation_error(R_des, R):
    """Rotation vector (3,) of the way from R to R_des."""
    error = np.zeros(3)
    rows.rotation_vector(R_des @ R.T, error)
    return error


def tilt_error(Q, axis, carried):
    """Rotation vector (3,) of the swing of a rotation error."""
    error = np.zeros(3)
    rows.tilt(np.ascontiguousarray(Q), axis, carried, error)
    return error


def heading_row(R, axis):
    """Row (3,) of the rate of the heading."""
    row = np.zeros(3)
    rows.heading_row(np.ascontiguousarray(R), axis, row)
    return row
