"""The pictures of the page: each function draws what was flown and computed, and returns the file's bytes."""
