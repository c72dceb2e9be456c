import jax
import jax.numpy as jnp

from hcp_jax.benchmarks.matmuls import count_products, make_bare_products, total_flops


def layers(inputs: jax.Array, first: jax.Array, second: jax.Array) -> jax.Array:
    return jnp.sum(jnp.tanh(inputs @ first) @ second)


def test_products_of_scans_are_counted_as_often_as_they_run_and_those_of_gradients_too():
    inputs, first, second = jnp.ones((8, 3)), jnp.ones((3, 5)), jnp.ones((5, 2))

    def repeated(inputs, first, second):
        step = jax.jit(jax.grad(layers, argnums=(1, 2)))
        return jax.lax.scan(lambda carry, _: (carry, step(inputs, first, second)), 0.0, length=4)

    forward = 2 * 8 * (3 * 5 + 5 * 2)
    backward = 2 * 8 * (3 * 5 + 2 * 5 * 2)  # of the weights, and of what the second layer sees
    # The gradient of a sum does not need the second product itself.
    assert total_flops(count_products(layers, inputs, first, second)) == forward
    assert total_flops(count_products(repeated, inputs, first, second)) == 4 * (forward + backward)


def test_batched_products_count_every_row():
    left, right = jnp.ones((4, 8, 3)), jnp.ones((4, 3, 5))
    assert total_flops(count_products(jnp.matmul, left, right)) == 4 * 2 * 8 * 3 * 5


def test_bare_products_run_any_number_of_times():
    products = count_products(layers, jnp.ones((8, 3)), jnp.ones((3, 5)), jnp.ones((5, 2)))
    make_bare_products(products)(3)
