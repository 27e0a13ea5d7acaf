"""The answer: what was found, what could not be told, and what to measure next."""
