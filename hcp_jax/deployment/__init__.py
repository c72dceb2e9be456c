"""A policy for one robot, as files that run without this package."""
