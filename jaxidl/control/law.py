"""What a feedback law is."""

from typing import Any, NamedTuple, Protocol, runtime_checkable

from jaxidl.types import Joints, State


class Feedback(NamedTuple):
    """The two feedback torques of one instant."""

    applied: Joints  # (J,) goes to the plant [N]
    learning: Joints  # (J,) goes to the learner only [N]


@runtime_checkable
class FeedbackLaw(Protocol):
    """``init`` once, then in every control step ``act`` before the plant moves and ``observe``
    after it.
    """

    def init(self, q: Joints) -> Any:
        """Memory at the start of an execution at position ``q`` (J,)."""
        ...

    def act(self, memory: Any, desired: State, sensed: State) -> tuple[Feedback, Any]:
        """Feedback for this step, given the desired and the sensed state, and the new memory."""
        ...

    def observe(self, memory: Any, qdd_desired: Joints, qdd_actual: Joints) -> Any:
        """Memory after seeing the acceleration (J,) [m/s^2] that the step made."""
        ...
