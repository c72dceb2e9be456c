import pytest

from hcp_jax.evaluation.embedding import knn_r2, plot_embedding


def test_a_target_that_is_smooth_over_the_embedding_is_predicted(rng):
    embedding = rng.normal(size=(600, 2))
    assert knn_r2(embedding, embedding[:, 0] + 0.5 * embedding[:, 1]) > 0.97


def test_a_target_unrelated_to_the_embedding_is_not(rng):
    assert knn_r2(rng.normal(size=(600, 2)), rng.normal(size=600)) < 0.1


def test_prediction_never_sees_the_robot_itself(rng):
    """With one neighbour, a robot that predicted itself would give R^2 of exactly 1."""
    assert knn_r2(rng.normal(size=(200, 2)), rng.normal(size=200), neighbours=1) < 0.2


def test_the_scatter_is_a_picture(rng, tmp_path):
    plot_embedding(rng.normal(size=(20, 2)), rng.uniform(size=20), tmp_path / "embedding.png")
    assert (tmp_path / "embedding.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(TypeError):
        plot_embedding(rng.normal(size=(20, 3)), rng.uniform(size=20), tmp_path / "other.png")
