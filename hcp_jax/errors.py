"""What bad input and broken runs raise, and how errors are said."""

import jax


class UserError(ValueError):
    """What the user gave cannot be used. Its message is one line that names it; commands print that and exit with code 2."""


class PhysicsOverflowError(RuntimeError):
    """Contacts or constraints were dropped because a buffer was too small."""

    def __init__(self, num_steps: int):
        super().__init__(
            f"{num_steps} control steps of worlds overflowed a contact or constraint buffer, so their results are wrong: "
            "raise max_contacts or max_constraints of MjxPhysics (hcp_jax/physics/mjx.py) or the template's <size memory>"
        )


class NonFiniteError(RuntimeError):
    """Losses or gradients were not finite in too many updates in a row."""


# What breaks a run on the way: also a full device memory, what a callback from compiled code raised, and a full disk.
BREAKING_ERRORS = (PhysicsOverflowError, NonFiniteError, jax.errors.JaxRuntimeError, OSError)


def one_line(error: BaseException) -> str:
    """An error's message without its line breaks."""
    return " ".join(str(error).split())
