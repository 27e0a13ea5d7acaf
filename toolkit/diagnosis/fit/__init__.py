"""The fit: a simulation held against its recordings, its noise, its parameters and its predictions."""
