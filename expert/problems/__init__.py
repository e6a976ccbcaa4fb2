"""Each problem kind as a noun: what is asked, and what an answer is.  No algorithms."""
