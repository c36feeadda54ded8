"""ROS 2 parameters of a node, described by a schema."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from tp_controller.config import ROS_OWN
from tp_controller.parameters import Flat, Parameter


def given_parameters(node: Node) -> Flat:
    """Values by dotted key that the node was started with.

    The node declares them by itself, ``automatically_declare_parameters_from_overrides``.
    """
    found = node.get_parameters_by_prefix('')
    return {
        key: parameter.value for key, parameter in found.items() if not key.startswith(ROS_OWN)
    }


def describe_parameters(
    node: Node, schema: Mapping[str, Parameter], values: Mapping[str, Any]
) -> None:
    """Give every parameter of a schema its description, and its value if it has none yet.

    Those of tasks, which may be removed, are not marked read-only: ROS 2 would not let them go.
    Changes are checked all the same.
    """
    for key, parameter in schema.items():
        descriptor = ParameterDescriptor(
            name=key,
            description=parameter.description,
            additional_constraints=parameter.accepts,
            read_only=not (parameter.runtime or key.startswith('tasks.')),
            dynamic_typing=True,
        )
        value = values[key]
        if node.has_parameter(key):
            node.set_descriptor(key, descriptor)
        elif value is not None:
            # One without a value is declared when it gets one; a dump could not be read else.
            value = list(value) if isinstance(value, tuple) else value
            # A task that comes again is not the one that the node was started with.
            node.declare_parameter(key, value, descriptor, ignore_override=True)
