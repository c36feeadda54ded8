"""Inverses of a Jacobian near and away from singularities."""

from __future__ import annotations

import math
from typing import NamedTuple

from tp_controller.errors import InvalidValue, listed, shown

INVERSES = ('dls', 'pinv', 'adaptive')


class Inverse(NamedTuple):
    """How a Jacobian is inverted: each direction by its own singular value s.

    - ``pinv``: 1/s, the pseudo-inverse.
    - ``dls``: s / (s² + λ²), damped least squares with constant damping (Nakamura and
      Hanafusa 1986; Wampler 1986).
    - ``adaptive``: s / (s² + λ² (1 - (s/ε)²)) where s < ε and 1/s elsewhere: damping that
      sets in near a singularity, and there along the lost directions alone (Maciejewski and
      Klein 1988; Chiaverini, Siciliano and Egeland 1994).

    What is None is left to another inverse, see `over`.
    """

    type: str | None = None
    """``dls``, ``pinv`` or ``adaptive``."""
    damping: float | None = None
    """λ, in the units of the Jacobian's singular values; its largest value if adaptive."""
    region: float | None = None
    """ε, the singular value below which adaptive damping sets in."""

    def over(self, other: Inverse) -> Inverse:
        """Return this inverse with what it leaves open taken from another one."""
        given = {key: value for key, value in self._asdict().items() if value is not None}
        return other._replace(**given)

    def check(self, prefix: str) -> None:
        """Check that the inverse can be used.

        Parameters
        ----------
        prefix
            Where its values stand in a parameter file, for messages.

        Raises
        ------
        InvalidValue
            For an unknown type, a damping that is negative, a region that is not above
            zero, or either if it is not finite.
        """
        if self.type not in (None, *INVERSES):
            raise InvalidValue(f'{prefix}.inverse', shown(self.type), f'one of {listed(INVERSES)}')
        if self.damping is not None and not 0.0 <= self.damping < math.inf:
            raise InvalidValue(
                f'{prefix}.damping', repr(self.damping), 'a finite number of at least 0'
            )
        if self.region is not None and not 0.0 < self.region < math.inf:
            raise InvalidValue(
                f'{prefix}.singular_region', repr(self.region), 'a finite number above 0'
            )

    @property
    def rule(self) -> tuple[float, float]:
        """λ and ε such that ``λ² max(0, 1 - (s/ε)²)`` is the square of the damping at s.

        Only of an inverse that leaves nothing open.
        """
        assert self.damping is not None
        assert self.region is not None
        if self.type == 'pinv':
            return 0.0, math.inf
        return self.damping, self.region if self.type == 'adaptive' else math.inf


DEFAULT = Inverse('dls', 0.1, 0.1)
"""What stands for everything that is left open."""

ONE_SIDED = Inverse('adaptive', 0.05, 0.05)
"""The same for levels of nothing but bounds: they are kept exactly where joints can keep them."""
