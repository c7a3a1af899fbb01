"""The robot experiments: the arm study, pick and place, the limits of the method, real time, and
the gap workflow on the arm.
"""

EXPERIMENTS = ("study", "pick", "limits", "latency", "gap")
