"""The training loop: run folder, checkpoints, metrics, progress."""
