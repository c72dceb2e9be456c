"""Vectorised environments over a robot pool."""
