import io

import pytest

from hcp_jax.training import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("stream", "lines"), [(io.StringIO, 3), (Terminal, 6)])
def test_a_file_gets_the_first_line_and_then_one_every_twenty_seconds_where_a_terminal_gets_all(monkeypatch, stream, lines):
    clock, out = [0.0], stream()
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr("sys.stdout", out)
    shown = progress.Progress(total_env_steps=1000)
    for seconds in (5, 10, 20, 30, 40, 60):
        clock[0] = seconds
        shown.update(seconds, "success 1 %")
    assert out.getvalue().count("success") == lines
    assert out.getvalue().lstrip("\r\033[K ").startswith("5 / 1,000 steps")
