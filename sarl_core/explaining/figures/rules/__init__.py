"""Figures of the rules of a set, one beside the other."""
