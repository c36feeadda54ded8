"""The page in the browser: what is drawn and what can be asked for there; it knows no ROS.

Of a controller it shows objects with the fields of tp_interfaces/ControllerState.
"""
