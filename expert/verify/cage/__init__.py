"""Is an object caged?  Proves it, or shows the way out."""
