"""Gains found by gradient: controller and learner of a plant, under a bound on feedback effort,
against random search.
"""
