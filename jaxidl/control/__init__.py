"""Policies that give the desired acceleration, and feedback laws that follow it."""

from jaxidl.control.doomed import Doomed
from jaxidl.control.estimate import Estimator, Filtered, FiniteDifference
from jaxidl.control.law import Feedback, FeedbackLaw
from jaxidl.control.pid import Pid, PidGains
from jaxidl.control.policy import LqrPolicy, PdPolicy, Sequence, lqr

__all__ = [
    "Doomed",
    "Estimator",
    "Feedback",
    "FeedbackLaw",
    "Filtered",
    "FiniteDifference",
    "LqrPolicy",
    "PdPolicy",
    "Pid",
    "PidGains",
    "Sequence",
    "lqr",
]
