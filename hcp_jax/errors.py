"""What bad input raises."""


class UserError(ValueError):
    """What the user gave cannot be used. Its message is one line that names it; commands print that and exit with code 2."""
