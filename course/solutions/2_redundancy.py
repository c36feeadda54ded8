"""Solutions of notebook 2; a section for each exercise."""

import numpy as np


def damped_inverse(J, damping):
    return J.T @ np.linalg.inv(J @ J.T + damping**2 * np.eye(len(J)))


# %% 2.1
def augmented_step(J1, v1, J2, v2, damping):
    return damped_inverse(np.vstack([J1, J2]), damping) @ np.concatenate([v1, v2])


# %% 2.2
def priority_step(J1, v1, J2, v2, damping):
    first = damped_inverse(J1, damping) @ v1
    P = np.eye(len(first)) - np.linalg.pinv(J1) @ J1
    return first + damped_inverse(J2 @ P, damping) @ (v2 - J2 @ first)


# %% 2.3
def null_vector(J):
    z = np.cross(J[0], J[1])
    return z / np.linalg.norm(z)


# %% 2.4
def condition(J, q, q0):
    z = np.cross(J[0], J[1])
    return z @ (q0 - q) / np.linalg.norm(z)
