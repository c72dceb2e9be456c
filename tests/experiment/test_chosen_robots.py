import dataclasses

import pytest

from hcp_jax.config import ConfigError
from hcp_jax.experiment.chosen_robots import TRAINED, Choice, check_choice, heldout_kinds, read_choice


@pytest.mark.parametrize(
    ("word", "choice"),
    [("H:3", Choice("H", 3)), ("train:12", Choice("train", 12)), ("H3", None), ("H:-3", None), ("arms/H:3.urdf", None)],
)
def test_a_kind_and_a_row_are_a_choice_and_nothing_else_is(word, choice):
    assert read_choice(word) == choice
    assert choice is None or str(choice) == word


def test_arms_that_hold_a_peg_are_of_the_peg_alone_and_random_chains_of_the_reacher(tiny_config, tiny_arms):
    assert heldout_kinds(tiny_config) == ("hopper",)
    assert heldout_kinds(tiny_arms) == (*"ABCDEFGHI", "R4", "R5", "R6", "R7")
    assert heldout_kinds(dataclasses.replace(tiny_arms, task="peg_insertion")) == tuple("ABCDEFGHIJK")


def test_a_row_is_one_of_the_training_pool_or_one_that_can_be_drawn(tiny_arms):
    kinds = (*heldout_kinds(tiny_arms), TRAINED)
    for choice in (Choice(TRAINED, 3), Choice("A", 9_999)):
        check_choice(tiny_arms, choice, kinds, "--robot")
    for choice, highest in ((Choice(TRAINED, 4), 3), (Choice("A", 10_000), 9_999)):
        with pytest.raises(ConfigError, match=f"^--robot={choice}: expected a row from 0 to {highest}$"):
            check_choice(tiny_arms, choice, kinds, "--robot")
    with pytest.raises(ConfigError, match=r"^--robot=J:0: expected types out of A, B, .*, train for reacher$"):
        check_choice(tiny_arms, Choice("J", 0), kinds, "--robot")
