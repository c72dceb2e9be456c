"""Reinforcement learning algorithms as pure functions of a training state."""
