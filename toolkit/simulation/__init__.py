"""The virtual machine: tire, road, carriage, load cells and data acquisition, one stage a file.

Every stage is a pure function of the signals of the stage before it; `timeline` moves rack and actuator,
`chain` walks road, carriage and tire, `run` goes on through cells and acquisition, and `write` stores what
comes out as the machine itself would, marked *simulated*. Effects of the catalogue (`toolkit.effects`) act by
their hooks, each at its own stage; `case` makes a diagnosis case of a test.
"""
