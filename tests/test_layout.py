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
        for imported in find_imports(path.read_text()):
            assert layer_of(imported) <= layer_of(module), f"{module} imports {imported}"


def find_imports(source: str) -> list[str]:
    """The modules of ours that a source imports, in any of Python's forms."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, "relative imports are not looked at"
            found += [f"hcp_jax.{name.name}" for name in node.names] if node.module == "hcp_jax" else [node.module or ""]
        elif isinstance(node, ast.Import):
            found += [name.name for name in node.names]
    return [name for name in found if name.startswith("hcp_jax.")]


def test_an_import_is_seen_in_each_of_its_forms():
    source = (
        "import jax, hcp_jax.sweep\nfrom hcp_jax import envs, train\nfrom hcp_jax.physics.base import x\nfrom os import path"
    )
    expected = ["hcp_jax.sweep", "hcp_jax.envs", "hcp_jax.train", "hcp_jax.physics.base"]
    assert find_imports(source) == expected


def test_there_are_no_modules_without_a_subject():
    assert not [path for path in PACKAGE.rglob("*.py") if path.stem in ("utils", "helpers", "common", "misc")]
