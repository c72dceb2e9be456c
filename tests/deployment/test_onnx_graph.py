import jax
import jax.numpy as jnp
import numpy as np
import onnxruntime
import pytest

from hcp_jax.deployment.onnx_graph import OnnxError, to_onnx
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.policies.goal_conditioning import GoalConditioning
from hcp_jax.policies.networks import DeterministicActor, JointActor


def run_onnx(function, observation: np.ndarray) -> np.ndarray:
    model = to_onnx(function, len(observation), "x", "y").SerializeToString()
    (result,) = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"]).run(None, {"x": observation})
    return result


@pytest.fixture(scope="module")
def one_arm() -> RobotPool:
    return make_arm_pool("reacher", ArmRanges(), ("H",), 1, seed=0)


@pytest.mark.parametrize(
    ("encoding", "actor"),
    [
        ("chain+dynamics", DeterministicActor((8, 8), 7)),
        ("chain_fk+jacobian+dynamics", DeterministicActor((8, 8), 7, layer_norm=True, film_from=17)),
        pytest.param("chain_fk+jacobian", JointActor((8, 8), layer_norm=True), marks=pytest.mark.slow),
    ],
)
def test_networks_and_their_inputs_give_the_same_in_onnx(encoding, actor, one_arm, key, rng):
    conditioning = GoalConditioning(one_arm, encoding, one_arm, 14, 3, joint_slots="aligned")
    params = actor.init(key, jnp.zeros((1, conditioning.size)))
    params = jax.tree.map(lambda leaf: leaf + 0.3 * jax.random.normal(key, leaf.shape), params)

    def act(x):
        inputs = conditioning.inputs(None, jnp.zeros(1, jnp.int32), x[None, :14], x[None, 14:])
        return actor.apply(params, inputs)[0]

    observation = rng.normal(size=17).astype(np.float32)
    np.testing.assert_allclose(run_onnx(act, observation), jax.jit(act)(observation), atol=1e-5)


FUNCTIONS = {
    "products over any axes": lambda x: jnp.einsum("ij,kji->ik", x.reshape(2, 3), jnp.arange(12.0).reshape(2, 3, 2)),
    "strides, padding and powers": lambda x: jnp.pad(x[1::2], (2, 1), constant_values=3.0) ** 3,
    "axes that move": lambda x: jnp.moveaxis(x.reshape(1, 2, 3), 1, 2) @ jnp.ones((2, 2)),
    "sums, roots and choices": lambda x: jnp.where(x > 0.1, jnp.sqrt(jnp.sum(x.reshape(2, 3) ** 2, axis=0)).repeat(2), -x),
    "functions with a derivative of their own": lambda x: jax.nn.relu(x) + jax.nn.selu(x),
    "the same constant twice": lambda x: (x + jnp.full(6, 2.0)) * jnp.full(6, 2.0),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_arrays_are_handled_as_jax_handles_them(name, rng):
    function, observation = FUNCTIONS[name], rng.normal(size=6).astype(np.float32)
    np.testing.assert_allclose(run_onnx(function, observation), function(observation), rtol=1e-5, atol=1e-6)


def test_what_has_no_translation_is_named():
    with pytest.raises(OnnxError, match="primitive sort has no translation"):
        to_onnx(jnp.sort, 3, "x", "y")
    with pytest.raises(OnnxError, match="primitive scan has no translation"):
        to_onnx(lambda x: jax.lax.scan(lambda carry, row: (carry + row, None), x, jnp.ones((2, 3)))[0], 3, "x", "y")
    with pytest.raises(OnnxError, match="does not depend"):
        to_onnx(lambda x: jnp.ones(3), 3, "x", "y")
