"""Telling how far long work is, as mining does."""

from sarl_core.mining.progress import CancelledError, Progress, report

__all__ = ["CancelledError", "Progress", "report"]
