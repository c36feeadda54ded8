"""A recording of a stack in closed loop, made of real messages without any node."""

from pathlib import Path

import numpy as np
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from tp_controller.config import build_settings, parameter_text, read_parameter_file
from tp_controller.recording import RecordingWriter
from tp_controller.recording.writer import ABOUT, FROM, NODE, PARAMETERS, TO
from tp_controller.ros.message_definitions import full_definition
from tp_controller.ros.state import StateMessage

CONFIG = Path(__file__).resolve().parents[2] / 'config'
STATE, JOINTS = 'tp_interfaces/msg/ControllerState', 'sensor_msgs/msg/JointState'
NODE_NAME = '/tp_controller'


def make_recording(path, name, seconds, goals=(), changes=None):
    """Record a configuration; each goal is a time [s], a task and its target."""
    parameters = read_parameter_file(CONFIG / f'{name}.yaml', 'tp_controller') | (changes or {})
    q = np.array(read_parameter_file(CONFIG / f'{name}.yaml', 'tp_sim')['initial_positions'])
    settings = build_settings(parameters, find_rate=True)
    stack, rate = settings.stack, settings.values['rate']
    state = StateMessage(stack)
    with RecordingWriter(path) as writer:
        writer.describe(ABOUT, {NODE: NODE_NAME})
        writer.attach(PARAMETERS, 'application/yaml', parameter_text(parameters, 'tp_controller'))
        told = writer.add_topic(f'{NODE_NAME}/state', STATE, full_definition(STATE), '', FROM)
        seen = writer.add_topic('/joint_states', JOINTS, full_definition(JOINTS), '', TO)
        for i in range(round(seconds * rate)):
            for when, task, target in goals:
                if i == round(when * rate):
                    stack.tasks[task].target = target
            now = round(1e9 * (1.0 + i / rate))
            stamp = {'sec': now // 10**9, 'nanosec': now % 10**9}
            joints = JointState(name=list(stack.robot.joints), position=list(q))
            for msg in (joints, state.msg):
                msg.header.stamp.sec, msg.header.stamp.nanosec = stamp['sec'], stamp['nanosec']
            writer.write(seen, serialize_message(joints), now, now)
            step = stack.step(q)
            state.msg.cycles, state.msg.status, state.msg.scale = i + 1, 1, step.scale
            state.msg.command_age = state.msg.solve_time = 1e-4 * (i % 7)
            state.refresh(step.command)
            state.explain(lambda: False)
            writer.write(told, state.serialized(), now, now)
            q = q + step.command / rate
    return path
