"""Does every start of a set end in the grasp?"""
