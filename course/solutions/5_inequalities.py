"""Solutions of notebook 5; a section for each exercise."""

import numpy as np


# %% 5.1
def distance_and_row(p, J, center, radius):
    way = p - center
    length = np.linalg.norm(way)
    return length - radius, way / length @ J


# %% 5.2
def switch(on, distance, activation, release):
    return distance <= (release if on else activation)


# %% 5.3
def largest_step(lengths, limit, dt):
    # Joint i moves the tip at most by the links from i on.
    arms = np.cumsum(lengths[::-1])
    return limit * dt * arms.sum()


# %% 5.4
def least_rate(d, margin, activation, fastest, gain):
    if d <= margin:
        return gain * (margin - d)
    return -(d - margin) * fastest / (activation - margin)
