"""The architectures of Table 4.1 (Thesis Ch. 4.3)."""
