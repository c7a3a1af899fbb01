"""Kept pieces of long work: whose they are, and what becomes of damaged ones."""

import numpy as np
import pytest

from jaxidl.errors import StoreError
from jaxidl.jobs import Pieces


def test_pieces_of_other_settings_are_not_loaded_and_a_folder_is_for_one_process(tmp_path):
    with Pieces(tmp_path, {"a": 1}) as parts:
        parts.save("x", {"value": np.arange(3)})
        with pytest.raises(StoreError, match="no other process"), Pieces(tmp_path, {"a": 1}):
            pass
    with Pieces(tmp_path, {"a": 2}) as parts:
        assert parts.load("x") is None
        parts.save("x", {"value": np.zeros(1)})  # beside the other one, not in its place
        parts.of({"b": 1}).save("y", {"value": np.arange(4)})
        assert parts.load("y") is None
        np.testing.assert_array_equal((parts.of({"b": 1}).load("y") or {})["value"], np.arange(4))
    with Pieces(tmp_path, {"a": 1}) as parts:
        np.testing.assert_array_equal((parts.load("x") or {})["value"], np.arange(3))


def test_a_damaged_piece_is_not_loaded(tmp_path):
    with Pieces(tmp_path, {"a": 1}) as parts:
        parts.save("x", {"value": np.arange(40)})
        whole = parts.path("x").read_bytes()
        for at in range(0, len(whole), 7):
            parts.path("x").write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
            found = parts.load("x")
            # some bytes of a zip file say nothing
            assert found is None or np.array_equal(found["value"], np.arange(40))
        parts.path("x").write_bytes(whole[: len(whole) // 2])
        assert parts.load("x") is None
