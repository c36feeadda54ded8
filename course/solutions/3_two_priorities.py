"""Solutions of notebook 3; a section for each exercise."""

import math

import numpy as np


# %% 3.1
def desired_velocity(error, K, feedforward):
    gain = K @ error if np.ndim(K) == 2 else K * error
    return gain + feedforward


# %% 3.2
def angle_error(desired, current):
    return math.remainder(desired - current, 2.0 * math.pi)


# %% 3.3
def projector(J):
    return np.eye(J.shape[1]) - np.linalg.pinv(J) @ J


# %% 3.4
def scaled(qd, limit):
    return qd / max(1.0, np.max(np.abs(qd) / limit))


# %% 3.5
# At rest of the error, w = K e.
distance_behind = 0.2 / 4.0
