"""Learners of trees, which all give queries of one kind, and what is counted at their nodes."""
