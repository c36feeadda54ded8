"""Second derivatives of a chain of joints, compiled by numba.

Importing this module compiles it, or loads what an earlier process compiled.
"""

from __future__ import annotations

from tp_controller.array_types import FIXED_ROWS
from tp_controller.compiled import float64, int64, njit, types, void

PLACES = types.Array(int64, 1, 'C', readonly=True)


@njit(void(FIXED_ROWS, PLACES, PLACES, float64[:, :, ::1]), cache=True)
def chain_hessian(jacobian, chain, joint_of, out):  # type: ignore[no-untyped-def]
    """Fill the derivative of a Jacobian by the joints.

    With columns ``[vᵢ; ωᵢ]`` and joints counted along the chain: for j up to i both are turned
    by joint j, ``ωⱼ × vᵢ`` and ``ωⱼ × ωᵢ``; for j after i only the end of the chain moves,
    ``ωᵢ × vⱼ`` and 0 (Hourtash 2005). Velocities of one planar or floating joint are along axes
    that move with it: each turns all of them as a joint before does.

    Parameters
    ----------
    jacobian
        Twist (6, m) of the end of the chain as seen from its beginning, per joint.
    chain
        The joints (p,) from the beginning on; the others do not move the end.
    joint_of
        Which joint each velocity (m,) belongs to.
    out
        Result (6, m, m): the last index is the joint by which the derivative is taken.
    """
    out[:] = 0.0
    for a in range(chain.size):
        i = chain[a]
        for b in range(a + 1):
            j = chain[b]
            for r in range(3):
                s, t = (r + 1) % 3, (r + 2) % 3
                ws, wt = jacobian[3 + s, j], jacobian[3 + t, j]
                turned = ws * jacobian[t, i] - wt * jacobian[s, i]
                out[r, i, j] = turned
                out[r, j, i] = turned
                out[3 + r, i, j] = ws * jacobian[3 + t, i] - wt * jacobian[3 + s, i]
                if a != b and joint_of[i] == joint_of[j]:
                    vs, vt = jacobian[3 + s, i], jacobian[3 + t, i]
                    out[r, j, i] = vs * jacobian[t, j] - vt * jacobian[s, j]
                    out[3 + r, j, i] = -out[3 + r, i, j]
