"""Jacobi's method for small matrices, compiled by numba: no allocation."""

from __future__ import annotations

import math

from tp_controller.compiled import inner

ORTHOGONAL = 1e-15
"""Rows whose cosine is below this count as orthogonal."""
NEARLY = 1e-8
"""Turns by less, of rows with smaller cosines, leave cosines of the size of this square."""
FAR_APART = 1e8
"""Cotangent of twice an angle beyond which the cosine of the angle is 1 in floating point."""
SWEEPS = 60
"""More than any matrix needs; Jacobi's method converges quadratically."""


@inner
def orthogonalise(B, W, p, q, turns):  # type: ignore[no-untyped-def]
    """Turn the p rows (q,) of B until they are orthogonal; W (p, p) is the turn, if it ``turns``.

    One-sided Jacobi (Hestenes 1958): afterwards the rows are right singular vectors times
    singular values, and the rows of W the left singular vectors.
    """
    w = p if turns else 0
    for i in range(w):
        for j in range(w):
            W[i, j] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        turned = False
        for i in range(p - 1):
            for j in range(i + 1, p):
                ii = ij = jj = 0.0
                for c in range(q):
                    ii += B[i, c] * B[i, c]
                    ij += B[i, c] * B[j, c]
                    jj += B[j, c] * B[j, c]
                if not ij * ij > ORTHOGONAL * ii * (ORTHOGONAL * jj):
                    continue
                ratio = (jj - ii) / (2.0 * ij)
                size = abs(ratio)
                t, cosine = 0.5 / size if size > 0.0 else 1.0, 1.0
                if size < FAR_APART:
                    # Neither the tangent nor the cosine waits for the other.
                    root = math.sqrt(1.0 + ratio * ratio)
                    t, cosine = 1.0 / (size + root), math.sqrt(0.5 + 0.5 * (size / root))
                if ratio < 0.0:
                    t = -t
                sine = cosine * t
                if abs(sine) > NEARLY or ij * ij > NEARLY * ii * (NEARLY * jj):
                    turned = True
                for c in range(q):
                    a, b = B[i, c], B[j, c]
                    B[i, c], B[j, c] = cosine * a - sine * b, sine * a + cosine * b
                for c in range(w):
                    a, b = W[i, c], W[j, c]
                    W[i, c], W[j, c] = cosine * a - sine * b, sine * a + cosine * b
        if not turned:
            return


@inner
def eigenvectors(A, W, m, turns):  # type: ignore[no-untyped-def]
    """Fill the rows of W (m, m) with the eigenvectors of a symmetric matrix A (m, m), if told to.

    Returns
    -------
    float
        The norm of A. The rows of A are then as long as the eigenvalues and this together.
    """
    norm = 0.0
    for a in range(m):
        for b in range(m):
            norm += A[a, b] * A[a, b]
    norm = math.sqrt(norm)
    for a in range(m):
        A[a, a] += norm
    orthogonalise(A, W, m, m, turns)
    return norm
