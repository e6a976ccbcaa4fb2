"""Does a plan of pushes bring the object to its goal?  Own law of contact, own integration, swept clearances."""
