"""The notebooks run from top to bottom in a fresh kernel, at tiny sizes."""

import pathlib

import pytest

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
needs_jupyter = "notebooks are run by the extra `notebooks`"


def read(path: pathlib.Path):
    nbformat = pytest.importorskip("nbformat", reason=needs_jupyter)
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    return notebook


def printed(notebook) -> str:
    return "".join(part.get("text", "") for cell in notebook.cells for part in cell.get("outputs", []))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_without_outputs(path):
    for cell in read(path).cells:
        assert not cell.get("outputs"), cell.source
        assert cell.get("execution_count") is None, cell.source


EXPECTED = {
    "1_train_a_hopper_pool": "correlation with the return",
    "2_zero_shot_on_an_unseen_arm": "type H, zero-shot:",
    "3_your_own_robot": "within reach were",
    "4_the_embedding": "heldout_fitted",
}

# CPU seconds of the four on a cold compilation cache: about 25, 40, 65, 40.
SLOW = ("2_zero_shot_on_an_unseen_arm", "3_your_own_robot")


def test_every_notebook_is_run():
    assert [path.stem for path in NOTEBOOKS] == list(EXPECTED)


@pytest.mark.parametrize(
    "path", [pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem in SLOW)) for path in NOTEBOOKS]
)
def test_a_notebook_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason=needs_jupyter)
    pytest.importorskip("ipykernel", reason=needs_jupyter)
    monkeypatch.setenv("HCP_JAX_TINY", "1")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    notebook = read(path)
    nbclient.NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}
    ).execute()
    assert EXPECTED[path.stem] in printed(notebook)
