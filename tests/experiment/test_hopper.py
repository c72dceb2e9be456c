import numpy as np

from hcp_jax.training import loop
from hcp_jax.training.policy_file import load_policy


def test_v_h_is_fitted_once_to_what_stands_still_and_anew_to_anything_else(finished_run, tiny_config, monkeypatch):
    run = loop.make_experiment(tiny_config)
    state = load_policy(finished_run, run)[1]
    moved = state.replace(params=state.params | {"embedding": state.params["embedding"] + 1.0})
    fits, train = [], run.fitter._ppo.train
    monkeypatch.setattr(run.fitter, "_fitted", None)
    monkeypatch.setattr(run.fitter._ppo, "train", lambda *arguments: fits.append(1) or train(*arguments))
    first, again, other, last = (np.asarray(run.fitter(given)) for given in (state, state, moved, state))
    assert len(fits) == 3
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, last)
    assert np.abs(other - first).min() > 0.5
