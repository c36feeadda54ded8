"""Solutions of notebook 1; a section for each exercise."""

import math

import numpy as np


# %% 1.1
def tip(lengths, q):
    angles = np.cumsum(q)
    return np.array([lengths @ np.cos(angles), lengths @ np.sin(angles)])


# %% 1.2
def jacobian(lengths, q):
    angles = np.cumsum(q)
    x, y = lengths * np.cos(angles), lengths * np.sin(angles)
    # From joint i to the tip: the links from i on.
    return np.array([-np.cumsum(y[::-1])[::-1], np.cumsum(x[::-1])[::-1]])


# %% 1.3
def damped_inverse(J, damping):
    return J.T @ np.linalg.inv(J @ J.T + damping**2 * np.eye(len(J)))


# %% 1.4
# 0.5 m/s times the largest factor 1 / (2 λ) is to be 2 rad/s.
least_damping = 0.5 / (2.0 * 2.0)

# %% 1.5
# exp(-η t) = 1/10
seconds_to_a_tenth = math.log(10.0) / 0.5
