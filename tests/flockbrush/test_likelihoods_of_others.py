"""A likelihood of another package that fails is named with its file, and what it must do instead."""

from types import SimpleNamespace

import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.engine.plugins import PluginError

from flockbrush.learning import likelihood as likelihood_module
from flockbrush.learning.likelihood import Likelihood, likelihood_of, likelihoods, place, register, tension
from flockbrush.learning.likelihoods.zones import NUMBERS, VIEWS
from flockbrush.learning.which_model import likeliest

ZONES = behaviours()["zones"].Params


def failing(*_):
    return 1 / 0


def registered(monkeypatch, **changed):
    """A likelihood as another package registers it, as learning finds it."""
    monkeypatch.setattr(likelihood_module, "_registry", likelihoods())
    register(Likelihood(**{"name": "mine", "model": "zones", "views": VIEWS, "fit": failing, "numbers": {}} | changed))
    return likelihoods()["mine"]


@pytest.mark.parametrize(
    ("fit", "words"),
    [
        (failing, r":[0-9]+: likelihood 'mine' of .*test_likelihoods_of_others failed: ZeroDivisionError"),
        (lambda *_: {"rate": 1.0}, ": likelihood 'mine' must return Params of model 'zones', got dict"),
    ],
)
def test_what_finds_the_parameters_is_named(fit, words, monkeypatch):
    blocks = SimpleNamespace(train=lambda vision: None)
    with pytest.raises(PluginError, match=f"test_likelihoods_of_others.py{words}"):
        likeliest(registered(monkeypatch, fit=fit), blocks, 0)


def test_what_is_expected_of_the_parameters_is_named(monkeypatch):
    kind = registered(monkeypatch, prior=failing, numbers=NUMBERS)
    with pytest.raises(PluginError, match=r"others.py:[0-9]+: likelihood 'mine' of .* failed: ZeroDivisionError"):
        tension(kind.prior, kind.numbers, place(kind.numbers, ZONES()))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"model": "zoness"}, "there is no model 'zoness'; did you mean 'zones'"),
        ({"numbers": {"nose": (0.0, 1.0)}}, "model 'zones' has no parameter 'nose'"),
    ],
)
def test_a_likelihood_of_a_model_or_parameter_that_is_not_there_is_named(changed, words, monkeypatch):
    registered(monkeypatch, **changed)
    others = behaviours()["morse"].Params()
    with pytest.raises(PluginError, match=f"test_likelihoods_of_others.py: likelihood 'mine': {words}"):
        likelihood_of(others)
