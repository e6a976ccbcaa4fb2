"""Certified grasping: finger paths whose nested cages end in one observable grasp (Thesis Ch. 5.2)."""
