"""The desk: what a home keeps and shows, what waits for a person, and the long work that goes on."""
