"""Learning on a cluster: the brush that processes here find, and what is said when the cluster fails."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from clusters import dask_cluster
from flockbrush.engine.problems import ProblemsError
from test_learn_tracks import herd_tracks

import flockbrush
from flockbrush.learning.workers import Workers
from flockbrush.runs.cluster import cluster


def digest_of(given, number):
    """A task of `Workers`, with an array that somebody writes to."""
    given += number
    return hashlib.sha256(given.tobytes()).hexdigest()


@pytest.fixture(scope="module")
def begun():
    """The processes of a cluster, the scheduler first, which the last test that needs it kills."""
    return []


@pytest.fixture(scope="module")
def address(begun):
    with dask_cluster(1, begun=begun, PYTHONPATH=str(Path(__file__).parent)) as (found, _):
        yield found


def test_workers_of_a_cluster_do_what_is_done_here(address):
    tasks = [{"number": 0}] * 3
    with cluster(address) as crew, Workers(np.arange(5.0), cluster=crew) as far, Workers(np.arange(5.0)) as here:
        assert far.map(digest_of, tasks) == here.map(digest_of, tasks)


@pytest.mark.slow
def test_a_cluster_learns_the_brush_that_one_process_learns(address, hasty_learning):
    length = flockbrush.shipped().get("march").body.length
    how = {"unit": "m", "fps": 16, "body_length": length, "quick": True, "starts": 1, "name": "marchers"}
    tracks = herd_tracks(6, 2.0)
    assert flockbrush.learn(tracks, cluster=address, **how).brush == flockbrush.learn(tracks, **how).brush


def test_a_worker_of_other_code_ends_the_learning(address, monkeypatch):
    with cluster(address) as crew:
        other = type("Build", (), {"code": "0" * 64})()
        monkeypatch.setattr("flockbrush.learning.workers.build_of_worker", lambda: other)
        with Workers(np.arange(5.0), cluster=crew) as far, pytest.raises(ProblemsError, match="has code .* --resume"):
            far.map(digest_of, [{"number": 0}])


def test_a_scheduler_that_dies_is_told_and_what_was_done_is_kept(tmp_path, address, begun):
    with cluster(address) as crew:
        with Workers(np.arange(5.0), path=tmp_path / "kept", cluster=crew) as far:
            far.map(digest_of, [{"number": 0}])
            begun[0].kill()
            with pytest.raises(ProblemsError, match="is not running any more; finished work is kept; continue"):
                far.map(digest_of, [{"number": 1}])
        assert len(Workers(None, path=tmp_path / "kept").known) == 1


def test_what_a_cluster_cannot_do_is_refused(cli, tmp_path):
    np.save(tmp_path / "a.npy", herd_tracks(4, 2.0))
    asked = ["learn", tmp_path / "a.npy", "-o", tmp_path / "a.brush.toml", "--unit", "m", "--fps", 16]
    assert "not both" in cli(*asked, "--jobs", 2, "--cluster", "tcp://a:1").err
    assert "--cluster tls://" in cli(*asked, "--tls-ca", tmp_path / "a.npy").err
    assert "the model zones is fitted locally" in cli(*asked, "--model", "zones", "--cluster", "tcp://a:1").err
