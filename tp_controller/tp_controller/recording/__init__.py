"""Recordings: one MCAP file per run, written and read without ROS.

The files have the profile ``ros2``: messages as ROS 2 sends them, with their definitions, which
Foxglove, PlotJuggler and rosbag2 read. The controller's parameters and the robot's URDF are
attached, so that a recording says by itself what was run.
"""

from tp_controller.recording.course import LevelCourse, Run, TaskCourse, run_of
from tp_controller.recording.moments import Moment, Moments
from tp_controller.recording.reader import Entry, Recording
from tp_controller.recording.writer import Contents, RecordingWriter

__all__ = [
    'Contents',
    'Entry',
    'LevelCourse',
    'Moment',
    'Moments',
    'Recording',
    'RecordingWriter',
    'Run',
    'TaskCourse',
    'run_of',
]
