"""The paper's appendix tables, and ours: success on every type but the one left out."""

import pathlib

from hcp_jax.evaluation.table1 import find_paper, group_evaluations, left_out_type, make_row, sort_rows

# By experiment: mean and deviation [%] on each type trained on, in the alphabet's order. The paper heads the columns of VII and
# VIII A to G and I, though these left E out; they are read in order, as A to D and F to I.
PAPER_TRAINING_TYPES = {
    1: ((93.1, 2.91), (95.7, 1.55), (98.2, 1.55), (97.5, 1.02), (95.3, 1.49), (94.0, 3.26), (98.4, 1.11), (97.9, 1.67)),
    2: ((1.0, 1.22), (1.0, 1.0), (2.5, 1.36), (0.1, 0.3), (0.7, 0.78), (1.2, 1.4), (1.3, 1.35), (2.0, 1.26)),
    3: ((92.0, 2.28), (89.6, 3.01), (98.6, 1.2), (99.0, 0.63), (96.7, 1.42), (97.9, 1.64), (99.3, 0.64), (99.2, 0.6)),
    4: ((1.3, 0.9), (1.3, 0.89), (1.6, 0.92), (0.7, 0.46), (0.2, 0.4), (2.3, 1.18), (0.9, 0.83), (1.4, 0.92)),
    5: ((91.1, 2.77), (95.9, 1.92), (98.5, 1.5), (84.89, 3.29), (94.7, 1.85), (92.0, 2.97), (97.2, 1.32), (94.2, 2.79)),
    6: ((0.3, 0.46), (1.9, 1.3), (3.0, 1.26), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.6, 0.66), (0.0, 0.0)),
    7: ((88.6, 2.45), (95.3, 2.0), (98.9, 0.83), (83.3, 3.49), (81.3, 3.2), (92.0, 3.13), (89.4, 3.2), (88.0, 4.54)),
    8: ((3.3, 2.32), (1.7, 1.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.1, 0.3)),
    9: ((92.9, 3.59), (95.9, 1.7), (97.3, 1.1), (90.9, 3.58), (95.59, 1.43), (94.6, 1.28), (98.8, 0.6), (97.1, 1.51)),
    10: ((1.6, 1.2), (2.3, 1.27), (0.4, 0.66), (0.0, 0.0), (1.8, 1.54), (0.0, 0.0), (0.4, 0.49), (0.0, 0.0)),
    11: ((71.0, 5.22), (85.8, 3.19), (89.0, 2.53), (6.7, 2.53), (79.3, 3.9), (45.7, 4.86), (88.5, 2.42), (68.5, 5.18)),
    12: ((1.7, 1.88), (3.9, 2.2), (0.9, 1.04), (0.1, 0.3), (2.5, 0.92), (0.1, 0.3), (1.0, 1.0), (0.7, 0.78)),
    13: ((64.7, 6.3), (86.1, 3.36), (89.6, 2.95), (54.1, 3.53), (58.6, 3.83), (83.2, 2.96), (66.3, 3.57), (62.5, 4.03)),
    14: ((0.3, 0.46), (0.1, 0.3), (1.9, 0.94), (0.0, 0.0), (0.2, 0.4), (1.9, 1.3), (0.1, 0.3), (2.8, 1.6)),
    15: ((73.7, 4.79), (86.2, 4.04), (80.9, 3.88), (16.0, 3.26), (69.7, 4.54), (76.8, 3.25), (85.8, 4.38), (59.9, 5.22)),
    16: ((1.9, 1.37), (7.6, 2.65), (3.1, 1.04), (0.0, 0.0), (3.7, 1.62), (0.6, 0.66), (1.3, 1.0), (0.4, 0.8)),
}
PAPER_TYPES = "ABCDEFGHI"  # that one is left out of
# (experiment, type) of arms of other templates: mean and deviation [%]; K was tested 10 times.
PAPER_OTHER_ARMS = {(5, "J"): (86.3, 4.41), (5, "K"): (100.0, None)}
# Success [%] of DDPG+HER on 100 arms of type I with damping [N m s/rad] from each range, trained from 0.01 to 2.
PAPER_DAMPING = {
    (0.01, 2.0): 100.0,
    (2.0, 10.0): 100.0,
    (10.0, 20.0): 100.0,
    (20.0, 30.0): 100.0,
    (30.0, 40.0): 85.0,
    (40.0, 50.0): 47.0,
}


def paper_by_type(experiment: int | None, left_out: str, test_type: str) -> tuple[float, float | None] | None:
    """The paper's success on a type that was trained on, or on one of another template; None where it has none."""
    if experiment is None:
        return None
    trained = [name for name in PAPER_TYPES if name != left_out]
    if test_type in trained:
        return PAPER_TRAINING_TYPES[experiment][trained.index(test_type)]
    return PAPER_OTHER_ARMS.get((experiment, test_type))


def make_appendix(results: pathlib.Path) -> list[dict]:
    """Rows of `table1.make_row` for every type that experiments were evaluated on beside the one left out."""
    rows = []
    for runs in group_evaluations(results):
        left_out = left_out_type(runs[0][2])
        experiment, _ = find_paper(runs[0][2], left_out)
        for test_type in sorted(set().union(*(record["types"] for _, record, _ in runs)) - {left_out}):
            evaluated = [run for run in runs if test_type in run[1]["types"]]  # other templates may be of one seed alone
            paper = paper_by_type(experiment, left_out, test_type)
            rows.append(make_row(evaluated, results, test_type, experiment, paper))
    return sort_rows(rows)
