"""What bad input raises, and how errors are said."""


class UserError(ValueError):
    """What the user gave cannot be used. Its message is one line that names it; commands print that and exit with code 2."""


def one_line(error: BaseException) -> str:
    """An error's message without its line breaks."""
    return " ".join(str(error).split())
