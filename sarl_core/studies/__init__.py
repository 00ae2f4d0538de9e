"""Many episodes against each other: comparison, ablation, divider."""
