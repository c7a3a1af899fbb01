"""Values of a given set of effects, and how well it predicts.

In reading order: ``library`` (all columns of a log, and the fit of what is common), ``score`` (a
set's prediction of left-out blocks, by least squares within bounds, and its ``prior``), ``shapes``
(periods, speeds, delays ... by nonlinear least squares, and motors whose effects act one behind the
other), ``values`` (all parameters, ``consistent`` with physics, with standard errors), ``held_out``
(errors on data that took no part), ``torque_constants`` (what a wrong one does to the rest), and
``refine``, which fits to trajectories instead of the ``balance`` of torques.
"""

__all__: list[str] = []  # what is public of it, jaxidl.gap lists
