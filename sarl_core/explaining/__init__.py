"""For people: rules in words, figures, exports."""
