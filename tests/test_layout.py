"""The architecture's one direction: an import never runs back up."""

import ast
import pathlib

PACKAGE = pathlib.Path(__file__).resolve().parents[1] / "hcp_jax"
# From the ground up (docs: DESIGN). A module may import from its own layer and those before it.
LAYERS = [
    "errors",
    "devices",
    "hardware",
    "physics",
    "envs",
    "config",
    "presets",
    "policies",
    "algorithms",
    "experiment",
    "gym",
    "training",
    "deployment",
    "evaluation",
    "reporting",
    "rendering",
]


def layer_of(module: str) -> int:
    name = module.split(".")[1] if "." in module else ""
    return LAYERS.index(name) if name in LAYERS else len(LAYERS)


def test_imports_run_one_way():
    for path in PACKAGE.rglob("*.py"):
        module = ".".join(("hcp_jax", *path.relative_to(PACKAGE).with_suffix("").parts))
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hcp_jax."):
                assert layer_of(node.module) <= layer_of(module), f"{module} imports {node.module}"


def test_there_are_no_modules_without_a_subject():
    assert not [path for path in PACKAGE.rglob("*.py") if path.stem in ("utils", "helpers", "common", "misc")]
