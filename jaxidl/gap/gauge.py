"""The fitted parameters as they are told: with standard errors, and with what two effects share given to one of them."""

from typing import Any

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.alignment import ALIGNMENT, alignments
from jaxidl.gap.data import Data
from jaxidl.gap.fit import Fit, polished
from jaxidl.gap.fit import fit as fit_members
from jaxidl.gap.gains import jackknife
from jaxidl.gap.members import Member, member
from jaxidl.gap.search import Outcome
from jaxidl.gap.terms import with_parameters

Told = dict[str, tuple[Any, Any]]  # parameter: value and standard error

SHARED = {"positive": ("coulomb_friction", "level"), "viscous_positive": ("viscous_friction", "coefficient")}
"""What friction by direction has in common with plain friction on the same joint: the mean of both directions."""


def settled(outcome: Outcome, whole: Data, narrow: Data) -> list[tuple[Effect, Told]]:
    """Effect and parameters of each named effect, in the order added, fitted to the ``whole`` log.

    What an effect is worth was shown on data kept aside; the model that is handed out need not do without these. Standard errors
    are the jackknife's over blocks and, beside them, the change when the log is filtered to a ``narrow`` band: what filters and
    time steps do to a parameter is the same in all blocks. No time is told better than to a sampling interval: where within it a
    command acts and a reading is taken, a log does not say.
    """
    ranking = outcome.ranking
    joints = tuple(range(whole.base.shape[1]))
    fit = polished(whole, fit_members(whole, ranking.all(), ranking.weight), ranking.weight, joints)
    again = polished(narrow, fit_members(narrow, _anew(fit, narrow), ranking.weight), ranking.weight, joints)
    place = {(m.candidate.name, m.candidate.joint): i for i, m in enumerate(fit.members)}
    thetas, samples = [t.copy() for t in fit.thetas], [s.copy() for s in fit.samples]
    narrows = [t.copy() for t in again.thetas]
    for i, m in enumerate(fit.members):
        for name, partner in SHARED.items():
            j = place.get((partner[0], m.candidate.joint))
            if m.candidate.name == "asymmetric_friction" and name in m.candidate.free and j is not None:
                k = m.candidate.free.index(name)
                for values in (thetas, samples, narrows):
                    mean = values[i][..., k : k + 2].mean(-1, keepdims=True)
                    values[j] += mean
                    values[i][..., k : k + 2] -= mean
    out = []
    for named in outcome.named:
        i = place[(named.member.candidate.name, named.member.candidate.joint)]
        out.append(_told(fit.members[i], thetas[i], np.hypot(jackknife(samples[i]), narrows[i] - thetas[i]), whole.signals.dt))
    return out


def _anew(found: Fit, data: Data) -> tuple[Member, ...]:
    """The members of a fit at their fitted parameters, on other data of the same log."""
    tau, out = data.tau, []
    timing = {m.candidate.joint for m in found.members if m.candidate.name == ALIGNMENT}
    for m, theta in zip(found.members, found.thetas, strict=True):
        if m.candidate.name != ALIGNMENT:
            low, high = m.candidate.bounds()
            effect = with_parameters(m.effect, m.candidate.free, np.clip(theta, low, high))
            out.append(member(m.candidate, effect, data.signals, tau))
            tau = out[-1].through(tau)
    return (*out, *(a for a in alignments(data) if a.candidate.joint in timing))


def _told(m: Member, theta: np.ndarray, errors: np.ndarray, dt: float) -> tuple[Effect, Told]:
    low, high = m.candidate.bounds()
    effect = with_parameters(m.effect, m.candidate.free, np.clip(theta, low, high))
    told: Told = {}
    at = 0
    for name in m.candidate.free:
        size = np.size(getattr(m.effect, name))
        values, spread = np.asarray(getattr(effect, name), float).ravel(), errors[at : at + size]
        if m.effect.parameters[name].unit == "s":
            spread = np.hypot(spread, dt / np.sqrt(12.0))
        told[name] = (float(values[0]), float(spread[0])) if size == 1 else (values.tolist(), spread.tolist())
        at += size
    told |= {name: (float(getattr(effect, name)[0]), stderr) for name, stderr in m.candidate.tried.items()}
    return effect, told
