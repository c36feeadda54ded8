"""Kinematic simulator, launch-free test harness and demo."""
