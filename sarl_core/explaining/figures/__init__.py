"""Figures, drawn by Plotly."""
