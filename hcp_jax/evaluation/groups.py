"""Which runs are seeds of one experiment: those whose configs differ in nothing else."""

import json
import pathlib
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from hcp_jax.config import Config, to_dict
from hcp_jax.training.run_folder import identify_arm, read_config

T = TypeVar("T")


def settings_of(config: Config) -> str:
    """A key that two configs share if they differ in their seed alone, in which run they start from, and in where the file of
    the same arm is."""
    apart = {"seed": None, "init": bool(config.init), "robot": identify_arm(config), "robot_base": "", "robot_tip": ""}
    return json.dumps(to_dict(config) | apart)


def group_by_settings(items: Iterable[T], config_of: Callable[[T], Config], *others: Callable[[T], object]) -> list[list[T]]:
    """Items of equal settings together, in the order in which they come; what `others` give must be equal too."""
    groups: dict[tuple, list[T]] = {}
    for item in items:
        key = (settings_of(config_of(item)), *(other(item) for other in others))
        groups.setdefault(key, []).append(item)
    return list(groups.values())


def group_folders(folders: Sequence[pathlib.Path]) -> dict[str, list[pathlib.Path]]:
    """Run folders of equal settings, by the experiment's name. Where several settings share a name, their folders follow it."""
    groups = group_by_settings(folders, read_config)
    names = [read_config(group[0]).name for group in groups]
    return dict(zip(label_groups(names, [[folder.name for folder in group] for group in groups]), groups, strict=True))


def label_groups(names: Sequence[str], runs: Sequence[Sequence[str]]) -> list[str]:
    """Each group's name, followed by its runs where another group has the same name."""
    return [
        f"{name} ({', '.join(of_group)})" if names.count(name) > 1 else name for name, of_group in zip(names, runs, strict=True)
    ]
