"""The virtual M-15: tire, road, carriage, load cells and data acquisition, one stage a file.

Every stage is a pure function of the signals of the stage before it; `run` walks them in order and
`write` stores what comes out as the machine itself would, marked *simulated*.
"""
