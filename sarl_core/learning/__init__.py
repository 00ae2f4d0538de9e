"""Learners under a shield, and experts."""
