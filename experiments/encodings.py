"""Exp. I and V with four other v_h, at equal steps: the paper's constant, none (Exp. II and VI), and what the end effector
alone explains: its position, and its offset from the goal.

`python -m hcp_jax.sweep experiments/encodings.py`
"""

from hcp_jax import presets
from hcp_jax.config import Config

ENCODINGS = {"chain": "chain", "ddpg": "none", "end_effector": "none+end_effector", "goal_offset": "none+goal_offset"}
TASKS = {"reacher": "reacher", "peg": "peg_insertion"}


def get_configs() -> list[Config]:
    return [
        presets.arm(f"{prefix}_{name}_leave_h", task, encoding, left_out="H")
        for prefix, task in TASKS.items()
        for name, encoding in ENCODINGS.items()
    ]
