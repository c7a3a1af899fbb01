"""What several joints, or columns that are there twice, say about a log's samples."""

import numpy as np
import pytest

from jaxidl.gap.evidence.projection import basis
from jaxidl.gap.evidence.samples import samples_alike


def test_joints_at_rest_do_not_say_how_many_samples_count_as_one():
    """Most joints rest: their samples would count as none, and priors as infinite."""
    count, effective = np.array([0.0, 0.0, 600.0]), np.array([0.0, 0.0, 100.0])
    assert samples_alike(count, effective) == pytest.approx(6.0)
    assert samples_alike(0.0 * count, 0.0 * effective) == 1.0


def test_columns_that_are_there_twice_have_one_direction():
    x = np.random.default_rng(0).standard_normal((50, 3))
    found = basis(np.concatenate([x, x, 0.0 * x], axis=1))
    assert found.shape == (50, 3)
    np.testing.assert_allclose(found @ (found.T @ x), x, atol=1e-10)
    assert basis(np.zeros((50, 0))).shape == (50, 0)
