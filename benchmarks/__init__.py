"""Public benchmark sets: a text-book model with the diagnosis, three peers and published figures in one run.

``python -m benchmarks DATA`` reads the publishers' files from the folder DATA; nothing of them lies in the
checkout.
"""
