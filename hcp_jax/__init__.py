"""Hardware Conditioned Policies for Multi-Robot Transfer Learning, in JAX."""

__version__ = "0.1.0"
