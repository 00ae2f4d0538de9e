"""What thresholds do to a rule set: the landscape over them, its front, and their steps."""
