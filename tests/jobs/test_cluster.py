"""Sweeps on a Ray cluster give the same bits as on this machine, whichever node is lost."""

import json
import sys
import textwrap

import pytest

from jaxidl.errors import ConfigurationError, StoreError
from jaxidl.jobs import cluster
from jaxidl.paper.grid import Grid
from tests.helpers.process import script

pytest.importorskip("ray", reason="the extra jaxidl[cluster] is not installed")

PRELUDE = """
    import json, sys, threading, time
    from pathlib import Path
    from jaxidl.backend import choose_devices
    from jaxidl.paper.grid import Grid
    from jaxidl.paper.runs import run_sweep
    from tests.helpers.studies import SMALL_STUDY as study

    grid = Grid(("pid",), noise=(1e-4, 8e-4), friction=(5.0,), stiction=(5.0,), epochs=(1,), seeds=(1, 2, 3), sources=("joint",),
                executions=EXECUTIONS)
    folder = Path(sys.argv[1])
    names = ("q_error", "feedback_applied", "qdd_error", "torque", "finite")

    def here():
        choose_devices(1)
        return run_sweep(grid, folder / "here.nc", study, per_device=1, quiet=True)

    def same(a, b):
        return all((a[name].values == b[name].values).all() for name in names)
"""  # noqa: E501

TWO_NODES = """
    import ray
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    second = nodes.add_node(num_cpus=1)
    parts, seen = folder / "there.nc.parts", {}

    def kill():
        while len(list(parts.glob("*.npz"))) < 3:
            time.sleep(0.01)
        nodes.remove_node(second, allow_graceful=False)
        seen["parts"] = len(list(parts.glob("*.npz")))

    threading.Thread(target=kill, daemon=True).start()
    there = run_sweep(grid, folder / "there.nc", study, cluster=nodes.address, per_device=1, quiet=True)
    seen["hosts"] = len(json.loads(there.attrs["origins"]))
    nodes.shutdown()
    print(json.dumps({"same": same(there, here()), "runs": len(grid), **seen}))
"""  # noqa: E501


def run_script(folder, code, executions=3):
    code = textwrap.dedent(PRELUDE).replace("EXECUTIONS", str(executions)) + textwrap.dedent(code)
    quiet = {"RAY_DEDUP_LOGS": "0", "PYTHONWARNINGS": "ignore"}
    return json.loads(script(code, folder, **quiet).splitlines()[-1])


@pytest.mark.slow
def test_a_cluster_that_loses_one_of_two_nodes_midway_gives_the_same_bits(tmp_path):
    result = run_script(tmp_path, TWO_NODES, executions=150)
    assert result["same"]
    # the node was lost while there was work left
    assert 3 <= result["parts"] < result["runs"] == 12
    assert sorted(path.name for path in tmp_path.iterdir()) == ["here.nc", "there.nc"]


UNSHARED = """
    from jaxidl.errors import ConfigurationError, StoreError
    from jaxidl.jobs import cluster, store

    original = cluster.Cluster._result
    def elsewhere(self, reference):
        part = original(self, reference)
        part.unlink()  # as if it had been written to another machine's disk
        return part
    cluster.Cluster._result = elsewhere
    messages = []
    try:
        run_sweep(grid, folder / "a.nc", study, cluster="local", per_device=1, quiet=True)
    except StoreError as error:
        messages.append(str(error))
    cluster.Cluster._result = original
    cluster.versions = lambda: {"jaxidl": "0", "jax": "0", "jaxlib": "0", "numpy": "0", "revision": "0"}
    try:
        run_sweep(grid, folder / "a.nc", study, cluster="local", per_device=1, quiet=True)
    except ConfigurationError as error:
        messages.append(str(error))
    print(json.dumps(messages))
"""  # noqa: E501


@pytest.mark.slow
def test_a_folder_that_is_not_shared_and_versions_that_differ_are_refused(tmp_path):
    unshared, unlike = run_script(tmp_path, UNSHARED)
    assert "folder that all machines share" in unshared
    assert "same versions" in unlike
    assert not (tmp_path / "a.nc").exists()


@pytest.mark.parametrize(
    ("address", "complaint"),
    [("127.0.0.1:1", "refused"), ("nonsense", "HOST:PORT"), ("", "HOST:PORT")],
)
def test_a_cluster_that_is_not_there_is_refused_at_once(address, complaint):
    with pytest.raises(ConfigurationError, match=complaint), cluster.Cluster(address):
        pass


def test_missing_ray_is_refused_with_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigurationError, match=r"jaxidl\[cluster\]"), cluster.Cluster("local"):
        pass


def test_devices_and_cluster_exclude_each_other(tmp_path, small_study):
    from jaxidl.paper.runs import run_sweep

    with pytest.raises(ConfigurationError, match="--devices or --cluster"):
        run_sweep(Grid(), tmp_path / "r.nc", small_study, devices=1, cluster="local")
    assert not list(tmp_path.iterdir())


def test_errors_survive_the_way_from_a_worker():
    import pickle

    error = pickle.loads(pickle.dumps(StoreError("a", "b", "c")))
    assert (str(error), error.remedy) == ("expected a; got b; c", "c")
