"""The interface of a feedback law."""

from typing import Any, NamedTuple, Protocol, runtime_checkable

from jaxidl.types import Joints, Scalar, State


class Feedback(NamedTuple):
    """The two feedback torques of one instant."""

    applied: Joints  # (J,) applied to the plant [N]
    learning: Joints  # (J,) for the learner only [N]


@runtime_checkable
class FeedbackLaw(Protocol):
    """A feedback law with a memory.

    ``init`` is called once, then in every control step ``act`` before the plant moves and
    ``observe`` after it.
    """

    @property
    def smoothing(self) -> Scalar:
        """Return the weight of a new sample in the learning feedback [-]; 1: not filtered."""
        ...

    def scaled(self, share: Joints | Scalar) -> "FeedbackLaw":
        """Return the law with its applied gains times ``share``, and the learner's as they are."""
        ...

    def init(self, q: Joints) -> Any:
        """Return the memory at the start of an execution at position ``q`` (J,)."""
        ...

    def act(self, memory: Any, desired: State, sensed: State) -> tuple[Feedback, Any]:
        """Return this step's feedback, for the desired and the sensed state, and the new memory."""
        ...

    def observe(self, memory: Any, qdd_desired: Joints, qdd_actual: Joints) -> Any:
        """Return the memory after the step.

        The accelerations are (J,) [m/s^2]; ``qdd_actual`` is the one that the step produced.
        """
        ...
