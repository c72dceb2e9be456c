"""Measurements: what runs how fast, side by side in one run."""
