"""Agents in environments: running, recording, training and rendering them."""
