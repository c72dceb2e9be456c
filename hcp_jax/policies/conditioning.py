"""Where v_h comes from: a fixed encoding of the hardware, or an embedding learned with the policy (HCP-I)."""

import jax
import jax.numpy as jnp

from hcp_jax.hardware.encodings import encode
from hcp_jax.hardware.pool import RobotPool


class Encoding:
    """v_h is a constant of the robot: `none`, `kinematics`, `kinematics+dynamics`, `random`."""

    is_learned = False

    def __init__(self, pool: RobotPool, encoding: str, reference: RobotPool):
        self._table = jnp.asarray(encode(pool, encoding, reference))
        self.size = self._table.shape[1]

    def init(self, key: jax.Array) -> None:
        """No parameters."""
        return None

    def v_h(self, embedding: None, index: jax.Array) -> jax.Array:
        """The encoding of the robots at positions `index` [...]: [..., K]."""
        return self._table[index]


class Embedding:
    """v_h is row `index` of a learned table [num_robots, size] (paper, section 3.2: implicit encoding)."""

    is_learned = True

    def __init__(self, num_robots: int, size: int, initial_scale: float):
        self.num_robots, self.size, self._initial_scale = num_robots, size, initial_scale

    def init(self, key: jax.Array) -> jax.Array:
        return self._initial_scale * jax.random.normal(key, (self.num_robots, self.size))

    def v_h(self, embedding: jax.Array, index: jax.Array) -> jax.Array:
        """The embedding of the robots at positions `index` [...]: [..., size]."""
        return embedding[index]


Conditioning = Encoding | Embedding
