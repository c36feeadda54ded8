"""Launch-free test harness: the real nodes on a private domain, stepped and recorded.

::

    from tp_sim.harness import ClosedLoop

    with ClosedLoop('config/a4_position_joint.yaml') as loop:
        loop.send_goal('ee_position', [0.8, 0.9])
        loop.run(10.0)
        assert loop.record.error_norm['ee_position'][-1] < 1e-3
"""

from tp_sim.harness.client import Client
from tp_sim.harness.closed_loop import ClosedLoop
from tp_sim.harness.document import edited, read_document, write_document
from tp_sim.harness.domain import PrivateDomain
from tp_sim.harness.errors import GoalRejected, HarnessError
from tp_sim.harness.process import NodeProcess, Process, executable_path
from tp_sim.harness.record import Record

__all__ = [
    'Client',
    'ClosedLoop',
    'GoalRejected',
    'HarnessError',
    'NodeProcess',
    'PrivateDomain',
    'Process',
    'Record',
    'edited',
    'executable_path',
    'read_document',
    'write_document',
]
