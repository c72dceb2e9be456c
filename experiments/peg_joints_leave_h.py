"""Exp. V with networks whose layers are shared by all joints, on joint poses and Jacobians at the current joint angles."""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    ddpg = dataclasses.replace(presets.FAST_PEG_DDPG, network="joints", hidden_sizes=(64, 256, 256))
    return presets.arm("peg_joints_leave_h", "peg_insertion", "chain_fk+jacobian", left_out="H", ddpg=ddpg)
