"""The bound of a learner: the matrix products of its updates and nothing else."""

import collections
import functools
import inspect
import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp


class Product(NamedTuple):
    """One `dot_general`: shapes of its sides and its dimension numbers."""

    left: tuple[int, ...]
    right: tuple[int, ...]
    dimensions: Any

    @property
    def flops(self) -> int:
        (contracted, right_contracted), (_, right_batch) = self.dimensions
        rows = math.prod(size for axis, size in enumerate(self.left) if axis not in contracted)
        columns = math.prod(size for axis, size in enumerate(self.right) if axis not in (*right_contracted, *right_batch))
        return 2 * rows * columns * math.prod(self.left[axis] for axis in contracted)


Products = collections.Counter  # of Product


def count_products(function: Callable, *args) -> Products:
    """The matrix products in one call of `function`: bodies of scans as often as they run, those of `while` loops once."""
    counts: Products = collections.Counter()
    traced = jax.make_jaxpr(inspect.unwrap(function))  # a jitted function with compiler options cannot be traced inside another
    for product, repeats in walk(traced(*args).jaxpr, 1):
        counts[product] += repeats
    return counts


def walk(jaxpr: Any, repeats: int) -> Iterator[tuple[Product, int]]:
    for equation in jaxpr.eqns:
        if equation.primitive.name == "dot_general":
            left, right = (variable.aval.shape for variable in equation.invars)
            yield Product(left, right, equation.params["dimension_numbers"]), repeats
        inner = repeats * (equation.params["length"] if equation.primitive.name == "scan" else 1)
        for parameter in equation.params.values():
            for value in parameter if isinstance(parameter, (tuple, list)) else (parameter,):
                value = getattr(value, "jaxpr", value)
                if hasattr(value, "eqns"):
                    yield from walk(value, inner)


def make_bare_products(products: Products, compiler_options: dict[str, bool] | None = None) -> Callable[[int], None]:
    """A function that computes all of `products` n times on random arrays, compiled as what they are the bound of."""
    key = jax.random.key(0)
    sides = [(jax.random.normal(key, product.left), jax.random.normal(key, product.right)) for product in products]

    @functools.partial(jax.jit, compiler_options=compiler_options)
    def compute(sides, count):
        def once(_, carry):
            # Each side depends on the result before, or the loop would be computed once.
            total = 0.0
            for (left, right), (product, repeats) in zip(sides, products.items(), strict=True):
                for repeat in range(repeats):
                    result = jax.lax.dot_general(left.at[(0,) * left.ndim].set(carry + repeat), right, product.dimensions)
                    total += result[(0,) * result.ndim]
            return jnp.tanh(total)

        return jax.lax.fori_loop(0, count, once, jnp.float32(0.0))

    return lambda count: jax.block_until_ready(compute(sides, count))


def total_flops(products: Products) -> int:
    return sum(product.flops * repeats for product, repeats in products.items())
