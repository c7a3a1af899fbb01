"""Policies that say what to do, feedback laws that insist on it."""

from jaxidl.control.doomed import Doomed
from jaxidl.control.law import Feedback, FeedbackLaw
from jaxidl.control.pid import Pid, PidGains
from jaxidl.control.policy import LqrPolicy, PdPolicy, lqr

__all__ = ["Doomed", "Feedback", "FeedbackLaw", "LqrPolicy", "PdPolicy", "Pid", "PidGains", "lqr"]
