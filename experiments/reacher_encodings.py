"""Exp. I with every other v_h, at equal steps: the paper's constant, none (Exp. II), and what the end effector alone explains.

`python -m hcp_jax.sweep experiments/reacher_encodings.py`
"""

from hcp_jax import presets
from hcp_jax.config import Config

ENCODINGS = {
    "reacher_chain_leave_h": "chain",
    "reacher_ddpg_leave_h": "none",
    "reacher_end_effector_leave_h": "none+end_effector",
    "reacher_goal_offset_leave_h": "none+goal_offset",
}


def get_configs() -> list[Config]:
    return [presets.arm(name, "reacher", encoding, left_out="H") for name, encoding in ENCODINGS.items()]
