"""Physical effects that a simulation may have left out, one a file: equation, parameters, stage, signature.

Effects know signals, never files, cases or fits: `simulation` switches them on, `diagnosis` looks for them.
"""
