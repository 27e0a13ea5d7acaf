"""Cases with a concealed effect: drawn, sealed, run through `toolkit diagnose`, opened and scored.

Nothing here imports the toolkit: the physics is written again, in other formulations, so that the proof does
not rest on the code that it tests. `python -m proof --help` shows the commands.
"""
