"""What a run says while it works, in process 0: a line that is rewritten on a terminal, one now and then in a file."""

import sys
import time

from hcp_jax.devices import is_main

_FILE_SECONDS = 20.0  # between two progress lines where the last one cannot be rewritten


def say(text: str) -> None:
    """Prints a line, in process 0."""
    if is_main():
        print(text, flush=True)


class Progress:
    """Speed, elapsed and remaining time. Counts only the steps of this process."""

    def __init__(self, total_env_steps: int, start_env_steps: int = 0):
        self._total, self._start = total_env_steps, start_env_steps
        self._began = time.monotonic()
        self._next_in_file = self._began
        self._open_line = False

    @property
    def elapsed(self) -> float:
        """Seconds since this process started training."""
        return time.monotonic() - self._began

    def say(self, text: str) -> None:
        """Prints a line of its own."""
        if not is_main():
            return
        if self._open_line:
            print(flush=True)
        self._open_line = False
        print(text, flush=True)

    def update(self, env_steps: int, text: str) -> None:
        """Shows how far training has come, and `text`."""
        if not is_main():
            return
        rate = self.steps_per_second(env_steps)
        remaining = (self._total - env_steps) / rate if rate > 0 else 0.0
        line = (
            f"{env_steps:>12,} / {self._total:,} steps  {rate:>8,.0f} steps/s  {text}  "
            f"elapsed {format_seconds(self.elapsed)}  remaining {format_seconds(remaining)}"
        )
        if sys.stdout.isatty():
            print(f"\r\033[K{line}", end="", flush=True)
            self._open_line = True
        elif time.monotonic() >= self._next_in_file:
            print(line, flush=True)
            self._next_in_file = time.monotonic() + _FILE_SECONDS

    def steps_per_second(self, env_steps: int) -> float:
        return (env_steps - self._start) / max(self.elapsed, 1e-9)


def format_seconds(seconds: float) -> str:
    """`h:mm:ss`."""
    minutes, seconds = divmod(int(max(seconds, 0)), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}"
