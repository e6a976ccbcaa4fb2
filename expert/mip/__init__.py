"""Mixed-integer models that read like the equations: implications with derived constants, envelopes, honest results."""
