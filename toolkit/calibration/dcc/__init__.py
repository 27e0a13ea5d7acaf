"""Digital calibration certificates (PTB's DCC 3.x with D-SI) of reference standards, read.

`structure` holds a document against the form of the schema, `quantities` reads values with uncertainties,
`certificate` what a certificate says as a whole, `standard` what a session takes from it, and on what terms.
"""
