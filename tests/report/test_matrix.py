"""How numbers are spelled in tables."""

from jaxidl.gap.result.diagnosis import Estimate
from jaxidl.report.matrix import spelled


def test_a_tensor_that_may_be_zero_is_one_number():
    noise = Estimate(
        [0.01, -0.02, 0.0, 0.01, 0.0, 0.0], "kg m^2", [0.05, 0.06, 0.07, 0.01, 1e-3, 1e-3]
    )
    assert spelled(noise) == "zero within its error, at most ± 0.07 kg m²"
    known = noise._replace(value=[0.2, *noise.value[1:]])
    assert spelled(known).startswith("xx 0.200 ± 0.050, yy")
    assert spelled(Estimate([0.0, 0.1, 0.0], "m", [0.2, 0.2, 0.2])).startswith("x 0.0")
