import dataclasses

import pytest

from hcp_jax.config import ArmPoolConfig, ConfigError
from hcp_jax.evaluation.new_robots import change_ranges


def test_a_run_on_random_chains_has_their_ranges_changed_and_another_the_others(tiny_arms):
    chains = dataclasses.replace(tiny_arms, pool=ArmPoolConfig(types=("R6",), left_out=()))
    changed = change_ranges(chains, [("damping", 1.0, 2.0)], ("R5",)).pool
    assert (changed.chain_ranges.damping, changed.ranges) == ((1.0, 2.0), chains.pool.ranges)
    changed = change_ranges(tiny_arms, [("damping", 1.0, 2.0)]).pool
    assert (changed.ranges.damping, changed.chain_ranges) == ((1.0, 2.0), tiny_arms.pool.chain_ranges)
    with pytest.raises(ConfigError, match="no such field; did you mean mass_ratio"):
        change_ranges(chains, [("mass_ratios", 1.0, 2.0)], ("R6",))
    with pytest.raises(ConfigError, match="parallel_share: no such field"):
        change_ranges(chains, [("parallel_share", 0.0, 1.0)], ("R5",))


def test_ranges_are_those_of_the_types_that_are_evaluated_and_not_of_the_run(tiny_arms):
    changed = change_ranges(tiny_arms, [("damping", 1.0, 2.0)], ("R4", "R5")).pool
    assert (changed.chain_ranges.damping, changed.ranges) == ((1.0, 2.0), tiny_arms.pool.ranges)
    with pytest.raises(ConfigError, match="types R4, H have no ranges in common; choose with --types"):
        change_ranges(tiny_arms, [("damping", 1.0, 2.0)], ("R4", "H"))
