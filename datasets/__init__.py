"""Rendered videos of manipulation tasks, labelled by the expert."""
