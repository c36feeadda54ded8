"""Solutions of notebook 4; a section for each exercise."""

import numpy as np


# %% 4.1
def recursion(levels, damping):
    n = levels[0][0].shape[1]
    qd, P = np.zeros(n), np.eye(n)
    for J, v in levels:
        J_bar = J @ P
        damped = J_bar.T @ np.linalg.inv(J_bar @ J_bar.T + damping**2 * np.eye(len(J)))
        qd = qd + damped @ (v - J @ qd)
        size = np.linalg.norm(J_bar, 2)
        # Singular values up to 1e-8 of ‖J‖ count as zero.
        share = 1e-8 * np.linalg.norm(J) / size if size > 0.0 else 1.0
        P = P - np.linalg.pinv(J_bar, rcond=min(share, 1.0)) @ J_bar
    return qd


# %% 4.2
# The tip takes two directions. With the tip in place the end of link 4 can only go round it:
# one direction. Both fix the angle of link 5: no direction.
freedom_left = [5 - 2, 5 - 2 - 1, 5 - 2 - 1 - 0]


# %% 4.3
def adaptive_factor(s, damping, region):
    near = np.maximum(0.0, 1.0 - (s / region) ** 2)
    return s / (s**2 + damping**2 * near)


# %% 4.4
# The share is s f(s) = s² / (s² + λ²): one half at s = λ.
half_share = 0.1
