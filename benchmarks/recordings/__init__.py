"""Recordings of real machines, each with what its source says that a text-book simulation leaves out.

``python -m benchmarks.recordings DATA`` reads the publishers' files from the folder DATA; nothing of them
lies in the checkout.
"""
