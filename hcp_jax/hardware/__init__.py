"""Robots as data: parameter ranges, sampled variants, compiled and stacked pools, and their explicit encodings."""
