"""What stays unexplained, and what is said about it."""

import pytest

from jaxidl.effects import CATALOGUE
from jaxidl.gap.evidence.shape import build
from jaxidl.gap.result.diagnosis import Ambiguity, Finding
from jaxidl.gap.result.verdict import unexplained_joints, verdict_of
from jaxidl.gap.result.words import headline, undecided


@pytest.mark.parametrize(
    ("left", "gain", "stderr", "floor", "said"),
    [
        (0.32, 0.22, 0.04, 0.01, True),  # a fifth of a large error: 20 % of the command
        (0.32, 0.22, 0.15, 0.01, False),  # it could be chance
        (0.05, 0.22, 0.04, 0.01, False),  # 3 % of the command
        (0.32, 0.22, 0.04, 0.20, False),  # the encoder's noise
        (0.32, -0.10, 0.01, 0.01, False),  # a network predicts nothing
        (1.10, 0.00, 0.01, 0.01, True),  # worse than no model
    ],
)
def test_what_a_network_still_predicts_is_unexplained_if_it_is_large(
    left, gain, stderr, floor, said
):
    joints = unexplained_joints([left], [left], [(gain, stderr)], [2.0], [1.0], [floor])
    assert joints == ((0,) if said else ())


def test_what_happens_only_in_the_fitted_part_is_not_passed_over():
    """Such as a stop that is not reached again in the held-out part."""
    of = lambda everywhere: unexplained_joints(
        [0.01], [everywhere], [(0.7, 0.07)], [2.0], [1.0], [0.02]
    )
    assert of(0.3) == (0,)
    assert of(0.01) == ()


@pytest.mark.parametrize(("left", "said"), [(0.033, ()), (0.061, (0,)), (0.02, ())])
def test_what_conventional_identification_explains_besides_is_unexplained_if_it_is_large(
    left, said
):
    """An envelope always fits somewhat better: 2 % of the command, here of 0.02, is not much."""
    assert unexplained_joints([left], [left], [(0.0, 0.1)], [0.02], [1.0], [0.001]) == said


def test_what_a_reference_log_leaves_as_well_is_no_change():
    of = lambda earlier: unexplained_joints(
        [0.3], [0.3], [(0.7, 0.07)], [2.0], [1.0], [0.02], [earlier]
    )
    assert of(0.25) == ()
    assert of(0.1) == (0,)


def found(confidence: float, name: str = "viscous_friction") -> Finding:
    cls = CATALOGUE[name]
    effect = build(cls, 0, 1, dict.fromkeys(cls.parameters, 0.1), {})
    numbers = {"evidence": 9.0, "share": 0.5, "held_out_before": 1.0, "held_out_after": 0.5}
    return Finding(
        name, 0, effect, "", {}, confidence, where=0, gain=0.5, gain_stderr=0.01, **numbers
    )


def test_of_unexplained_joints_the_others_are_not_forgotten():
    large = ["67 % of the command on knee", "15 % of the command on hip"]
    said = headline("unexplained", [], ["hip"], large)
    assert "residual on hip stays unexplained" in said
    assert "besides, 67 % of the command on knee, can hardly be predicted" in said
    assert "besides" not in headline("unexplained", [], ["hip"], large[1:])


def test_an_error_that_remains_is_not_passed_over():
    nothing = headline("nothing_missing", [], [], [])
    assert nothing.startswith("Nothing is missing")
    assert "remains" not in nothing
    assert "remains, 32 % of the command on slide, can hardly be predicted" in headline(
        "nothing_missing", [], [], ["32 % of the command on slide"]
    )
    sure = [found(0.9)]
    assert "remains" not in headline("named", sure, [], [])
    assert "1 more is suspected." in headline("named", [*sure, found(0.6)], [], [])
    assert "1 more is possible, but more likely wrong than right." in headline(
        "named", [*sure, found(0.06)], [], []
    )
    named = headline("named", sure, [], ["9 % of the command on a", "8 % of the command on b"])
    assert "remains, up to 9 % of the command on a, can hardly be predicted" in named


def test_why_one_of_two_equal_explanations_is_named_is_said():
    names = ["viscous friction", "quadratic drag"]
    assert undecided(names, False).endswith("viscous friction and quadratic drag.")
    assert undecided(names, True).endswith("; viscous friction is named because it is likelier.")


def test_the_headline_does_not_claim_what_is_hardly_likely():
    of = lambda likely: headline("ambiguous", [found(likely), found(0.1), found(0.0)], [], [])
    assert of(0.7).startswith("Something is missing: 3 effects are suspected, which")
    assert of(0.13).startswith("Something may be missing: 3 effects are suspected")
    assert "with a confidence of at most 13 %, which" in of(0.13)
    assert "changed" in headline("ambiguous", [found(0.2)], [], [], True)
    alone = headline("ambiguous", [found(0.7)], [], [], others=False)
    assert alone == "Something may be missing: 1 effect is suspected."


@pytest.mark.parametrize(
    ("likely", "verdict"), [(0.04, "named"), (0.6, "ambiguous"), (None, "named")]
)
def test_what_is_more_likely_wrong_makes_no_named_effect_ambiguous(likely, verdict):
    sure = found(0.99, "coulomb_friction")
    doubt = Ambiguity((("viscous_friction", 0), ("quadratic_drag", 0)), "move slowly")
    rest = [] if likely is None else [found(likely)]
    assert verdict_of([sure, *rest], [doubt], ()) == verdict
    assert verdict_of(rest, [doubt], ()) == ("ambiguous" if rest else "nothing_missing")
