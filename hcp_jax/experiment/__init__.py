"""Experiments: what a config stands for."""
