"""The laboratory's work: the use cases that the command line and the library's front door have in common.

A use case puts the floors below together: it finds the home and the record that applies, reads a test, fits
its models, fills a template, hands over files, watches a folder, repairs an archive. ``..._answer`` modules
hold what a use case says: the JSON of the contract, and the text for people. Nothing here parses a command
line or prints.

Each kind of work has its room. The front door, `toolkit.__all__`, is `laboratory`, `records.record`,
`tire_tests.test`, `tire_tests.tires`, `studies.cases` and `archives.archive`; what they return are `faces`.
"""
