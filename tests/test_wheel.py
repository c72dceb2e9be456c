"""The wheel carries everything: robots are found, and training works, outside the checkout."""

import pathlib
import subprocess
import sys
import sysconfig
import venv

import pytest

from hcp_jax.config import to_dict

ROOT = pathlib.Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def installed_python(tmp_path_factory) -> pathlib.Path:
    """The interpreter of a clean environment that has the built wheel; its dependencies are this environment's."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "venv", with_pip=True)
    python = folder / "venv" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-deps", str(wheel)], check=True)
    purelib = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], check=True, capture_output=True, text=True
    ).stdout.strip()
    (pathlib.Path(purelib) / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return python


def test_an_installed_wheel_trains_for_one_iteration_outside_the_checkout(installed_python, tiny_config, tmp_path):
    (tmp_path / "experiment.py").write_text(
        "from hcp_jax.config import Config, from_dict\n"
        f"def get_config():\n    return from_dict(Config, {to_dict(tiny_config)!r})\n"
    )
    without = ["--config.embedding.identify_steps=0", "--config.embedding.fit_steps=0"]
    arguments = ["--config", "experiment.py", "--config.total_env_steps=64", *without]
    result = subprocess.run(
        [installed_python, "-m", "hcp_jax.train", *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "runs" / "tiny" / "metrics.csv").read_text().count("\n") == 2
    where = subprocess.run(
        [installed_python, "-c", "from hcp_jax.hardware import catalogue as c; print(c.find_robot('panda'))"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert where.stdout.startswith(str(installed_python.parents[1]))
