"""Solutions of notebook 6; a section for each exercise."""

import math

import numpy as np


# %% 6.1
def largest_share(start, way, low, high):
    share = 1.0
    for at, to, below, above in zip(start, way, low, high, strict=True):
        if to > 0.0:
            share = min(share, (above - at) / to)
        elif to < 0.0:
            share = min(share, (below - at) / to)
    return share


# %% 6.2
def answer_with_the_rest(J, v, held, value):
    free = np.arange(J.shape[1]) != held
    qd = np.full(J.shape[1], float(value))
    qd[free] = np.linalg.pinv(J[:, free]) @ (v - J[:, held] * value)
    return qd


# %% 6.3
def braking_distance(v, a, T):
    k = math.ceil(v / (a * T))
    return T * (k * v - 0.5 * k * (k - 1) * a * T)
