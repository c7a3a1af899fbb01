"""A plant driven by the commands of a measured log.

Rollouts start from measured states, and parameters are fitted to them.
"""
