import jax
import numpy as np

from hcp_jax.policies.conditioning import Embedding, Encoding


def test_the_embedding_is_a_parameter_with_its_own_initial_scale(key):
    embedding = Embedding(num_robots=500, size=32, initial_scale=0.05)
    table = embedding.init(key)
    assert table.shape == (500, 32)
    assert 0.045 < float(table.std()) < 0.055
    np.testing.assert_array_equal(embedding.v_h(table, np.array([[3, 1]])), table[np.array([[3, 1]])])


def test_only_the_rows_of_the_robots_that_acted_get_a_gradient(key):
    embedding = Embedding(10, 4, 1.0)
    table = embedding.init(key)
    gradient = jax.grad(lambda table: embedding.v_h(table, np.array([2, 7, 2])).sum())(table)
    assert np.flatnonzero(np.asarray(gradient).any(axis=1)).tolist() == [2, 7]
    np.testing.assert_allclose(gradient[2], 2.0)


def test_an_encoding_has_no_parameters_and_looks_rows_up(pool, key):
    encoding = Encoding(pool, "kinematics", pool)
    assert encoding.init(key) is None
    assert encoding.v_h(None, np.array([4, 4])).shape == (2, 4)
