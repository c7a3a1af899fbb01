"""The wish to stop, as a signal handler leaves it and long work looks at it."""


class Flag:
    """Set by a signal handler; without a lock, on which a handler that interrupts another one would
    wait forever.
    """

    def __init__(self) -> None:
        self._on = False

    def set(self) -> None:
        self._on = True

    def clear(self) -> None:
        self._on = False

    def is_set(self) -> bool:
        return self._on


STOP = Flag()  # a KeyboardInterrupt raised inside JAX's callbacks can get lost
