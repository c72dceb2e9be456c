"""Pictures and videos of what policies do."""
