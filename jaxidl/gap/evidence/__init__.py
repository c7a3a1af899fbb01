"""What a log says: its rows, and what each effect would add to the command along them.

In reading order: ``rows`` (what all fits share), ``shape`` and ``additions`` (an effect's torque at
each row; ``friction`` by its mean around an instant, ``delivery`` for what actuators let through,
``behind`` for what an encoder's error changes), ``items`` (the same as columns of a regression) and
``gram`` (their products by block). Beside them stand what qualifies a log: ``conventions``,
``noise``, ``samples``, ``drift``, ``projection``, ``moments``. ``links`` says which joints an
effect concerns and how links may change, ``localise`` in which regimes a residual occurs.
"""

__all__: list[str] = []  # what is public of it, jaxidl.gap lists
