"""A plant driven by the commands of a measured log: rollouts from measured states, and parameters
fitted to them.
"""
