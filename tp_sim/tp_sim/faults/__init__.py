"""The fault table: a velocity controller in real time, with faults around it, judged by topics.

`table` lists the cases, `rig` runs one with real processes, `relay` stands between simulator and
controller, `judge` says from what was recorded there whether the commands were allowed.
"""
