"""Evaluation of trained policies: rollouts, statistics, embeddings."""
