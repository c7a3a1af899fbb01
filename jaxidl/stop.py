"""A flag that asks long work to stop: a signal handler sets it, the work checks it."""


class Flag:
    """A flag that a signal handler can set.

    It has no lock: a handler that interrupts another one would wait for it forever.
    """

    def __init__(self) -> None:
        self._on = False

    def set(self) -> None:
        self._on = True

    def clear(self) -> None:
        self._on = False

    def is_set(self) -> bool:
        return self._on


STOP = Flag()  # a KeyboardInterrupt raised inside a callback of JAX can be lost
