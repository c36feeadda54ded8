"""The ROS 2 side: messages and parameters to arrays, and back."""
