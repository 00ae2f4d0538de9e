"""The screen Ablation."""
