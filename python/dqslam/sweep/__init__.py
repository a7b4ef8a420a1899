"""Sweeps: many trials of many settings, resumable, on one machine or a cluster."""
