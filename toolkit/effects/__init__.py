"""Physical effects that a simulation may have left out: equation, parameters, stage, signature, facts.

`catalogue` holds one file for each effect, found by a scan; `effect` and `facts` say what such a file
declares, and `surroundings` what it may ask of a case. An `applied` effect is one at a place with values;
`forward` takes them through their hooks. Effects know signals, never files, cases or fits: `simulation`
switches them on, `diagnosis` looks for them, `reduction` takes a machine's own away.
"""
